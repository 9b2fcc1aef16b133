"""The station at a grizzly that is worked on: what it decides from clouds, against a world whose truth is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.errors import UsageError
from lhdmap.rockbreaker.collision import joint_positions
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.rockbreaker.orientation import nearest_vertical
from lhdmap.rockbreaker.station import Pose, Station
from lhdmap.simulation.grizzly_world import GrizzlyWorld

MACHINE = Rockbreaker()


def _parked(station: Station) -> Pose:
    return Pose(station.park_m, nearest_vertical(MACHINE, station.park_m))


def test_the_tip_goes_to_a_rock_and_comes_up_again() -> None:
    world, station = GrizzlyWorld(MACHINE, 4, 2), Station(MACHINE)
    decision = station.decide(world.look(), _parked(station))
    assert len(decision.order) == 2
    assert decision.rock is decision.order[0]
    assert decision.rock is not None
    place_m = decision.rock.top_m
    struck = min(world.rocks, key=lambda one: float(np.hypot(*(one.top_m - place_m)[:2])))
    tip_m = decision.moves[-1].request.end_m
    assert np.hypot(*(tip_m - struck.top_m)[:2]) < 0.15
    assert tip_m[2] == pytest.approx(struck.top_m[2], abs=0.08)
    highest_m = max(float(one.top_m[2]) for one in world.rocks)
    assert station.work_plane_m == pytest.approx(highest_m + station.settings.clearance_m, abs=0.05)
    lift = decision.lift
    assert lift is not None
    assert lift.request.end_m[2] == station.work_plane_m
    ends = [station.park_m, *(plan.request.end_m for plan in (*decision.moves, lift))]
    for plan, begin in zip((*decision.moves, lift), ends, strict=False):
        assert plan.trajectory is not None
        assert np.linalg.norm(plan.request.start_m - begin) < 1e-9  # each step begins where the one before has ended
    times = [
        station.between_s(a, b) for a, b in zip(_way(station, decision), _way(station, decision)[1:], strict=False)
    ]
    assert decision.order_s == pytest.approx(sum(times))


def _way(station: Station, decision: object) -> list[np.ndarray]:
    return [station.park_m, *(one.top_m for one in decision.order), station.park_m]  # type: ignore[attr-defined]


def test_a_rock_that_does_not_break_is_given_up() -> None:
    world, station = GrizzlyWorld(MACHINE, 4, 1), Station(MACHINE, most_blows=2)
    decisions = [station.decide(world.look(), _parked(station)) for _ in range(3)]
    assert decisions[0].rock is decisions[1].rock  # seen anew with other noise, and known again
    assert decisions[2].rock is None
    assert "do not break" in decisions[2].stuck


def test_an_empty_grizzly_asks_for_nothing() -> None:
    station = Station(MACHINE)
    decision = station.decide(GrizzlyWorld(MACHINE, 5, 0).look(), _parked(station))
    assert (decision.moves, decision.rock, decision.stuck) == ((), None, "")


def test_the_arm_in_the_cloud_is_no_rock() -> None:
    world, station = GrizzlyWorld(MACHINE, 4, 0), Station(MACHINE)
    tip_m = np.array([4.5, 0.0, -1.0])
    at = Pose(tip_m, nearest_vertical(MACHINE, tip_m))
    seen = world.look(joint_positions(MACHINE, at.theta(MACHINE)[None])[0])
    assert np.count_nonzero(np.linalg.norm(seen - tip_m, axis=1) < 0.3) > 20  # it is in the cloud
    assert station.decide(seen, at).rock is None
    assert station.known == []


def test_blows_break_roll_and_leave_pieces() -> None:
    """Whatever is hit: no rock is lost or made, pieces are smaller, all lie on the bars and clear of each other."""
    found: dict[str, int] = {}
    for seed in range(30):
        world = GrizzlyWorld(MACHINE, seed, 4)
        target = world.rocks[0]
        tip_m = target.top_m + np.array([0.3 * float(target.extents_m[0]), 0.0, 0.0])
        blow = world.strike(tip_m)
        found[blow.outcome] = found.get(blow.outcome, 0) + 1
        assert len(world.rocks) == 3 + blow.left
        if blow.outcome == "broke":
            assert target not in world.rocks
            assert all(one.extents_m.max() < target.extents_m.max() for one in world.rocks[3:])
        if blow.outcome == "rolled":
            assert 0.1 < np.hypot(*(world.rocks[-1].top_m - target.top_m)[:2]) < 0.5
        for one in world.rocks:
            assert one.mesh.vertices_m[:, 2].min() == pytest.approx(world.bars_m)
            assert math.isclose(float(one.mesh.vertices_m[:, 2].max()), float(one.top_m[2]))
        gaps = [
            np.hypot(*(a.top_m - b.top_m)[:2]) - a.reach_m - b.reach_m
            for a in world.rocks
            for b in world.rocks
            if a is not b
        ]
        assert min(gaps, default=1.0) > 0.0
    assert {"broke", "rolled", "cracked"} <= set(found)


def test_a_blow_beside_all_rocks_misses() -> None:
    world = GrizzlyWorld(MACHINE, 1, 1)
    assert world.strike(world.rocks[0].top_m + np.array([0.0, 0.0, 1.0])).outcome == "missed"
    assert len(world.rocks) == 1


def test_a_grizzly_that_is_full_is_refused() -> None:
    with pytest.raises(UsageError, match="no room"):
        GrizzlyWorld(MACHINE, 1, 60)
