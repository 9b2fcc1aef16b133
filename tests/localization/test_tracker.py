"""The tracker in tunnels whose walls are known, carried on by an odometry that drifts."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.localization.method import Corrected
from lhdmap.localization.settings import LocalizationSettings
from lhdmap.localization.tracker import MapTracker
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray

from tests.landmarks.worlds import ROUGH, SMOOTH, TunnelWorld, seen, tunnel
from tests.localization.tunnels import near, straight_walls, walls_of

STEP_M, SCALE = 0.2, 1.003
STEP_COVARIANCE = np.diag([0.002**2, 0.001**2, math.radians(0.02) ** 2])
START_STD = np.array([0.4, 0.2, math.radians(2.0)])


@functools.cache
def mapped(rms_m: float, width_m: float = 0.1) -> tuple[TunnelWorld, MapWalls]:
    world = tunnel(3, rms_m, 50.0, width_m=width_m)
    return world, walls_of({"t": (world, 0.0)})


class Driven:
    """A drive from 8 m on; `errors` (N, 3) of the tracker in the machine's axes after each scan, what the scans said."""

    def __init__(
        self, rms_m: float = ROUGH, *, off: FloatArray | None = None, missing: float = 0.0, width_m: float = 0.1
    ) -> None:
        self.world, walls = mapped(rms_m, width_m)
        rng = np.random.default_rng(7)
        before = self.world.pose(8.0)
        start = se2.compose(before, np.zeros(3) if off is None else off)
        P = np.diag(START_STD**2)
        self.tracker = MapTracker(walls, LocalizationSettings(), start, P, 0.0)
        self.blind = MapTracker(walls, LocalizationSettings(), start, P, 0.0)
        errors: list[FloatArray] = []
        self.said: list[Corrected] = []
        for at in np.arange(8.0 + STEP_M, 38.0, STEP_M):
            T = self.world.pose(float(at), 0.1 * math.sin(at / 5.0))
            step = se2.between(before, T) * np.array([SCALE, 1.0, 1.0])
            before = T
            self.blind.predict(step, STEP_COVARIANCE)
            self.tracker.predict(step, STEP_COVARIANCE)
            points = near(seen(self.world, T, rng))
            points = points[rng.random(len(points)) >= missing]
            self.said.append(self.tracker.correct(points, len(points), walls.quality("t")))
            errors.append(se2.between(T, self.tracker.pose))
        self.errors = np.array(errors)


@pytest.mark.parametrize("off", [(0.3, 0.0, 0.0), (-0.3, 0.15, math.radians(1.5))])
def test_it_converges_from_near_by(off: tuple[float, float, float]) -> None:
    """Findings, section 4: started 0.25 m off, it is at home after 20 m in all of 20 starts."""
    errors = Driven(off=np.array(off)).errors[round(20.0 / STEP_M) :]
    assert np.abs(errors[:, 0]).max() < 0.03
    assert np.abs(errors[:, 1]).max() < 0.01
    assert np.abs(errors[:, 2]).max() < math.radians(0.2)


def test_it_stays_with_hits_missing() -> None:
    """Findings, section 6: 30 % missing cost nothing in rough walls."""
    driven = Driven(missing=0.3)
    assert np.abs(driven.errors[:, 0]).max() < 0.03
    assert min(one.support for one in driven.said) > 0.85


def test_the_stated_deviation_is_that_of_a_start_no_more() -> None:
    driven = Driven()
    assert (driven.tracker.deviations < START_STD / 5.0).all()
    assert (driven.tracker.deviations > 0.0).all()
    within = np.abs(driven.errors[50:]) < 3.0 * driven.tracker.deviations
    assert within.mean(axis=0) == pytest.approx(np.ones(3), abs=0.1)


def test_what_is_not_observed_keeps_the_predictions_variance() -> None:
    """Straight walls 5 mm rough say where across, and little of where along: the deviation there says so."""
    rough, smooth = Driven(), Driven(SMOOTH, width_m=0.0)
    observed, not_observed = rough.tracker.deviations, smooth.tracker.deviations
    assert smooth.said[-1].information_along < 0.05 * rough.said[-1].information_along
    assert not_observed[0] > 2.0 * observed[0]  # in the steady state the root of the ratio of both matches' deviations
    assert not_observed[1] < 0.1 * smooth.blind.deviations[1]
    assert np.abs(smooth.errors[:, 0]).max() < 3.0 * not_observed[0]


def test_perfectly_straight_walls_say_nothing_of_along() -> None:
    """Hits of two lines without any roughness: along them the prediction holds, in pose and in variance."""
    walls = straight_walls(40.0, 2.2)
    tracker = MapTracker(walls, LocalizationSettings(), np.array([20.0, 0.05, 0.0]), np.diag([0.04, 0.04, 1e-3]), 0.0)
    x = np.arange(-9.0, 9.0, 0.1)
    points = np.concatenate([np.column_stack([x, np.full(len(x), side * 2.2)]) for side in (1.0, -1.0)])
    for _ in range(10):
        tracker.correct(points, len(points), walls.quality("s"))
    assert tracker.pose == pytest.approx([20.0, 0.0, 0.0], abs=0.01)
    assert 0.19 < tracker.deviations[0] < 0.23  # as before, and what walls that say nothing may be wrong by
    assert tracker.deviations[1] < 0.02


def test_without_walls_the_prediction_stays() -> None:
    _, walls = mapped(ROUGH)
    tracker = MapTracker(walls, LocalizationSettings(), np.array([0.0, 900.0, 0.0]), np.eye(3), 0.0)
    said = tracker.correct(np.array([[x, 2.0] for x in np.arange(0.0, 5.0, 0.1)]), 50, walls.quality(""))
    assert said.support == 0.0
    assert tracker.pose == pytest.approx([0.0, 900.0, 0.0])
    assert pytest.approx(np.eye(3), abs=1e-4) == tracker.P  # the map's own error stands beside it


def test_a_step_is_carried_on_with_its_covariance() -> None:
    """An uncertain heading becomes an uncertain place across, after a way of 10 m: by hand."""
    _, walls = mapped(ROUGH)
    heading_std = math.radians(1.0)
    tracker = MapTracker(
        walls, LocalizationSettings(), np.array([1.0, 2.0, 0.5 * math.pi]), np.diag([0, 0, heading_std**2]), 0.0
    )
    tracker.predict(np.array([10.0, 0.0, 0.0]), np.zeros((3, 3)))
    assert tracker.pose == pytest.approx([1.0, 12.0, 0.5 * math.pi])
    assert tracker.deviations[1] == pytest.approx(10.0 * heading_std, rel=0.02)
    assert tracker.deviations[0] == pytest.approx(
        0.1, rel=0.05
    )  # the odometry may be off by 1 % where walls told nothing yet
