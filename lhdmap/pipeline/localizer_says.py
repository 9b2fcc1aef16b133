"""What a `Localizer` says of the machine: where it is now, the newest fix, and the row of a scan."""

from __future__ import annotations

import math
from typing import NamedTuple

from lhdmap.localization.method import Tracks
from lhdmap.localization.place_on_map import PlaceOnMap
from lhdmap.localization.rows import LocalizationRow
from lhdmap.messages import FloatArray


class Where(NamedTuple):
    """Where the machine is now: status, pose (x, y, z, yaw) in `map`, covariance (3, 3) of x, y, yaw; None where not known."""

    status: str
    pose: FloatArray | None
    covariance: FloatArray | None


class Fix(NamedTuple):
    """The place at the newest scan in both frames (3,), covariance (3, 3) of x, y, heading in `map`, the floor's height."""

    stamp_ns: int
    status: str
    pose_map: FloatArray
    pose_odom: FloatArray
    covariance: FloatArray
    height_m: float


def row_of(row: LocalizationRow, place: PlaceOnMap, tracker: Tracks) -> LocalizationRow:
    """Return a row with the place on the map and in its frame, and how sure both are."""
    along, across, heading = tracker.deviations.tolist()
    return row._replace(
        node=place.node,
        rho_m=place.rho_m,
        lateral_m=place.lateral_m,
        heading_rad=place.heading_rad,
        x_m=float(tracker.pose[0]),
        y_m=float(tracker.pose[1]),
        z_m=tracker.height_m,
        yaw_rad=math.remainder(float(tracker.pose[2]), 2.0 * math.pi),
        std_along_m=along,
        std_across_m=across,
        std_heading_rad=heading,
        next_point=place.next_point,
        next_point_m=place.next_m,
    )
