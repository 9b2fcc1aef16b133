"""What the film sees of a drive on a map, against a truth that is known: frames, place, legs, predicted ways; and stops."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.guidance.directive import Directive, path_of
from lhdmap.guidance.planner import Plan
from lhdmap.guidance.prediction import Slopes
from lhdmap.guidance.profile import Speeds
from lhdmap.guidance.solver import Solution
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.navigation.along import Located
from lhdmap.replay.journal import Event
from lhdmap.replay.process import DIRECTIVE, LOCATED, PLAN, POSE
from lhdmap.replay.processes.film_drive import DriveFilm, Truth, outlines
from lhdmap.replay.processes.told import Asked, Idle
from lhdmap.replay.series import Timeline
from lhdmap.replay.stops import Stops
from lhdmap.simulation.history import START_NS

from tests.topology.maps import ladder

STEP_NS = 10_000_000
T_TRUE_MAP = np.array([100.0, -40.0, 0.7])
T_TRUE_ODOM = np.array([3.0, 5.0, -0.4])


class At(NamedTuple):
    """A true state."""

    time_ns: int
    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    articulation_rad: float = 0.0
    speed_mps: float = 0.0

    def row(self) -> FloatArray:
        """Return nothing: no sensor looks."""
        return np.zeros(20)


class Pose(NamedTuple):
    """A pose of perception."""

    stamp_ns: int
    T_odom_base: FloatArray


def _true(seconds: float) -> FloatArray:
    """Along the tunnel from the map's origin at 2 m/s, as it truly is."""
    return se2.compose(T_TRUE_MAP, np.array([2.0 * seconds, 0.0, 0.0]))


def _matrix(pose: FloatArray) -> FloatArray:
    T = np.eye(4)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    T[:2, :2], T[:2, 3] = [[c, -s], [s, c]], pose[:2]
    return T


def _plan(now_ns: int, odom: FloatArray) -> Plan:
    states = np.zeros((3, 5))
    states[:, :3] = [se2.compose(odom, np.array([float(k), 0.0, 0.0])) for k in range(3)]
    solution = Solution(np.zeros(2), states, np.array([0.9, 0.5, 0.7]), np.zeros(3, dtype=np.int64), 0.0, 1)
    return Plan(
        now_ns,
        1,
        (),
        now_ns,
        solution,
        Speeds(np.full(3, 2.0), np.zeros(2), 0.15, 15.0, "sight", np.zeros(3), np.ones(3)),
        Slopes(np.zeros(2), np.zeros(2)),
        10.0,
    )


def _driven(error_m: float = 0.0, seconds: float = 4.0) -> tuple[DriveFilm, list[FloatArray]]:
    """Return the film of a drive, and the ways that it drew; the place is off across by `error_m` on the second half."""
    film, ways = DriveFilm(ladder()), []
    path_map = path_of(np.array([[-5.0, 0.0], [60.0, 0.0]]), 3.0)
    for k in range(round(seconds * 100) + 1):
        now_ns, t = START_NS + k * STEP_NS, k / 100.0
        true = _true(t)
        film.truth.add(At(now_ns, true[0], true[1], 1.5, true[2]))
        odom = se2.compose(se2.inverse(T_TRUE_ODOM), true)
        film.take(POSE, Pose(now_ns, _matrix(odom)))
        if k % 10 == 0:
            off = error_m if t > 0.5 * seconds else 0.0
            place = np.array([2.0 * t, off, 0.0])
            film.take(LOCATED, Located(now_ns, "tracking", place, odom, np.eye(3) * 1e-4, 0.0))
            pose_odom_map = se2.compose(odom, se2.inverse(place))
            moved = path_map.copy()
            moved[:, :2] = se2.transform(pose_odom_map, path_map[:, :2])
            film.take(DIRECTIVE, Asked(now_ns, Directive(now_ns, 1, moved, 40.0), "driving"))
            film.take(PLAN, _plan(now_ns, odom))
            way = film.look(now_ns, 0.0)
            ways += [] if way is None else [way]
    return film, ways


def _data(film: DriveFilm) -> tuple[FloatArray, list[FloatArray], FloatArray]:
    data = film.data(np.empty((0, 10)), Machine())
    return data.places, [leg.line_m for leg in data.legs], data.plans


def test_predicted_ways_begin_where_the_machine_truly_is() -> None:
    _, ways = _driven()
    assert len(ways) == 21  # one each 0.2 s
    assert ways[-1][0, :2] == pytest.approx(_true(4.0)[:2], abs=1e-6)
    assert ways[-1][-1, :2] == pytest.approx(_true(5.0)[:2], abs=1e-6)
    assert ways[-1][:, 2] == pytest.approx(np.full(3, 1.9))


def test_the_map_is_laid_where_it_belongs() -> None:
    film, _ = _driven()
    places, (leg,), plans = _data(film)
    assert film.map is not None
    line, plain = film.map.tunnels[0].line_m, ladder().tunnels[0].line_m
    assert line[:, :2] == pytest.approx(se2.transform(T_TRUE_MAP, plain[:, :2]), abs=1e-6)
    assert line[:, 2] == pytest.approx(plain[:, 2] + 1.5)
    assert np.abs(places[:, 1:4]).max() < 1e-6
    assert leg[0, :2] == pytest.approx(_true(0.0)[:2], abs=0.3)
    assert leg[-1, :2] == pytest.approx(_true(17.5)[:2], abs=0.3)  # 40 m along a path that begins at -5 m
    assert plans[-1, 1:4] == pytest.approx([2.0, 0.5, 15.0])


def test_the_place_is_told_by_how_much_it_is_off() -> None:
    film, _ = _driven(error_m=0.2, seconds=30.0)
    places, _, _ = _data(film)
    assert np.diff(places[:, 2]).max() == pytest.approx(0.2, abs=0.01)
    assert np.abs(places[:, 1]).max() < 0.05


def test_nothing_is_drawn_of_a_machine_that_waits() -> None:
    film = DriveFilm(ladder())
    film.truth.add(At(START_NS, 0.0, 0.0, 0.0, 0.0))
    film.take(PLAN, Idle(START_NS))
    way = film.look(START_NS, 0.0)
    assert way is not None
    assert len(way) == 0
    data = film.data(np.empty((0, 10)), Machine())
    assert (data.topology, list(data.legs), len(data.plans), len(data.places)) == (None, [], 0, 0)


def test_the_truth_is_interpolated_and_bounded() -> None:
    truth = Truth()
    for k in range(2000):
        truth.add(At(k * STEP_NS, 0.01 * k, 0.0, 0.0, math.remainder(3.0 + 0.001 * k, 2.0 * math.pi)))
    middle = truth.at(1999 * STEP_NS - STEP_NS // 2)
    assert middle is not None
    assert middle[0] == pytest.approx(19.985)
    assert truth.at(0) is None
    assert truth.at(2000 * STEP_NS) is None


def test_both_bodies_are_drawn_on_the_way_and_at_its_end() -> None:
    rows = np.zeros((101, 10))
    rows[:, 1] = np.linspace(0.0, 25.0, 101)
    lines = outlines(rows, Machine(), 10.0)
    assert len(lines) == 2 * 4  # 0, 10, 20 and 25 m
    assert lines[-2][:, 0].max() > 25.0
    assert lines[-1][:, 0].max() < 25.0


def _event(t_s: float, event: str, cause: str, **values: object) -> Event:
    return Event(START_NS + round(t_s * 1e9), "executor", event, cause=cause, values=values)


def test_stops_are_told_with_their_causes() -> None:
    stops, timeline = Stops(), Timeline()
    for one in (
        _event(1.0, "executor: state", "queue", before="standing", after="driving", speed_mps=0.0),
        _event(
            5.0, "guard: guard", "points on the braking path", before="free", after="blocked", free_m=1.0, stop_m=1.2
        ),
        _event(5.0, "executor: state", "guard: contact", before="driving", after="braking", speed_mps=2.0),
        _event(6.0, "watchdog: armed", "pose 1.0 s old", before="armed", after="disarmed"),
        _event(6.0, "watchdog: armed", "refused: pose", before="disarmed", after="disarmed"),
        _event(7.0, "executor: state", "pose 1.0 s old", before="braking", after="standing", speed_mps=0.0),
        _event(9.0, "executor: state", "queue", before="standing", after="driving", speed_mps=0.0),
        _event(12.0, "executor: state", "navigation", before="driving", after="stopping", speed_mps=0.5),
    ):
        stops(one)
        timeline(one)
    first, last = stops.rows()
    assert (first.from_s, first.to_s) == (5.0, 9.0)
    assert first.speed_kmh == pytest.approx(7.2)
    assert first.cause == "guard: contact; pose 1.0 s old"
    assert first.said == "guard: points on the braking path in 1.00 m, stops in 1.20 m; watchdog: pose 1.0 s old"
    assert (last.from_s, last.to_s, last.cause) == (12.0, None, "navigation")
    assert [one.state for one in timeline.changes["watchdog"]] == ["disarmed"]
    assert [one.state for one in timeline.changes["guard"]] == ["blocked"]
