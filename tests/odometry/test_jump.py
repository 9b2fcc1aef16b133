"""Jumps: what the motion did not predict is found all around; a pose that wheels speak against must be far better."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from lhdmap.messages import FloatArray
from lhdmap.odometry.anchored.jump import jump
from lhdmap.odometry.motion import FORWARD, TURNING, PlanarMotion
from lhdmap.odometry.settings import OdometrySettings, SearchSettings
from lhdmap.odometry.wheels.model import WheelModel
from lhdmap.scan_matching.matching import Hits, Match, MatchModel, Prior
from lhdmap.scan_matching.search import SearchGrid
from lhdmap.scan_matching.submap import Submap

MODEL = MatchModel(0.012, 3.0, 2.0, 0.05, 6)
GRID = SearchGrid(apart_m=math.inf)  # as the odometry searches
TRUE = np.array([0.4, -0.2, 0.1])
SURE = np.diag([0.02**-2, 0.02**-2, math.radians(0.5) ** -2])


def room(start: FloatArray, length_m: float = 9.0) -> FloatArray:
    """Return what a scanner sees at `start` (3,) of a bare hall with a niche, in its own frame, (N, 3)."""
    corners = [(-4, -3), (length_m - 4, -3), (length_m - 4, 4), (1, 4), (1, 5.5), (-1, 5.5), (-1, 4), (-4, 4), (-4, -3)]
    lines = [np.linspace(a, b, 90, endpoint=False) for a, b in pairwise(corners)]
    points = np.vstack(lines).astype(float)
    c, s = math.cos(start[2]), math.sin(start[2])
    local = (points - start[:2]) @ np.array([[c, -s], [s, c]])
    return np.column_stack([local, np.zeros(len(local))])


@pytest.fixture(scope="module")
def walls() -> Submap:
    """The hall, seen from around the middle with the scanner's noise."""
    submap, rng = Submap(0.025, model=MODEL, grid=GRID, window_cells=1024), np.random.default_rng(1)
    for _ in range(20):
        pose = np.array([*rng.uniform(-0.3, 0.3, 2), rng.uniform(-0.1, 0.1)])
        noisy = room(pose)
        noisy[:, :2] += rng.normal(0.0, 0.008, (len(noisy), 2))
        submap.insert(noisy, pose)
    return submap


def found_from(walls: Submap, predicted: FloatArray, motion: PlanarMotion) -> tuple[Match, Match | None]:
    """Return the match near a prediction, and the jump from there."""
    hits, prior = Hits(room(TRUE), len(room(TRUE)), layered=False), Prior(predicted, SURE)
    near = walls.align(hits, prior)
    return near, jump(walls, hits, near, prior, motion, WheelModel(OdometrySettings(), motion), SearchSettings())


def test_a_kidnapped_machine_is_found(walls: Submap) -> None:
    near, found = found_from(walls, TRUE + np.array([0.25, -0.2, math.radians(15.0)]), PlanarMotion(OdometrySettings()))
    assert near.support < 0.4
    assert found is not None
    assert np.hypot(*(found.pose - TRUE)[:2]) < 0.01
    assert abs(found.pose[2] - TRUE[2]) < math.radians(0.2)


def test_a_pose_that_fits_is_left_alone(walls: Submap) -> None:
    near, found = found_from(walls, TRUE + np.array([0.01, 0.01, 0.0]), PlanarMotion(OdometrySettings()))
    assert near.support > 0.9
    assert found is None


def wheeled(gap_s: float = 0.02) -> tuple[PlanarMotion, WheelModel]:
    """Return a motion whose last step wheels have measured, and the wheels."""
    motion, wheels = unwheeled()
    motion.predict(gap_s)
    wheels.gate.fuse(FORWARD, 0.0, 0.01, scaled=False)
    wheels.gate.fuse(TURNING, 0.0, 0.01, scaled=False)
    assert motion.measured
    return motion, wheels


def unwheeled() -> tuple[PlanarMotion, WheelModel]:
    """Return a motion of a machine without wheels."""
    motion = PlanarMotion(OdometrySettings(), np.zeros(3))
    return motion, WheelModel(OdometrySettings(), motion)


def test_wheels_that_disagree_want_more_support(walls: Submap) -> None:
    """The better place wins against wheels where its support is far better, not where it is a little better: a crowd's chance."""
    predicted = TRUE + np.array([0.25, -0.2, math.radians(15.0)])
    hits, prior = Hits(room(TRUE), len(room(TRUE)), layered=False), Prior(predicted, SURE)
    away, wide = walls.align(hits, prior), SearchSettings()
    assert jump(walls, hits, away, prior, *wheeled(), wide) is not None
    close = away._replace(support=0.75)  # as if a crowd hid what is wrong there
    free = jump(walls, hits, close, prior, *unwheeled(), wide)
    assert free is not None
    assert free.support > close.support
    assert jump(walls, hits, close, prior, *wheeled(), wide) is None


def test_a_jump_back_to_where_the_wheels_lead_is_cheap(walls: Submap) -> None:
    """A crowd wins four times by 6 degrees: each step judged alone, wheels spoke against the way back as they had before."""
    predicted = TRUE + np.array([0.03, 0.0, math.radians(3.0)])
    hits, prior = Hits(room(TRUE), len(room(TRUE)), layered=False), Prior(predicted, SURE)
    close = walls.align(hits, prior)._replace(pose=predicted, support=0.82)
    wide, back = SearchSettings(), TRUE - predicted
    assert jump(walls, hits, close, prior, *wheeled(), wide) is None
    found = jump(walls, hits, close, prior, *wheeled(), wide, offset=-back)
    assert found is not None
    assert np.hypot(*(found.pose - TRUE)[:2]) < 0.01


@pytest.mark.parametrize(("gap_s", "found"), [(0.02, False), (2.0, True)])
def test_after_a_gap_all_that_the_settings_allow_is_searched(walls: Submap, gap_s: float, found: bool) -> None:
    """Sure of its pose, the filter searches 0.3 m; wheels that hung through a gap are 1.4 m off and as sure."""
    motion = PlanarMotion(OdometrySettings(), np.zeros(3))
    motion.predict(gap_s)
    motion.P[:3, :3] = np.linalg.inv(SURE)
    _, result = found_from(walls, TRUE + np.array([1.4, 0.0, 0.0]), motion)
    near = result is not None and np.hypot(*(result.pose - TRUE)[:2]) < 0.02
    assert near == found


def test_a_velocity_that_is_distrusted_is_hardly_known() -> None:
    """Else the speed that a jump gives would carry the next pose away, and the scans could not take it back."""
    motion, _ = wheeled()
    motion.distrust_velocity(np.array([1.5, 0.0, 0.2]))
    assert motion.velocity.tolist() == [1.5, 0.0, 0.2]
    motion.predict(0.1)
    sigma_m = math.sqrt(motion.P[0, 0])
    assert 0.2 < sigma_m < 0.5
    pose = motion.pose
    motion.correct(pose - np.array([0.15, 0.0, 0.0]), np.diag([1e4, 1e4, 1e6]))
    assert motion.velocity[0] == pytest.approx(0.0, abs=0.1)
