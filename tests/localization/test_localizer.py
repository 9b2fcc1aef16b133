"""`Localizer`, messages in and rows out, in a drift whose walls, and so whose map, are known."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from lhdmap.config import Settings
from lhdmap.geometry import se2
from lhdmap.localization.rows import CANDIDATE, LOST, TRACKING, UNKNOWN, LocalizationRow
from lhdmap.messages import FloatArray
from lhdmap.pipeline.localize import Localizer
from lhdmap.pipeline.localizer_says import Where

from tests.localization import known
from tests.settings.streams import RATE_HZ


class Ran(NamedTuple):
    """A localizer that has taken a whole drive, its rows, the true poses, and what it said while it ran."""

    localizer: Localizer
    rows: list[LocalizationRow]
    poses: FloatArray
    now: list[tuple[int, Where]]

    def errors(self, status: str = TRACKING) -> FloatArray:
        """Return errors (N, 3) in the machine's axes of the rows with a status."""
        pairs = [(pose, row) for pose, row in zip(self.poses, self.rows, strict=True) if row.status == status]
        return np.array([se2.between(pose, np.array([row.x_m, row.y_m, row.yaw_rad])) for pose, row in pairs])


def ran(way_m: float, start: FloatArray | None = None, jump_m: float = 0.0, *, given: bool = True) -> Ran:
    stream, poses = known.drive(5.0, way_m, jump_m=jump_m)
    begin = np.array([*poses[0], 0.0]) if start is None else start
    now = []
    with Localizer(known.known_map(), Settings(), None, begin if given else None) as localizer:
        for role, message in stream:
            localizer.update(role, message)
            if role == "front":
                now.append((message.stamp_ns, localizer.pose_at(message.stamp_ns)))
        localizer.finish()
    return Ran(localizer, localizer.rows, poses, now)


@pytest.fixture(scope="module")
def put_down() -> Ran:
    return ran(30.0, given=False)


@pytest.fixture(scope="module")
def carried_off() -> Ran:
    return ran(30.0, jump_m=12.0)


def test_from_a_start_that_is_about_right_it_tracks() -> None:
    _, poses = known.drive(5.0, 14.0)
    drive = ran(14.0, np.array([*se2.compose(poses[0], np.array([0.2, -0.1, math.radians(1.0)])), 0.0]))
    assert {row.status for row in drive.rows} == {TRACKING}
    settled = np.abs(drive.errors()[50:])
    assert settled[:, 0].max() < 0.03
    assert settled[:, 1].max() < 0.015
    assert settled[:, 2].max() < math.radians(0.3)


def test_a_row_for_each_front_scan() -> None:
    drive = ran(14.0)
    stream, _ = known.drive(5.0, 14.0)
    assert [row.stamp_ns for row in drive.rows] == [message.stamp_ns for role, message in stream if role == "front"]
    assert all(row.latency_ms > 0.0 for row in drive.rows)
    assert {row.node for row in drive.rows} == {"t"}
    assert {row.next_point for row in drive.rows if row.rho_m < 9.9} == {"w10"}
    assert {row.next_point for row in drive.rows if row.rho_m > 10.5} == {"w40"}
    rho = np.array([row.rho_m for row in drive.rows])
    assert rho == pytest.approx(drive.poses[:, 0], abs=0.05)  # the first 22 m lie along x
    assert {row.source for row in drive.rows[30:]} <= {"walls", "odometry", ""}


def test_a_start_is_found_and_nothing_wrong_said_before(put_down: Ran) -> None:
    statuses = [row.status for row in put_down.rows]
    assert statuses[0] == UNKNOWN
    assert statuses[-1] == TRACKING
    assert CANDIDATE in statuses
    assert LOST not in statuses
    assert np.abs(put_down.errors()).max(axis=0) == pytest.approx(np.zeros(3), abs=0.05)


def test_the_first_fix_is_told_by_time_and_way(put_down: Ran) -> None:
    first = next(k for k, row in enumerate(put_down.rows) if row.status == TRACKING)
    fix = put_down.localizer.facts.first_fix
    assert fix is not None
    assert fix[0] == pytest.approx(first / RATE_HZ)
    way = float(np.hypot(*np.diff(put_down.poses[: first + 1, :2], axis=0).T).sum())
    assert fix[1] == pytest.approx(way, abs=0.1)
    assert way > Settings().localization.search_m + Settings().localization.confirm_m


def test_before_a_fix_there_is_no_pose(put_down: Ran) -> None:
    assert all(math.isnan(row.x_m) and row.node == "" for row in put_down.rows if row.status == UNKNOWN)
    early = put_down.now[5][1]
    assert (early.status, early.pose, early.covariance) == (UNKNOWN, None, None)
    candidates = [row for row in put_down.rows if row.status == CANDIDATE]
    assert all(0.0 < row.probability <= 1.0 for row in candidates)


def test_one_that_is_carried_off_is_lost_and_says_so(carried_off: Ran) -> None:
    """Findings, section 6: a wrong tunnel is noticed within 3 m where walls are not smooth."""
    jump = int(np.hypot(*np.diff(carried_off.poses[:, :2], axis=0).T).argmax()) + 1
    lost = next(k for k, row in enumerate(carried_off.rows) if row.status == LOST)
    assert lost > jump
    assert float(np.hypot(*np.diff(carried_off.poses[jump : lost + 1, :2], axis=0).T).sum()) < 4.0
    assert carried_off.localizer.facts.lost_stretches == 1
    assert {row.status for row in carried_off.rows[:jump]} == {TRACKING}
    assert all(row.status != TRACKING or k < lost for k, row in enumerate(carried_off.rows[: lost + 50]))


def test_after_a_loss_what_is_tracked_again_is_right(carried_off: Ran) -> None:
    lost = next(k for k, row in enumerate(carried_off.rows) if row.status == LOST)
    again = [k for k, row in enumerate(carried_off.rows) if row.status == TRACKING and k > lost]
    if again:  # else it was not sure yet, and said so
        row, pose = carried_off.rows[again[-1]], carried_off.poses[again[-1]]
        assert math.hypot(row.x_m - pose[0], row.y_m - pose[1]) < 0.1


def test_no_pose_of_now_where_it_is_lost(carried_off: Ran) -> None:
    said = [where for _, where in carried_off.now if where.status == LOST]
    assert said
    assert all(where.pose is None for where in said)


def test_the_pose_of_now_is_that_of_the_truth() -> None:
    drive = ran(14.0)
    late = [(where, pose) for (_, where), pose in zip(drive.now, drive.poses, strict=True) if where.pose is not None]
    assert len(late) >= len(drive.poses) - 51  # the odometry begins once the first 50 scans have told the speed
    for where, pose in late[10:]:
        assert where.pose is not None
        assert where.covariance is not None
        assert math.hypot(where.pose[0] - pose[0], where.pose[1] - pose[1]) < 0.06
        assert where.pose[3] == pytest.approx(pose[2], abs=0.01)
        assert (np.linalg.eigvalsh(where.covariance) > 0.0).all()


def test_nothing_known_before_the_first_scan() -> None:
    localizer = Localizer(known.known_map(), Settings())
    assert localizer.pose_at(0) == (UNKNOWN, None, None)
    localizer.finish()
    assert localizer.rows == []


def test_the_same_messages_give_the_same_rows() -> None:
    one, other = ran(10.0), ran(10.0)
    assert [row._replace(latency_ms=0.0) for row in one.rows] == [row._replace(latency_ms=0.0) for row in other.rows]


def test_a_place_that_was_given_up_for_nothing_is_taken_up_again() -> None:
    """As after dust, or a room that the map does not have: the odometry has led to where the machine is."""
    stream, poses = known.drive(5.0, 30.0)
    scans = [k for k, (role, _) in enumerate(stream) if role == "front"]
    with Localizer(known.known_map(), Settings(), None, np.array([*poses[0], 0.0])) as localizer:
        for k, (role, message) in enumerate(stream):
            localizer.update(role, message)
            if k == scans[len(scans) // 2]:
                localizer.keeper._drop("for nothing")  # what a crowd before the scanners does
        localizer.finish()
    rows = localizer.rows
    lost = [k for k, row in enumerate(rows) if row.status == LOST]
    assert lost
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])
    assert driven[lost[-1] + 1] - driven[lost[0]] < 5.0
    assert {row.status for row in rows[lost[-1] + 1 :]} == {TRACKING}
    off = np.array(
        [se2.between(pose, np.array([row.x_m, row.y_m, row.yaw_rad])) for pose, row in zip(poses, rows, strict=True)]
    )
    assert np.abs(off[lost[-1] + 1 :, :2]).max() < 0.1
