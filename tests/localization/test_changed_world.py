"""A drive through a drift that is not as in its map any more: told with place and length, and the pose stays."""

from __future__ import annotations

import math

import numpy as np
from lhdmap.config import Settings
from lhdmap.geometry import se2
from lhdmap.localization.changes import CAME
from lhdmap.localization.rows import LOST, TRACKING
from lhdmap.messages import FloatArray
from lhdmap.pipeline.localize import Localizer

from tests.localization import known
from tests.settings.streams import Stream


def ran(stream: Stream, poses: FloatArray) -> tuple[Localizer, FloatArray]:
    """Return a localizer that has taken a drive, and its errors (M, 3) in the machine's axes where it tracked."""
    with Localizer(known.known_map(), Settings(), None, np.array([*poses[0], 0.0])) as localizer:
        for role, message in stream:
            localizer.update(role, message)
        localizer.finish()
    errors = [
        se2.between(pose, np.array([row.x_m, row.y_m, row.yaw_rad]))
        for pose, row in zip(poses, localizer.rows, strict=True)
        if row.status == TRACKING
    ]
    return localizer, np.array(errors)


def test_a_parked_machine_is_told_and_carries_nothing_away() -> None:
    localizer, errors = ran(*known.drive(5.0, 32.0, parked=(14.0, 20.0)))
    assert {row.status for row in localizer.rows} == {TRACKING}
    (one,) = localizer.world.changes()
    assert (one.kind, one.node, one.side) == (CAME, "t", "left")
    assert abs(one.start_m - 14.0) < 1.0
    assert abs(one.end_m - 20.0) < 1.0
    assert (np.abs(errors).max(axis=0) < [0.06, 0.03, math.radians(0.4)]).all()


def test_both_walls_nearer_over_20_m() -> None:
    localizer, errors = ran(*known.drive(5.0, 38.0, nearer=(14.0, 34.0, 0.3)))
    assert all(row.status in (TRACKING, LOST) for row in localizer.rows)
    assert (np.abs(errors).max(axis=0) < [0.5, 0.15, math.radians(1.0)]).all()  # what is said is right
    assert localizer.rows[-1].status == TRACKING
    told = localizer.world.changes()
    assert {one.side for one in told} == {"left", "right"}
    for side in ("left", "right"):
        length = sum(one.length_m for one in told if one.side == side and one.kind == CAME)
        assert 12.0 < length < 23.0


def test_where_nothing_changed_nothing_is_told() -> None:
    localizer, _ = ran(*known.drive(5.0, 32.0))
    assert localizer.world.changes() == []
