"""Each place that was looked at has its row, with what speaks for or against it."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.smoothing.closures import ALIKE, ALONE, SMOOTH, UNLIKE, Closure, Refusal
from lhdmap.smoothing.evidence import CONTRADICTED, DOUBTFUL, Evidence, evidence_of, open_loops
from lhdmap.smoothing.robust import Judgement
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.smoother import Smoother

from tests.smoothing.decline import Drive, decline, driven
from tests.smoothing.places import drifted, keys_of, lap, square, straight

KEYS = [KeyScan(10 * k, np.array([float(k), 0.0, 0.0]), float(k), np.zeros((1, 3), np.float32)) for k in range(60)]


def test_each_closure_and_each_refusal_has_its_row_in_the_order_of_time() -> None:
    found = [Closure(k, k + 30, np.array([30.0, 0.0, 0.1]), np.diag([4e-4, 1e-4, 1e-6]), 0.8) for k in (5, 6, 7)]
    judgement = Judgement(
        np.array([True, False, False]), np.array([False, False, True]), np.array([1.0, 50.0, 9.0]), 0.0
    )
    refused = [Refusal(1, 31, UNLIKE, 0.3), Refusal(2, 59, SMOOTH, 0.9, 0.4), Refusal(3, 33, ALONE, 0.7, 0.01)]
    rows = evidence_of(KEYS, found, judgement, refused)
    assert [(row.current_ns, row.accepted, row.reason) for row in rows] == [
        (310, False, UNLIKE),
        (330, False, ALONE),
        (350, True, ""),
        (360, False, CONTRADICTED),
        (370, False, DOUBTFUL),
        (590, False, SMOOTH),
    ]
    assert [row.chi2 for row in rows[2:5]] == [1.0, 50.0, 9.0]
    assert rows[2].sigma_m == pytest.approx(0.02)
    assert rows[2].to_json()["offset"] == [30.0, 0.0, 0.1]
    assert np.isnan(rows[0].offset).all()


def test_a_smoother_lists_what_it_looked_at() -> None:
    true = lap(80)
    smoother = Smoother(SmoothingSettings())
    smoother.keys.keys = keys_of(square(), true, drifted(true, 1.005, 0.025))
    correction = smoother.correction()
    assert correction is not None
    rows = smoother.evidence
    assert sum(row.accepted for row in rows) == correction.closures
    assert all(bool(row.reason) != row.accepted for row in rows)
    assert len({row.current_ns for row in rows}) == len(rows)
    json.dumps([row.to_json() for row in rows])


def test_a_smooth_drift_says_that_its_walls_do_not_tell() -> None:
    world, true = straight(40, 0.0005)
    way = np.concatenate([true[15:35], true[34:14:-1]])
    smoother = Smoother(SmoothingSettings())
    smoother.keys.keys = keys_of(world, way, way, reach_m=8.0)
    assert smoother.correction() is None
    assert {row.reason for row in smoother.evidence} == {SMOOTH}
    (said,) = open_loops(smoother.evidence)
    assert said.startswith(f"loop closure: {len(smoother.evidence)} places look like earlier ones")


def test_nothing_is_said_where_loops_were_closed() -> None:
    row = Evidence(0, 1, True, "", 0.9, 0.01, np.zeros(3), 1.0)
    refused = row._replace(accepted=False, reason=SMOOTH)
    assert open_loops([row] * 20 + [refused] * 15) == []
    assert open_loops([refused] * 3) == []
    assert len(open_loops([row] * 5 + [refused] * 15)) == 1


def wrong_and_right(drive: Drive) -> tuple[int, int, set[str]]:
    """Return how many accepted closures are of another place, how many are not, and why others were refused."""
    smoother = Smoother(SmoothingSettings())
    smoother.keys.keys = drive.keys
    smoother.correction()
    wrong = right = 0
    for row in smoother.evidence:
        if row.accepted:
            a, b = row.earlier_ns // 10**9, row.current_ns // 10**9
            off = se2.between(se2.between(drive.true[a], drive.true[b]), row.offset)
            far = math.hypot(off[0], off[1]) > 0.5 or abs(math.degrees(off[2])) > 3.0
            wrong, right = wrong + far, right + (not far)
    return wrong, right, {row.reason for row in smoother.evidence}


@pytest.mark.parametrize(("rough_m", "least"), [(0.0, 0.0), (0.15, 0.8)])
def test_equal_legs_are_not_taken_for_each_other(rough_m: float, least: float) -> None:
    drive = driven(decline(3, rough_m, 12.0, legs=3), 3, "turned", heights=False)
    wrong, right, _ = wrong_and_right(drive)
    assert wrong == 0
    assert right >= least * (len(drive.keys) - drive.turn - 8)


def test_where_the_odometry_may_be_a_leg_off_equal_legs_are_left_open() -> None:
    """8 % of scale, and the keys say so: the leg above is as likely, and its walls are the same."""
    drive = driven(decline(2, 0.0, 12.0, legs=3), 2, "reverse", scale=0.08, heights=False)
    drive = drive._replace(keys=drive.keys[: drive.turn + 50])
    wrong, _, reasons = wrong_and_right(drive)
    assert wrong == 0
    assert ALIKE in reasons
