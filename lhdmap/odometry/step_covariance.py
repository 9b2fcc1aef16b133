"""Measures how far each step of the planar odometry may be off, scan by scan: the parts of `lhdmap.scan_matching.step_error`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.steps import Matched
from lhdmap.odometry.trust_settings import TrustSettings
from lhdmap.scan_matching.information import body_information
from lhdmap.scan_matching.step_error import StepError
from lhdmap.scan_matching.surface_map import CELLS, CENTRE_X, CENTRE_Y, NORMAL_X, NORMAL_Y, SCATTER, SERVED
from lhdmap.scan_matching.wall_lines import line_weight, slanted

# Variance of the cells along a line, in squares of a cell: a Gaussian of two cells' deviation, cut off at three.
_SPREAD_CELLS2 = 2.2
_MOST_NOISE = 2.0  # share of noise: lines of few cells make it larger than all that the scan tells
# Lever of a scan's hits: how far away the walls are whose noise turns it. The settings were measured at the usual one; beyond
# the limits none was.
_USUAL_LEVER_M, _LEAST_LEVER_M, _LONGEST_LEVER_M = 5.0, 3.0, 50.0
_LEVER_POWER = 1.5  # with which the walk falls as the lever grows: fitted, as the settings of `TrustSettings`
_OF_PAIRS = 0.24  # share of noise where scans are compared in pairs: each link of the chain adds its error
_SECOND = 2  # scan of a drive: it is placed against one scan alone
_NOTHING = np.zeros((3, 3))  # covariance of a scan that adds none
_LITTLE = np.diag([1e-3, 1e-3, 1e-3])  # information of no scan
# Of a tilted scanner: noise of the roll shifts what it sees of the walls sideways.
_SWAY = np.diag([0.0, 0.0035**2, 0.0])


class StepErrors:
    """`of` each processed scan in turn: the error of the step from the one before; `noise`: share of noise in the last one."""

    def __init__(self, settings: TrustSettings) -> None:
        self._settings = settings
        self._pose: FloatArray | None = None
        self._variance = np.zeros(3)  # of the pose against the map
        self._scans = 0
        self.noise = 0.0

    def of(self, pose: FloatArray, matched: Matched, covariance: FloatArray, *, levelled: bool = True) -> StepError:
        """Take a scan's pose (3,) with its covariance (3, 3) against the map, in the body's axes.

        `levelled`: an inclinometer tells how the machine rolls and pitches.
        """
        s, before = self._settings, pose if self._pose is None else self._pose
        self._scans += 1
        start = _NOTHING
        if self._scans == _SECOND:  # placed against one scan: so is the heading of all that follows
            start = np.diag([0.0, 0.0, math.radians(s.start_deg) ** 2])
        forward_m, aside_m, _ = se2.between(before, pose).tolist()
        way_m = math.hypot(forward_m, aside_m)
        variance, self._variance = self._variance, covariance.diagonal().copy()
        self._pose = pose
        if matched.lost:  # nothing holds the pose: what the motion is off stays
            grown = np.maximum(self._variance - variance, 0.0)
            return StepError(start + np.diag(grown), np.zeros(3), covariance)
        seen = _seen(matched, float(pose[2]))
        self.noise = seen.noise
        short = _USUAL_LEVER_M / min(max(seen.lever_m, _LEAST_LEVER_M), _LONGEST_LEVER_M)
        noisy = min(seen.noise, 1.0)
        lasting = s.walk_per_m * (seen.noise_along + seen.noise**2)
        if matched.layered:
            lasting += self._tilted_walk(matched, levelled=levelled)
        lasting *= short**_LEVER_POWER * way_m
        followed = min(float(covariance[0, 0]) / seen.variance_along, 1.0)  # the scan, not wheels or inertia
        lasting += max(1.0 - 2.0 * followed, 0.0) * way_m
        pull = s.pull * noisy * short * math.sqrt(followed)
        jitter = (s.jitter + s.noisy_jitter * noisy) * covariance
        if matched.layered:
            pull += s.tilted_alone_pull if matched.alone else 0.0
            jitter = s.tilted_jitter * jitter + _SWAY
        return StepError(start + lasting * covariance, np.array([pull * forward_m, 0.0, 0.0]), jitter)

    def _tilted_walk(self, matched: Matched, *, levelled: bool) -> float:
        s = self._settings
        if not levelled:
            return s.tilted_unlevelled_walk
        return s.tilted_alone_walk if matched.alone else s.tilted_walk


class _Seen(NamedTuple):
    """What a scan alone tells: share of noise in all of it and along, lever of its hits (m), variance along (m²)."""

    noise: float
    noise_along: float
    lever_m: float
    variance_along: float


def _seen(matched: Matched, heading_rad: float) -> _Seen:
    noise = _OF_PAIRS * matched.information if matched.noise is None else matched.noise
    return _Seen(*_told(matched.information, noise, heading_rad))


@nb.njit(cache=True)
def _told(H_map: FloatArray, noise_map: FloatArray, heading_rad: float) -> tuple[float, float, float, float]:
    """Return the fields of `_Seen` from information and noise (3, 3) in the map's axes."""
    information, noise = body_information(H_map, heading_rad), body_information(noise_map, heading_rad)
    alone = np.linalg.inv(information + _LITTLE)
    return (
        min(np.trace(alone @ noise), _MOST_NOISE),
        min(noise[0, 0] / (information[0, 0] + _LITTLE[0, 0]), _MOST_NOISE),
        math.sqrt(alone[1, 1] / alone[2, 2]),
        alone[0, 0],
    )


@nb.njit(cache=True, nogil=True)
def direction_noise(pose, hits, lines, fine_m, model):  # type: ignore[no-untyped-def]
    """Return what noise of the lines' directions adds to the information (3, 3) on average: it turns normals along the walls."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    points, total, row = hits.points, np.zeros((3, 3)), np.zeros(3)
    for i in range(points.shape[0]):
        if lines[i, SERVED] == 0.0:
            continue
        rx, ry = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
        nx, ny = lines[i, NORMAL_X], lines[i, NORMAL_Y]
        towards = nx * rx + ny * ry
        d = nx * (pose[0] + rx - lines[i, CENTRE_X]) + ny * (pose[1] + ry - lines[i, CENTRE_Y])
        d += slanted(hits, i, lines[i], c, s, nx, ny)
        _, w = line_weight(lines[i], d * d, towards * towards / (rx * rx + ry * ry + 1e-12), fine_m, model)
        angle2 = lines[i, SCATTER] / (lines[i, CELLS] * _SPREAD_CELLS2 * lines[i, SERVED] ** 2)
        row[0], row[1], row[2] = -ny, nx, ny * ry + nx * rx
        for a in range(3):
            for b in range(3):
                total[a, b] += w * angle2 * row[a] * row[b]
    return total
