"""What has changed in a straight tunnel, from hits that are made: a parked machine, walls nearer or gone, people, a lost place."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.localization.changes import CAME, WENT, Change, WorldChanges
from lhdmap.messages import FloatArray
from lhdmap.topology.model import DEAD_END, TopologicalMap, Tunnel
from lhdmap.topology.sheet import FREE, OCCUPIED, Sheet

from tests.localization.tunnels import straight_walls

LENGTH_M, HALF_M, CELL_M = 80.0, 2.2, 0.2
RANGE_M, BEAMS = 12.0, 360


def world() -> WorldChanges:
    line = np.column_stack([np.arange(0.0, LENGTH_M + 0.5, 0.5), np.zeros((161, 2))])
    one = Tunnel("s", "S", (DEAD_END, DEAD_END), line, np.full((len(line), 2), HALF_M), np.zeros(4))
    sheet = Sheet(np.zeros((60, 420), np.uint8), np.array([-2.0, -6.0]), CELL_M)
    y = sheet.middles_m(np.column_stack([np.arange(60), np.zeros(60, int)]))[:, 1]
    sheet.cells[np.abs(y) < HALF_M] = FREE
    sheet.cells[np.abs(np.abs(y) - HALF_M) < 0.6 * CELL_M] = OCCUPIED
    return WorldChanges(TopologicalMap(tunnels=(one,)), [sheet], straight_walls(LENGTH_M, HALF_M))


def seen_from(pose: FloatArray, walls: list[FloatArray]) -> FloatArray:
    """Hits (N, 2) in the machine's frame on wall segments (x0, y0, x1, y1), the first on each beam."""
    angles = np.linspace(-math.pi, math.pi, BEAMS, endpoint=False) + pose[2]
    ways = np.column_stack([np.cos(angles), np.sin(angles)])
    best = np.full(BEAMS, np.inf)
    for x0, y0, x1, y1 in walls:
        along, off = np.array([x1 - x0, y1 - y0]), np.array([x0, y0]) - pose[:2]
        cross = ways[:, 0] * along[1] - ways[:, 1] * along[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            far = (off[0] * along[1] - off[1] * along[0]) / cross
            share = (off[0] * ways[:, 1] - off[1] * ways[:, 0]) / cross
        best = np.where((far > 0.1) & (share >= 0.0) & (share <= 1.0), np.minimum(best, far), best)
    hit = best < RANGE_M
    noise = np.random.default_rng(1).normal(0.0, 0.012, BEAMS)
    points = pose[:2] + (best[hit] + noise[hit])[:, None] * ways[hit]
    return se2.transform(se2.inverse(pose), points)


SIDES = [np.array([-10.0, side * HALF_M, 95.0, side * HALF_M]) for side in (1.0, -1.0)]


def box(x0: float, x1: float, y0: float, y1: float) -> list[FloatArray]:
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]
    return [np.array([*a, *b]) for a, b in pairwise(corners)]


def driven(
    changes: WorldChanges, walls: list[FloatArray], from_m: float = 5.0, to_m: float = 70.0, *, known: bool = True
) -> list[Change]:
    for at in np.arange(from_m, to_m, 0.5).tolist():
        pose = np.array([at, 0.0, 0.0])
        hits = seen_from(pose, walls)
        changes.update(round(1e9 * at), at, (pose, 0.0), hits, known=known, holds=True)
    return changes.changes()


def test_where_nothing_has_changed_nothing_is_said() -> None:
    assert driven(world(), SIDES) == []


def test_a_parked_machine_has_side_place_and_length() -> None:
    (one,) = driven(world(), [*SIDES, *box(30.0, 38.0, 0.9, 2.1)])
    assert (one.kind, one.node, one.side) == (CAME, "s", "left")
    assert one.start_m == pytest.approx(30.0, abs=1.0)
    assert one.end_m == pytest.approx(38.0, abs=1.0)
    assert one.depth_m == pytest.approx(1.2, abs=0.3)
    assert one.at_m[:2] == pytest.approx((34.0, 1.0), abs=1.5)
    assert 17.0 < one.since_ns * 1e-9 < 30.0  # it comes into reach at 12 m
    assert one.views > 5


@pytest.mark.parametrize("nearer_m", [0.3, 0.6])
def test_both_walls_nearer_over_20_m(nearer_m: float) -> None:
    y = HALF_M - nearer_m
    lining = [np.array([25.0, side * y, 45.0, side * y]) for side in (1.0, -1.0)]
    ends = [np.array([x, side * HALF_M, x, side * y]) for x in (25.0, 45.0) for side in (1.0, -1.0)]
    found = driven(world(), [*SIDES, *lining, *ends])
    assert {one.side for one in found} == {"left", "right"}
    for one in found:
        assert one.kind == CAME
        assert one.start_m == pytest.approx(25.0, abs=1.0)
        assert one.end_m == pytest.approx(45.0, abs=1.0)
        assert one.depth_m == pytest.approx(nearer_m, abs=0.1)


def test_a_wall_that_is_gone() -> None:
    upper = [np.array([-10.0, HALF_M, 30.0, HALF_M]), np.array([40.0, HALF_M, 95.0, HALF_M])]
    niche = [np.array([30.0, HALF_M, 30.0, 3.4]), np.array([30.0, 3.4, 40.0, 3.4]), np.array([40.0, 3.4, 40.0, HALF_M])]
    (one,) = driven(world(), [*upper, *niche, SIDES[1]])
    assert (one.kind, one.side) == (WENT, "left")
    assert one.length_m == pytest.approx(10.0, abs=2.5)


def test_one_who_walks_by_is_no_change() -> None:
    changes = world()
    for at in np.arange(5.0, 70.0, 0.5).tolist():
        pose, there = np.array([at, 0.0, 0.0]), 60.0 - 0.6 * at
        hits = seen_from(pose, [*SIDES, *box(there, there + 0.4, 1.4, 1.9)])
        changes.update(round(1e9 * at), at, (pose, 0.0), hits, known=True, holds=True)
    assert changes.changes() == []


def test_what_is_seen_while_lost_counts_where_the_place_was_right() -> None:
    walls = [*SIDES, *box(30.0, 38.0, 0.9, 2.1)]
    for off_m, count in ((0.2, 1), (9.0, 0)):
        changes = world()
        assert driven(changes, walls, 20.0, 45.0, known=False) == []
        carried = np.array([45.0, 0.0, 0.0])
        changes.found(45.0, carried, carried + np.array([off_m, 0.0, 0.0]))
        assert len(driven(changes, SIDES, 52.0, 53.0)) == count


def test_hits_of_what_came_are_told_apart_from_walls() -> None:
    changes, walls = world(), [*SIDES, *box(30.0, 38.0, 0.9, 2.1)]
    driven(changes, walls, 20.0, 30.0)
    pose = np.array([31.0, 0.1, 0.02])
    hits = seen_from(pose, walls)
    in_map = se2.transform(pose, hits)
    new = changes.stands_in(pose, 0.0, hits)
    on_box = (in_map[:, 1] < 1.5) & (in_map[:, 1] > 0.5)
    assert new[on_box].mean() > 0.8
    assert new[~on_box].mean() < 0.1
    assert not changes.stands_in(pose, 30.0, hits).any()  # of another level


def test_where_the_scan_does_not_hold_nothing_is_learnt() -> None:
    """At a wrong place all contradicts: that is a sign of the place, not of a change."""
    changes, walls = world(), [*SIDES, *box(30.0, 38.0, 0.9, 2.1)]
    for at in np.arange(20.0, 30.0, 0.5).tolist():
        pose = np.array([at, 0.0, 0.0])
        changes.update(round(1e9 * at), at, (pose, 0.0), seen_from(pose, walls), known=True, holds=False)
    assert not changes.stands_in(pose, 0.0, seen_from(pose, walls)).any()


def test_what_came_is_forgotten_after_some_way() -> None:
    """A person here and one there would else come to cover the floor; the report keeps what was seen."""
    changes, walls = world(), [*SIDES, *box(30.0, 38.0, 0.9, 2.1)]
    driven(changes, walls, 20.0, 30.0)
    pose = np.array([31.0, 0.0, 0.0])
    hits = seen_from(pose, walls)
    far = seen_from(np.array([70.0, 0.0, 0.0]), SIDES)
    for travelled in (150.0, 300.0):
        changes.update(0, travelled, (np.array([70.0, 0.0, 0.0]), 0.0), far, known=True, holds=True)
    assert not changes.stands_in(pose, 0.0, hits).any()
    assert len(changes.changes()) == 1


def test_only_hits_in_room_that_the_map_never_saw_say_nothing() -> None:
    """Through an opening of the map's end is unknown room; behind a wall, or in free room, hits do say something."""
    changes, pose = world(), np.array([70.0, 0.0, 0.0])
    on_walls = np.array([[x, side * HALF_M] for x in (-5.0, 0.0, 5.0) for side in (1.0, -1.0)])
    behind = np.array([[x, side * (HALF_M + 1.5)] for x in (-5.0, 0.0, 5.0) for side in (1.0, -1.0)])
    in_the_way = np.array([[x, 0.5] for x in (-6.0, -3.0, 4.0)])
    beyond = np.array([[13.0 + x, y] for x in (1.0, 2.0, 3.0) for y in (-1.0, 1.0)])
    for told in (on_walls, behind, in_the_way):
        assert changes.unknown_share(pose, 0.0, told) == 0.0
    assert changes.unknown_share(pose, 0.0, beyond) == 1.0
    assert changes.unknown_share(pose, 0.0, np.concatenate([on_walls, beyond])) == 0.5
    assert changes.unknown_share(pose, 0.0, np.zeros((0, 2))) == 0.0
