"""Measures how far each step of the planar odometry may be off, scan by scan: the parts of `step_error`."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.odometry.matching import Hits, Match, MatchModel, line_weight, slanted
from lhdmap.odometry.step_error import StepError
from lhdmap.odometry.steps import Matched
from lhdmap.odometry.trust_settings import TrustSettings

# Variance of the cells along a line, in squares of a cell: a Gaussian of two cells' deviation, cut off at three.
_SPREAD_CELLS2 = 2.2
_MOST_NOISE = 2.0  # share of noise: lines of few cells make it larger than all that the scan tells
_USUAL_LEVER_M, _LEAST_LEVER_M, _LONGEST_LEVER_M = 5.0, 4.0, 50.0
_LEVER_POWER = 1.5


class StepErrors:
    """`of` each processed scan in turn: the error of the step from the one before."""

    def __init__(self, settings: TrustSettings) -> None:
        self._settings = settings
        self._pose: FloatArray | None = None
        self._variance = np.zeros(3)  # of the pose against the map

    def of(self, pose: FloatArray, matched: Matched, covariance: FloatArray, information: FloatArray) -> StepError:
        """Take a scan's pose (3,), covariance (3, 3) against the map and own information (3, 3), both in the body's axes."""
        s, before = self._settings, self._pose if self._pose is not None else pose
        way_m = float(np.hypot(*(pose[:2] - before[:2])))
        grown = np.maximum(np.diag(covariance) - self._variance, 0.0)
        self._pose, self._variance = pose, np.diag(covariance).copy()
        if matched.lost:  # nothing holds the pose: what the motion is off stays
            return StepError(np.diag(grown), np.zeros(3), covariance)
        noise, tilt = min(matched.noise_share, _MOST_NOISE), s.tilted if matched.layered else 1.0
        alone = np.linalg.inv(information + np.diag([1e-3, 1e-3, 1e-3]))
        lever_m = math.sqrt(float(alone[1, 1] / alone[2, 2]))
        short = _USUAL_LEVER_M / min(max(lever_m, _LEAST_LEVER_M), _LONGEST_LEVER_M)
        walk = tilt * s.walk_per_m * noise * (1.0 + noise) * short**_LEVER_POWER * way_m * covariance
        followed = min(float(covariance[0, 0] / alone[0, 0]), 1.0)  # by the motion, not by wheels or inertia
        pull = s.pull * min(noise, 1.0) * short * followed * way_m
        return StepError(walk, np.array([pull, 0.0, 0.0]), tilt * (s.jitter + s.noisy_jitter * min(noise, 1.0)) * covariance)


def noise_share(result: Match, hits: Hits, fine_m: float, model: MatchModel) -> float:
    """Return which share of a match's information comes from noise of its lines' directions: small in rough walls, 1 in smooth."""
    noise = _direction_noise(result.pose, hits, result.lines, fine_m, model)
    return float(np.trace(np.linalg.solve(result.information + 1e-3 * np.eye(3), noise)))


@nb.njit(cache=True, nogil=True)
def _direction_noise(pose, hits, lines, fine_m, model):  # type: ignore[no-untyped-def]
    """Return what noise of the lines' directions adds to the information (3, 3) on average: it turns normals along the walls."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    points, total, row = hits.points, np.zeros((3, 3)), np.zeros(3)
    for i in range(points.shape[0]):
        if lines[i, 6] == 0.0:
            continue
        rx, ry = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
        nx, ny = lines[i, 2], lines[i, 3]
        towards = nx * rx + ny * ry
        d = nx * (pose[0] + rx - lines[i, 0]) + ny * (pose[1] + ry - lines[i, 1])
        d += slanted(hits, i, lines[i], c, s, nx, ny)
        _, w = line_weight(lines[i], d * d, towards * towards / (rx * rx + ry * ry + 1e-12), fine_m, model)
        angle2 = lines[i, 4] / (lines[i, 5] * _SPREAD_CELLS2 * lines[i, 6] ** 2)
        row[0], row[1], row[2] = -ny, nx, ny * ry + nx * rx
        for a in range(3):
            for b in range(3):
                total[a, b] += w * angle2 * row[a] * row[b]
    return total
