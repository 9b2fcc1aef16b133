"""Which key scans are kept of a long drive, and which are near."""

from __future__ import annotations

import math

import numpy as np
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.scan_matching.places import Nearby, Places
from lhdmap.smoothing.keys import KeyScans
from lhdmap.smoothing.settings import SmoothingSettings

SETTINGS = SmoothingSettings()
RADIUS_M = 20.0
LAP_M = 2.0 * math.pi * RADIUS_M


def circle(way_m: float) -> FloatArray:
    turn = way_m / RADIUS_M
    return np.array([RADIUS_M * math.sin(turn), RADIUS_M * (1.0 - math.cos(turn)), turn])


def round_and_round(laps: float, height_m: float = 0.0, drift_m: float = 0.0) -> list[KeyScan]:
    """Return the keys of a machine on a circle, a scan each 0.2 m; its odometry drifts sideways by so much each lap."""
    keys = KeyScans(SETTINGS)
    for k in range(round(laps * LAP_M / 0.2)):
        pose = circle(0.2 * k) + np.array([drift_m * 0.2 * k / LAP_M, 0.0, 0.0])
        keys.update(k, pose, np.full((5, 3), height_m * 0.2 * k / LAP_M))
    return keys.keys


def test_the_first_visits_are_kept_whole() -> None:
    steps = np.diff([key.travelled_m for key in round_and_round(3.0)])
    assert steps.max() < SETTINGS.key_m + 0.21


def test_keys_of_the_same_drifts_are_bounded_by_them() -> None:
    ten, fifty = round_and_round(10.0), round_and_round(50.0)
    assert len(ten) < 6.5 * LAP_M
    assert len(fifty) - len(ten) < 0.12 * 40.0 * LAP_M
    assert np.diff([key.travelled_m for key in fifty]).max() < 45.0, "the path is tied to the map all the time"


def test_keys_that_come_later_come_in_runs() -> None:
    """A closure counts when its neighbours, within 5 m, say the same."""
    travelled = np.array([key.travelled_m for key in round_and_round(50.0)])
    late = travelled[travelled > 20.0 * LAP_M]
    gaps = np.diff(late)
    alone = (gaps[1:] > 5.0) & (gaps[:-1] > 5.0)
    assert not alone.any()


def test_a_level_below_and_the_way_back_are_other_places() -> None:
    assert np.diff([key.travelled_m for key in round_and_round(10.0, height_m=-3.0)]).max() < SETTINGS.key_m + 0.21
    places = Places(SETTINGS.key_m)
    way, back = np.array([5.0, 5.0, 0.0]), np.array([5.0, 5.0, math.pi])
    assert [places.wants(way, 0.0, 39.0) for _ in range(10)] == [True] * 8 + [False] * 2
    assert places.wants(back, 0.0, 39.0)


def test_where_the_odometry_drifts_keys_go_on() -> None:
    """What it takes for another place is one: it must find to the map before it is farther off than closures reach."""
    keys = round_and_round(40.0, drift_m=0.5)
    assert len(keys) > 1.3 * len(round_and_round(40.0))


def test_near_rows_are_those_of_a_search_through_all() -> None:
    rng = np.random.default_rng(4)
    positions = rng.uniform(-30.0, 30.0, (400, 2))
    nearby = Nearby(positions, 6.0)
    for row in range(50, 400, 7):
        nearby.add_until(row - 20)
        found = nearby.around(row)
        distances = np.hypot(*(positions[: row - 20] - positions[row]).T)
        assert set(np.flatnonzero(distances <= 6.0)) <= set(found.tolist())
        assert (np.diff(found) > 0).all()
        assert found.max(initial=-1) < row - 20
