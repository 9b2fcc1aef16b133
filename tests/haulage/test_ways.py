"""Ways over a site: they begin and end where their edges do, bend no more than these, and without steps of curvature."""

from __future__ import annotations

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.haulage.layout import Layout, checked
from lhdmap.haulage.site import find_site, load_site
from lhdmap.haulage.site_layout import layout_of_site
from lhdmap.haulage.ways import apron_of, pose_at_end, way_of
from lhdmap.tracking.path import beside, path_of

TIGHTEST_M = 10.0  # corners in areas
TRIPS = (("P1", "L1"), ("L1", "D1"), ("D1", "L1"), ("D1", "P1"))


@pytest.fixture(scope="module")
def layout() -> Layout:
    return checked(layout_of_site(load_site(find_site("hejase"))))


def _edges(layout: Layout, start: str, goal: str) -> list[int]:
    route = layout.route(start, goal)
    assert route is not None
    return route


@pytest.mark.parametrize(("start", "goal"), TRIPS)
def test_a_way_is_near_its_edges_and_its_curvature_has_no_steps(layout: Layout, start: str, goal: str) -> None:
    edges = _edges(layout, start, goal)
    drawn, raw = way_of(layout, edges), way_of(layout, edges, 0.0)
    lane = path_of(raw.points_m, 0.0, 5.0).points
    near, off = 5.0, []
    for x, y in drawn.points_m:
        near, aside, _, _ = beside(lane, x, y, near, 3.0, 3.0)
        off.append(aside)
    assert np.abs(off).max() < 0.1  # of 2.1 m of half a lane
    bend = path_of(drawn.points_m, 0.0, 5.0).points[:, 3]
    assert np.abs(bend).max() < 1.1 / TIGHTEST_M
    assert np.abs(np.diff(bend)).max() / 0.1 < 0.6 / TIGHTEST_M  # with a step it would be 1 / R in the first row


@pytest.mark.parametrize(("start", "goal"), TRIPS)
def test_a_way_ends_where_it_stops(layout: Layout, start: str, goal: str) -> None:
    edges = _edges(layout, start, goal)
    raw, drawn = way_of(layout, edges, 0.0), way_of(layout, edges)
    assert np.hypot(*(drawn.points_m[-1] - raw.points_m[-1])) < 0.05
    assert np.hypot(*(drawn.points_m[0] - raw.points_m[0])) < 0.15  # whole steps from the end
    assert set(drawn.edges.astype(int)) == set(edges)
    kmh = 3.6 * drawn.speeds_mps
    assert kmh.max() <= 30.0 + 1e-9
    assert (drawn.dock >= 0) == (goal == "D1")


def test_a_dock_in_reverse_is_left_out_of_the_way_and_looked_at_backwards(layout: Layout) -> None:
    """Backup at (66, 2.1), dump at (46, 26) heading -90 deg, in the frame of the mouth A3: at (350 - ..., ...) of the road."""
    edges = _edges(layout, "L1", "D1")
    way, edge = way_of(layout, edges, 0.0), layout.edges[edges[-1]]
    assert edge.line_m is not None
    assert way.dock == edges[-1]
    pose = pose_at_end(layout, edges[-1])
    assert pose[:2] == pytest.approx(edge.line_m[-1, :2])
    backup_to_dock = np.hypot(*(way.points_m[-1] - pose[:2]))
    assert backup_to_dock == pytest.approx(np.hypot(66.0 - 46.0, 26.0 - 2.1), abs=0.5)
    travel = edge.line_m[-1, :2] - edge.line_m[-2, :2]
    assert float(travel @ (np.cos(pose[2]), np.sin(pose[2]))) < 0.0


def test_an_apron_holds_all_that_is_done_on_it(layout: Layout) -> None:
    corners = apron_of(layout, "A1", 12.0)
    sides = np.roll(corners, -1, axis=0) - corners
    for name in ("L1", "P1", "A1 queue"):
        gap = pose_at_end(layout, layout.entering[name][0])[:2] - corners
        cross = sides[:, 0] * gap[:, 1] - sides[:, 1] * gap[:, 0]
        assert (np.abs(cross) / np.hypot(*sides.T)).min() >= 12.0 - 1e-6
        assert (cross > 0.0).all() or (cross < 0.0).all()


def test_edges_that_do_not_follow_each_other_are_refused(layout: Layout) -> None:
    edges = _edges(layout, "L1", "D1")
    with pytest.raises(InputError, match="does not follow"):
        way_of(layout, [edges[0], edges[2]])
    with pytest.raises(InputError, match="at least one edge"):
        way_of(layout, [])
