"""The integrated cloud: points in `map` with what is known of each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lhdmap.extras import library
from lhdmap.messages import Float32Array, FloatArray

if TYPE_CHECKING:
    from open3d.geometry import PointCloud


@dataclass(frozen=True, slots=True)
class GridCloud:
    """N points; what is not known of them is None.

    Attributes:
        points_m: shape (N, 3), float32, metres in `map`.
        normals: shape (N, 3), float32, unit length, towards the place that the point was seen from; zero where unknown.
        curvature: shape (N,), float32, surface variation l0 / (l0 + l1 + l2), 0 ... 1/3; zero where unknown.
        stamps_ns: shape (N,), int64, when the point was first measured.
        hits: shape (N,), uint32, measurements that were averaged into the point.
        viewpoints_m: shape (N, 3), float32, where the sensor was at the first measurement.
        origin_m: x, y, z of the point that all coordinates are relative to; not zero only for a file in a grid whose numbers
            are so large that float32 would lose the millimetres.
    """

    points_m: Float32Array
    normals: Float32Array | None = None
    curvature: Float32Array | None = None
    stamps_ns: npt.NDArray[np.int64] | None = None
    hits: npt.NDArray[np.uint32] | None = None
    viewpoints_m: Float32Array | None = None
    origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __len__(self) -> int:
        return len(self.points_m)

    def exact_m(self) -> FloatArray:
        """Return the points with the origin added, shape (N, 3), float64: the coordinates of the file."""
        points: FloatArray = self.points_m.astype(np.float64) + self.origin_m
        return points

    def with_normals(self, normals: Float32Array, curvature: Float32Array) -> GridCloud:
        """Return the same cloud with these normals, shape (N, 3), and curvatures, shape (N,)."""
        return replace(self, normals=normals, curvature=curvature)

    def to_open3d(self) -> PointCloud:
        """Return an `open3d.geometry.PointCloud` with points and, where they are known, normals; both are copied."""
        o3d = library("open3d")

        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(self.points_m.astype(np.float64)))
        if self.normals is not None:
            cloud.normals = o3d.utility.Vector3dVector(self.normals.astype(np.float64))
        return cloud
