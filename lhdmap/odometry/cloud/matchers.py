"""Matchers of 3D clouds against a map: VGICP with a final fit to planes, and kiss-icp as the baseline.

Both find a pose near a predicted one; the same map of planes judges it and says how to blend it with the prediction.
VGICP: Koide et al., ICRA 2021, in the library small_gicp; kiss-icp: Vizzo et al., RA-L 2023.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol

import numpy as np

from lhdmap.extras import library
from lhdmap.geometry import se3
from lhdmap.geometry.twist import exp, log, orthonormal
from lhdmap.messages import FloatArray
from lhdmap.odometry.cloud.planes import PlaneFit, PlaneMap, PlaneNoise
from lhdmap.odometry.cloud.settings import CloudOdometrySettings

_NEIGHBOURS = 20  # of a point that its covariance is taken of: the library's default
_LEAST_POINTS = 100  # of a cloud: a blackout or a lens full of mud leaves fewer
_COARSE = 3.0  # voxels of the map that wide starts are matched against first, in voxels of the fine one
_BETTER = 0.01  # support by which a wide start must fit better than the prediction: less is chance
_FAR = 1e3  # metres that a library may move a pose before the result is taken for nonsense


class PreparedCloud(NamedTuple):
    """A cloud in `base_link`, sweep undone: all points (M, 3), the thinned ones (N, 3) alone and with covariances."""

    full_m: FloatArray
    points_m: FloatArray
    prepared: Any


def prepare(points_m: FloatArray, sample_m: float) -> PreparedCloud | None:
    """Return the cloud of points (M, 3) thinned to one per cell of `sample_m`; None where too few are left."""
    small_gicp = library("small_gicp")

    if len(points_m) < _LEAST_POINTS:
        return None
    thinned = small_gicp.voxelgrid_sampling(points_m, sample_m, num_threads=1)
    if len(thinned) < _LEAST_POINTS:
        return None
    small_gicp.estimate_covariances(thinned, num_neighbors=_NEIGHBOURS, num_threads=1)
    return PreparedCloud(points_m, np.array(thinned.points()[:, :3]), thinned)


class CloudPrediction(NamedTuple):
    """Where the machine should be: pose (4, 4), its information (6, 6), and starts for the search, each (4, 4)."""

    pose: FloatArray
    information: FloatArray
    starts: tuple[FloatArray, ...] = ()


class CloudMatcher(Protocol):
    """What the stage needs of a matcher."""

    def match(self, cloud: PreparedCloud, predicted: CloudPrediction) -> PlaneFit:
        """Return the pose of the cloud, blended with the prediction, and what the map says of it."""

    def insert(self, cloud: PreparedCloud, pose: FloatArray) -> None:
        """Take the cloud into the map."""

    def clear(self) -> None:
        """Begin a new map."""

    def __len__(self) -> int:
        """Return the size of the map: voxels or points."""


class VgicpMatcher:
    """Clouds against voxels with covariances; the map forgets voxels that were not seen again for `window_m`."""

    def __init__(self, settings: CloudOdometrySettings) -> None:
        self._settings = settings
        self._noise = PlaneNoise(settings.range_noise_m, settings.chance_sigma_m)
        self.clear()

    def clear(self) -> None:
        """Begin a new map."""
        self._fine = _voxel_map(self._settings, self._settings.voxel_m)
        self._coarse = _voxel_map(self._settings, _COARSE * self._settings.voxel_m)
        self._planes: PlaneMap | None = None

    def __len__(self) -> int:
        """Return the number of voxels."""
        return int(self._fine.size())

    def insert(self, cloud: PreparedCloud, pose: FloatArray) -> None:
        """Take the cloud into the map."""
        self._fine.insert(cloud.prepared, pose)
        self._coarse.insert(cloud.prepared, pose)
        self._planes = None

    def match(self, cloud: PreparedCloud, predicted: CloudPrediction) -> PlaneFit:
        """Return the best of the fits from the prediction and from the wide starts, if any."""
        best = self._fit(cloud, self._align(self._fine, cloud, predicted.pose, self._settings.voxel_m), predicted)
        for start in predicted.starts:
            near = self._align(self._coarse, cloud, start, _COARSE * self._settings.voxel_m)
            found = self._fit(cloud, self._align(self._fine, cloud, near, self._settings.voxel_m), predicted)
            best = found if found.support > best.support + _BETTER else best
        return best

    def judge(self, cloud: PreparedCloud, pose: FloatArray) -> PlaneFit:
        """Return what the planes say of a pose (4, 4)."""
        return self._plane_map().judge(cloud.points_m, pose)

    def _fit(self, cloud: PreparedCloud, start: FloatArray, predicted: CloudPrediction) -> PlaneFit:
        return self._plane_map().fit(cloud.points_m, start, predicted.pose, predicted.information)

    def _plane_map(self) -> PlaneMap:
        if self._planes is None:
            self._planes = PlaneMap(self._fine, self._settings.voxel_m, self._noise)
        return self._planes

    def _align(self, voxels: Any, cloud: PreparedCloud, start: FloatArray, reach_m: float) -> FloatArray:
        small_gicp = library("small_gicp")

        result = small_gicp.align(
            voxels,
            cloud.prepared,
            init_T_target_source=start,
            max_correspondence_distance=2.0 * reach_m,
            num_threads=1,
            max_iterations=30,
            rotation_epsilon=math.radians(0.02),
            translation_epsilon=5e-4,
        )
        return sensible(np.array(result.T_target_source), start)


def _voxel_map(settings: CloudOdometrySettings, voxel_m: float) -> Any:
    small_gicp = library("small_gicp")

    voxels = small_gicp.GaussianVoxelMap(voxel_m)
    # the map counts insertions, which come once in `insert_m` of travel
    voxels.set_lru(horizon=max(math.ceil(settings.window_m / max(settings.insert_m, 0.02)), 10), clear_cycle=10)
    return voxels


def sensible(pose: FloatArray, start: FloatArray) -> FloatArray:
    """Return a library's pose with an exact rotation, or the start where it is not finite or absurdly far."""
    if not np.isfinite(pose).all() or float(np.abs(pose[:3, 3] - start[:3, 3]).max()) > _FAR:
        return start
    return orthonormal(pose)


class KissMatcher:
    """kiss-icp's own parts (voxelisation, adaptive threshold, registration, hash map), put together as in its pipeline.

    The guess and the blend come from the motion model; a map of planes beside it says what the cloud could tell.
    """

    def __init__(self, settings: CloudOdometrySettings) -> None:
        self._settings = settings
        self.clear()

    def clear(self) -> None:
        """Begin a new map."""
        load_config = library("kiss_icp.config").load_config

        config = load_config(None)
        config.data.deskew = False  # done before, with the motion model's velocity
        config.data.min_range, config.data.max_range = 0.0, self._settings.max_range_m
        config.mapping.voxel_size = self._settings.kiss_voxel_m
        config.registration.max_num_threads = 1
        self._kiss = library("kiss_icp.kiss_icp").KissICP(config)
        self._judge = VgicpMatcher(self._settings)

    def __len__(self) -> int:
        """Return the number of voxels of the map of planes."""
        return len(self._judge)

    def insert(self, cloud: PreparedCloud, pose: FloatArray) -> None:
        """Take the cloud into both maps."""
        _, dense = self._kiss.voxelize(cloud.full_m)
        self._kiss.local_map.update(dense, pose)
        self._judge.insert(cloud, pose)

    def match(self, cloud: PreparedCloud, predicted: CloudPrediction) -> PlaneFit:
        """Return kiss-icp's pose blended with the prediction; its adaptive threshold is all the search that it has."""
        sigma = self._kiss.adaptive_threshold.get_threshold()
        source, _ = self._kiss.voxelize(cloud.full_m)
        pose = self._kiss.registration.align_points_to_map(
            points=source,
            voxel_map=self._kiss.local_map,
            initial_guess=predicted.pose,
            max_correspondance_distance=3.0 * sigma,
            kernel=sigma,
        )
        fit = self._judge.judge(cloud, sensible(pose, predicted.pose))
        self._kiss.adaptive_threshold.update_model_deviation(se3.inverse(predicted.pose) @ fit.pose)
        return fit._replace(pose=blended(fit, predicted))


def blended(fit: PlaneFit, predicted: CloudPrediction) -> FloatArray:
    """Return the mean (4, 4) of the fitted and the predicted pose, weighted by their information."""
    error = log(se3.inverse(fit.pose) @ predicted.pose)
    pull = predicted.information @ error
    step = np.linalg.solve(fit.information + predicted.information, pull)
    return orthonormal(fit.pose @ exp(np.asarray(step, dtype=np.float64)))
