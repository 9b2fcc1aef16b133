"""The paper's localization in a drift that is known: Eq. (1), landmarks, and what it cannot know."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from lhdmap.config import settings_from
from lhdmap.geometry import se2
from lhdmap.landmarks.quality import UNMEASURED
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.localization.method import Wheels
from lhdmap.localization.paper import PaperTracker
from lhdmap.localization.paper_nodes import PaperNodes
from lhdmap.localization.place_on_map import Placer
from lhdmap.localization.settings import LocalizationSettings
from lhdmap.localization.tracker import MapTracker
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray
from lhdmap.pipeline.localize import Localizer

from tests.localization import known


def tracker_at(way_m: float, *, turned: bool = False, off_m: float = 0.0) -> PaperTracker:
    here = known.known_map()
    pose = known.poses_at(np.array([way_m]))[0] + np.array([off_m, 0.0, np.pi if turned else 0.0])
    start = MapTracker(
        MapWalls(here.topology, here.landmarks), LocalizationSettings(), pose, np.diag([0.04] * 2 + [1e-3]), 0.0
    )
    return PaperTracker(PaperNodes(here.topology, here.landmarks, LandmarkSettings()), Placer(here.topology), start)


@pytest.mark.parametrize("turned", [False, True])
def test_the_distance_grows_by_speed_direction_and_time(turned: bool) -> None:
    """Eq. (1): ρ + v dir Δt, dir from the heading against the axis."""
    tracker = tracker_at(15.0, turned=turned)
    for _ in range(100):
        tracker.predict(np.zeros(3), np.zeros((3, 3)), Wheels(0.04, 0.04, np.nan))
    assert tracker.x[1] == pytest.approx(1.0, abs=0.01)
    assert tracker.x[0] == pytest.approx(
        15.0 + (-4.0 if turned else 4.0), abs=0.2
    )  # v begins at 0, and is told in a moment
    assert tracker.pose[0] == pytest.approx(tracker.x[0], abs=0.01)


def test_the_nearest_landmarks_correct_it() -> None:
    tracker = tracker_at(15.0, off_m=0.25)
    hits: FloatArray = known.hits_at(known.poses_at(np.array([15.0, 15.0])), 5)[0]
    for _ in range(6):
        tracker.predict(np.zeros(3), np.zeros((3, 3)), Wheels(0.6, 0.0, np.nan))
        said = tracker.correct(hits, len(hits), UNMEASURED)
        assert said.source in ("landmarks", "odometry")
    assert tracker.x[0] == pytest.approx(15.0, abs=0.08)


def test_between_matches_nothing_corrects_it() -> None:
    tracker = tracker_at(15.0)
    hits = known.hits_at(known.poses_at(np.array([15.0, 15.0])), 5)[0]
    tracker.correct(hits, len(hits), UNMEASURED)
    tracker.predict(np.zeros(3), np.zeros((3, 3)), Wheels(0.04, 0.0, np.nan))
    assert tracker.correct(hits, len(hits), UNMEASURED).source == ""


@functools.cache
def driven() -> FloatArray:
    """Return errors (N, 3) of a drive of 30 m with wheels that are 1 % too fast."""
    stream, poses = known.drive(5.0, 30.0)
    settings = settings_from({"localization.method": "paper"})
    with Localizer(known.known_map(), settings, None, np.array([*poses[0], 0.0])) as localizer:
        for role, message in stream:
            localizer.update(role, message)
        localizer.finish()
    said = [np.array([row.x_m, row.y_m, row.yaw_rad]) for row in localizer.rows]
    return np.array([se2.between(pose, one) for pose, one in zip(poses, said, strict=True)])


def test_without_slip_it_stays_within_centimetres() -> None:
    """Findings, section 3: 0.035 to 0.05 m along in rough and moderate walls, 0.10 to 0.20 m at most."""
    assert np.abs(driven()[:, 0]).max() < 0.2
    assert np.sqrt((driven()[:, 0] ** 2).mean()) < 0.1
