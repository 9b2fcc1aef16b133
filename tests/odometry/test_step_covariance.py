"""What the planar odometry says of its own error, against what it is: rough, smooth and tilted, straight and in bends."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.step_covariance import StepErrors
from lhdmap.odometry.steps import Matched
from lhdmap.odometry.trust_settings import TrustSettings
from lhdmap.scan_matching.step_error import NO_ERROR, StepError, measured_covariance

from tests.odometry.planar_drives import ROUGH_M, SMOOTH_M, Driven, drive, run

INFORMATION = np.diag([1e6, 1e6, 1e8])
COVARIANCE = np.diag([1e-6, 1e-6, 1e-8])


def ratios(driven: Driven, length_m: float) -> FloatArray:
    """Return the errors (M, 3) of steps of a length over their stated deviations, without the start's."""
    used = [k for k, step in enumerate(driven.steps) if step.processed][10:]
    path = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(driven.truth[used, :2], axis=0).T))])
    found = []
    for first in range(0, len(used), 4):
        last = int(np.searchsorted(path, path[first] + length_m))
        if last < len(used):
            found.append(_ratio(driven, used[first : last + 1]))
    return np.array(found)


def _ratio(driven: Driven, scans: list[int]) -> FloatArray:
    told = NO_ERROR
    for before, after in pairwise(scans):
        told = told.then(se2.between(driven.estimate[before], driven.estimate[after]), driven.steps[after].error)
    true, way = (se2.between(poses[scans[0]], poses[scans[-1]]) for poses in (driven.truth, driven.estimate))
    stated = measured_covariance(driven.steps[scans[0]].error.jitter, way, told)
    ratio: FloatArray = se2.between(true, way) / np.sqrt(np.diag(stated))
    return ratio


@pytest.mark.parametrize("rms_m", [ROUGH_M, SMOOTH_M])
def test_steps_are_off_by_what_is_said(rms_m: float) -> None:
    """95 of 100 errors of true deviations are within two of them; evaluation/trust.md has the figures over many drives."""
    found: dict[float, list[FloatArray]] = {1.0: [], 10.0: []}
    for seed in (11, 12):
        poses, scans = drive(seed=seed, rms_m=rms_m)
        driven = run(scans, poses)
        for length_m, ratios_ in found.items():
            ratios_.append(ratios(driven, length_m))
        assert rms_m < ROUGH_M or not any(step.unseen for step in driven.steps)
    for several in found.values():
        together = np.concatenate(several)
        assert (np.abs(together) < 2.0).mean() > 0.85
        assert np.sqrt((together**2).mean()) > 0.4  # a deviation that is wide enough for anything says nothing


def errors_of(matched: Matched, *, ways: int = 2, levelled: bool = True) -> StepError:
    """Return what is said of a scan 1 m after the one before it."""
    errors = StepErrors(TrustSettings(start_deg=0.0))
    for k in range(ways):
        found = errors.of(np.array([float(k), 0.0, 0.0]), matched, COVARIANCE, levelled=levelled)
    return found


def test_noise_of_the_walls_directions_makes_the_way_weak() -> None:
    def walk(share: float) -> float:
        noise = np.diag([share * 1e6, 0.0, 0.0])
        return float(errors_of(Matched(INFORMATION, 0.01, 0.9, False, noise=noise)).walk[0, 0])

    assert walk(0.02) < 0.1 * walk(0.3) < 0.1 * walk(1.0)
    assert walk(5.0) == pytest.approx(walk(2.0))  # more than all is noise of the estimate itself


def test_a_pull_turns_with_the_gear() -> None:
    matched = Matched(INFORMATION, 0.01, 0.9, False, noise=np.diag([1e6, 0.0, 0.0]))
    errors = StepErrors(TrustSettings())
    pulls = [errors.of(np.array([x, 0.0, 0.0]), matched, COVARIANCE).pull[0] for x in (0.0, 1.0, 0.0)]
    assert pulls[0] == 0.0
    assert pulls[1] == pytest.approx(-pulls[2])
    assert pulls[1] > 0.0


def test_a_tilted_scanner_is_trusted_less_and_less_alone_and_least_unlevelled() -> None:
    quiet = np.diag([1e4, 0.0, 0.0])
    level = errors_of(Matched(INFORMATION, 0.01, 0.9, False, noise=quiet))
    helped = errors_of(Matched(INFORMATION, 0.01, 0.9, False, noise=quiet, layered=True, alone=False))
    alone = errors_of(Matched(INFORMATION, 0.01, 0.9, False, noise=quiet, layered=True))
    unlevelled = errors_of(Matched(INFORMATION, 0.01, 0.9, False, noise=quiet, layered=True), levelled=False)
    walks = [error.walk[2, 2] for error in (level, helped, alone, unlevelled)]
    assert walks == sorted(walks)
    assert walks[0] < walks[1]


def test_a_lost_scan_adds_what_the_motion_may_be_off() -> None:
    errors, lost = StepErrors(TrustSettings()), Matched(np.zeros((3, 3)), math.nan, 0.0, lost=True)
    errors.of(np.zeros(3), Matched(INFORMATION, 0.01, 0.9, False), COVARIANCE)
    grown = COVARIANCE + np.diag([0.04, 0.01, 0.0])
    found = errors.of(np.array([1.0, 0.0, 0.0]), lost, grown)
    assert np.diag(found.walk)[:2] == pytest.approx([0.04, 0.01])


def test_the_first_scan_leaves_an_error_of_the_heading() -> None:
    found = StepErrors(TrustSettings(start_deg=0.5))
    matched = Matched(INFORMATION, 0.01, 0.9, False, noise=np.zeros((3, 3)))
    walks = [found.of(np.array([float(k), 0.0, 0.0]), matched, COVARIANCE).walk[2, 2] for k in range(3)]
    assert walks[1] - walks[2] == pytest.approx(math.radians(0.5) ** 2)
