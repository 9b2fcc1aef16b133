"""A place looked for near where it was lost: at once where the odometry leads, else where it fits well, or from some way."""

from __future__ import annotations

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.localization.settings import LocalizationSettings
from lhdmap.localization.tracker import MapTracker
from lhdmap.localization.walls import MapWalls
from lhdmap.pipeline.look_near import NearLook

from tests.localization.known import hits_at, known_map, poses_at

SECOND_NS = 1_000_000_000


def found_after(off_m: float, way_m: list[float], wanted: float) -> tuple[int, float] | None:
    """Return after how many looks, one a second, a machine is found, and how far off, whose odometry is off along its way."""
    known = known_map()
    walls = MapWalls(known.topology, known.landmarks)
    look, poses = NearLook(walls), poses_at(np.array(way_m))
    look.lost(0, way_m[0])
    for k, (pose, points) in enumerate(zip(poses, hits_at(poses, 9), strict=True), start=1):
        carried = se2.compose(pose, np.array([off_m, 0.0, 0.0]))
        tracker = MapTracker(walls, LocalizationSettings(), carried, np.eye(3), 0.0)
        found = look.look(k * SECOND_NS, way_m[k - 1], tracker, points, lambda: wanted)
        if found is not None:
            return k, float(np.hypot(*(found - pose)[:2]))
    return None


@pytest.mark.parametrize(("off_m", "wanted"), [(0.1, 0.5), (1.5, 0.5), (0.1, 0.8)])
def test_where_it_fits_well_or_the_odometry_leads_two_looks_at_rest_suffice(off_m: float, wanted: float) -> None:
    """As after late scans, that made a machine brake with its place ahead of it."""
    found = found_after(off_m, [20.0] * 6, wanted)
    assert found is not None
    assert found[0] == 2
    assert found[1] < 0.15


def test_elsewhere_one_that_just_fits_must_be_seen_from_some_way() -> None:
    """In offices a corner of a room that the map does not have fitted another one for as long as the robot stood."""
    assert found_after(1.5, [20.0] * 6, 0.85) is None
    found = found_after(1.5, [20.0, 20.8, 21.6, 22.4], 0.85)
    assert found is not None
    assert found[0] >= 3
