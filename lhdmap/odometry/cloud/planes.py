"""Planes of a voxel map: what a cloud's points are measured against, in metres, and what they can tell of the pose.

VGICP's cost holds a pull along the surface towards the voxels' means, that is towards standing still; in a smooth
tunnel it outweighs the walls. Here only distances to planes count, so that an axis without information shows as such
and the motion's prior decides it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.geometry import se3
from lhdmap.geometry.twist import exp, log, orthonormal
from lhdmap.messages import FloatArray

_SHIFT, _BITS = 1 << 20, 21  # a cell's place in a key of 63 bits: a million cells to each side
_CUTOFF = 3.0  # sigmas beyond which a point has no weight
_MEDIAN = 0.6745  # median of |x| in sigmas for a normal distribution
_ROUNDS = 5  # of the fit at most
_SMALL_STEP = 1e-4  # rad and m: a tenth of what a fit is off


class PlaneFit(NamedTuple):
    """A pose (4, 4) and what a map says of it.

    `information`: (6, 6) of the cloud alone about the pose, in body axes, rotation before translation; `residual_m`:
    rms distance of the points that agree with the map; `support`: their share.
    """

    pose: FloatArray
    information: FloatArray
    residual_m: float
    support: float


class PlaneNoise(NamedTuple):
    """Range noise of the scanner (m), and the sigma (m) along the machine that noise of the normals fakes."""

    range_m: float
    chance_sigma_m: float


class PlaneMap:
    """Planes of a `small_gicp.GaussianVoxelMap`, fitted when they are first asked for."""

    def __init__(self, voxels: Any, voxel_m: float, noise: PlaneNoise) -> None:
        """`voxels`: the map; `voxel_m`: its cell."""
        self._voxel_m, self._noise = voxel_m, noise
        self._means: FloatArray = voxels.voxel_points()[:, :3]
        self._covariances = voxels.voxel_covs().reshape(-1, 4, 4)
        keys = _keys(self._means, voxel_m)
        self._order = np.argsort(keys)
        self._keys = keys[self._order]
        self._normals = np.zeros((len(keys), 3))
        self._variances = np.full(len(keys), np.nan)

    def fit(self, points: FloatArray, start: FloatArray, predicted: FloatArray, prior: FloatArray) -> PlaneFit:
        """Return the pose of maximal posterior near `start` (4, 4): distances to planes and the prediction.

        `points`: (N, 3) in `base_link`; `prior`: information (6, 6) of the `predicted` pose (4, 4).
        """
        pose = start
        for _ in range(_ROUNDS):
            H, g, _ = self._normal_equations(points, pose)
            error = log(se3.inverse(predicted) @ pose)
            step = np.asarray(np.linalg.solve(H + prior, -(g + prior @ error)), dtype=np.float64)
            pose = orthonormal(pose @ exp(step))
            if np.abs(step).max() < _SMALL_STEP:
                break
        return self.judge(points, pose)

    def judge(self, points: FloatArray, pose: FloatArray) -> PlaneFit:
        """Return what the map says of a pose (4, 4) for `points` (N, 3) in `base_link`."""
        H, _, distances = self._normal_equations(points, pose)
        inside = distances[0] < _CUTOFF
        residual = float(np.sqrt(np.mean(distances[1][inside] ** 2))) if inside.any() else float("nan")
        return PlaneFit(pose, H, residual, float(inside.sum()) / len(points))

    def _normal_equations(
        self, points: FloatArray, pose: FloatArray
    ) -> tuple[FloatArray, FloatArray, tuple[FloatArray, FloatArray]]:
        """Return H (6, 6), gradient (6,), and the distances of the covered points in sigmas and in metres."""
        seen, voxel = self._associate(points @ pose[:3, :3].T + pose[:3, 3])
        p, normals = points[seen], self._normals[voxel]
        distance = np.einsum("ij,ij->i", p @ pose[:3, :3].T + pose[:3, 3] - self._means[voxel], normals)
        sigmas = np.abs(distance) / np.sqrt(self._variances[voxel])
        scale = max(float(np.median(sigmas)) / _MEDIAN, 1.0) if seen.size else 1.0
        kernel = np.square(np.clip(1.0 - (sigmas / (_CUTOFF * scale)) ** 2, 0.0, None))
        weight = kernel / (scale**2 * self._variances[voxel])
        body = normals @ pose[:3, :3]
        J = np.concatenate([np.cross(p, body), body], axis=1)
        JW = J.T * weight
        H, g = discounted(JW @ J, JW @ distance, self._noise.chance_sigma_m**-2)
        return H, g, (sigmas, distance)

    def _associate(self, points: FloatArray) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """Return indices of the points that lie in a voxel of the map, and of those voxels."""
        keys = _keys(points, self._voxel_m)
        place = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        seen = np.flatnonzero(self._keys[place] == keys)
        voxel = self._order[place[seen]]
        missing = np.unique(voxel[np.isnan(self._variances[voxel])])
        if missing.size:
            self._fit_planes(missing)
        return seen, voxel

    def _fit_planes(self, voxel: npt.NDArray[np.intp]) -> None:
        """Fit normals and variances: where the normals in a voxel differ, distances to its one plane scatter more."""
        spread, axes = np.linalg.eigh(self._covariances[voxel, :3, :3])
        self._normals[voxel] = axes[:, :, 0]
        self._variances[voxel] = self._noise.range_m**2 + np.clip(spread[:, 0], 0.0, 1.0) * self._voxel_m**2 / 12.0


def discounted(H: FloatArray, gradient: FloatArray, chance: float) -> tuple[FloatArray, FloatArray]:
    """Return H (6, 6) and gradient (6,) with the information along the machine (I) cut to I²/(I + chance).

    Noise of the normals makes any wall tell something of the motion along it, always that there is none: a little
    information along a tunnel is worse than none, whereas much of it is hardly touched.
    """
    inverse = np.linalg.inv(H + 1e-6 * np.eye(6))
    information = 1.0 / inverse[3, 3]
    removed = information * chance / (information + chance)
    H, gradient = H.copy(), gradient.copy()
    gradient[3] -= removed * float(inverse[3] @ gradient)
    H[3, 3] -= removed
    return H, gradient


def _keys(points: FloatArray, voxel_m: float) -> npt.NDArray[np.int64]:
    cells = np.clip(np.floor(points / voxel_m), -_SHIFT, _SHIFT - 1).astype(np.int64) + _SHIFT
    return (cells[:, 0] << 2 * _BITS) | (cells[:, 1] << _BITS) | cells[:, 2]
