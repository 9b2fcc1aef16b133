"""Clouds as tables of named fields, which is what PLY and PCD files hold."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.integration.cloud import GridCloud
from lhdmap.messages import Float32Array, FloatArray

LARGEST_COORDINATE_M = 131072.0  # where float32 steps reach 8 to 16 mm
_FARTHEST_M = 4096.0  # where float32 steps reach a quarter of a millimetre
Table = npt.NDArray[np.void]
Real = TypeVar("Real", np.float32, np.float64)


class FieldNames(NamedTuple):
    """How a file format calls the three components of the normal."""

    normal: tuple[str, str, str]


PLY_NAMES = FieldNames(("nx", "ny", "nz"))
PCD_NAMES = FieldNames(("normal_x", "normal_y", "normal_z"))


def table_of(cloud: GridCloud, names: FieldNames, stamp_types: list[tuple[str, str]]) -> Table:
    """Return the cloud as a structured array with the fields that it has; stamps are left for the caller to fill in."""
    far = any(cloud.origin_m)
    points = cloud.exact_m() if far else cloud.points_m
    fields = [(axis, "<f8" if far else "<f4") for axis in "xyz"]
    fields += [(name, "<f4") for name in names.normal] if cloud.normals is not None else []
    fields += [("curvature", "<f4")] if cloud.curvature is not None else []
    fields += stamp_types if cloud.stamps_ns is not None else []
    fields += [("hits", "<u4")] if cloud.hits is not None else []
    table = np.zeros(len(cloud), dtype=fields)
    for axis, name in enumerate("xyz"):
        table[name] = points[:, axis]
    if cloud.normals is not None:
        for axis, name in enumerate(names.normal):
            table[name] = cloud.normals[:, axis]
    if cloud.curvature is not None:
        table["curvature"] = cloud.curvature
    if cloud.hits is not None:
        table["hits"] = cloud.hits
    return table


def cloud_of(path: Path, table: Table, stamps_ns: npt.NDArray[np.int64] | None) -> GridCloud:
    """Return the cloud of a file's table; points that are not finite are left out, unknown fields are passed over.

    Raises:
        InputError: the table has no x, y and z, or its coordinates are too large.
    """
    names = table.dtype.names or ()
    if not {"x", "y", "z"} <= set(names):
        raise InputError(f"{path}: its fields are {', '.join(names) or 'none'}; x, y and z were wanted")
    exact = any(table.dtype[axis].base.itemsize > np.dtype(np.float32).itemsize for axis in "xyz")
    points, origin = local_points(path, _columns(table, ("x", "y", "z"), np.float64), exact=exact)
    keep = np.isfinite(points).all(axis=1)
    normal = next((n.normal for n in (PLY_NAMES, PCD_NAMES) if set(n.normal) <= set(names)), None)
    return GridCloud(
        points_m=points[keep],
        normals=None if normal is None else _columns(table, normal, np.float32)[keep],
        curvature=table["curvature"][keep].astype(np.float32) if "curvature" in names else None,
        stamps_ns=None if stamps_ns is None else stamps_ns[keep],
        hits=table["hits"][keep].astype(np.uint32) if "hits" in names else None,
        origin_m=origin,
    )


def local_points(path: Path, points: FloatArray, *, exact: bool) -> tuple[Float32Array, tuple[float, float, float]]:
    """Return coordinates (N, 3) as float32 about an origin that keeps their millimetres, and the origin.

    Args:
        path: for texts.
        points: shape (N, 3), metres.
        exact: whether the file holds more than 32-bit floats. What those have lost of a national grid does not come back.

    Raises:
        InputError: they are not exact, and so large that only decimetres are left.
    """
    finite = points[np.isfinite(points).all(axis=1)]
    middle = np.median(finite, axis=0) if len(finite) else np.zeros(3)
    largest_m = float(np.abs(middle).max())
    if largest_m > LARGEST_COORDINATE_M and not exact:
        raise InputError(
            f"{path}: its coordinates are around {largest_m:.0f} m, of which 32-bit floats keep no millimetres; less than "
            f"{LARGEST_COORDINATE_M:.0f} m was wanted, or 64-bit numbers: shift the cloud to a local origin first"
        )
    origin = np.where(np.abs(middle) > _FARTHEST_M, np.round(middle), 0.0) if exact else np.zeros(3)
    with np.errstate(over="ignore", invalid="ignore"):
        near = (points - origin).astype(np.float32)
    return near, (float(origin[0]), float(origin[1]), float(origin[2]))


def _columns(table: Table, names: tuple[str, ...], kind: type[Real]) -> npt.NDArray[Real]:
    with np.errstate(over="ignore", invalid="ignore"):
        return np.stack([table[name].astype(kind) for name in names], axis=-1)


def text_table(path: Path, body: bytes, dtype: np.dtype[np.void], count: int) -> Table:
    """Return the first `count` rows of a text body as a table.

    Raises:
        InputError: there are fewer rows, or something in them is no number.
    """
    names = dtype.names or ()
    columns = columns_of(dtype)
    words = body.split(None, count * columns)[: count * columns]
    if len(words) < count * columns:
        raise InputError(f"{path}: cut off: {len(words) // columns} of {count} points are there")
    table = np.zeros(count, dtype=dtype)
    at = 0
    for name in (name for name in names if _width(dtype, name)):
        width, base = _width(dtype, name), dtype[name].base
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # becomes inf: no valid point
                values = [np.array(words[at + k :: columns]).astype(base) for k in range(width)]
        except (ValueError, OverflowError):
            raise InputError(f"{path}: field '{name}' holds something that is no number of type {base}") from None
        table[name] = np.stack(values, axis=-1).reshape(table[name].shape)
        at += width
    return table


def columns_of(dtype: np.dtype[np.void]) -> int:
    """Return how many numbers a row holds."""
    return sum(_width(dtype, name) for name in dtype.names or ())


def _width(dtype: np.dtype[np.void], name: str) -> int:
    """Return how many numbers a field holds."""
    return math.prod(dtype[name].shape)


def binary_table(path: Path, body: memoryview, dtype: np.dtype[np.void], count: int) -> Table:
    """Return the first `count` rows of a binary body as a table.

    Raises:
        InputError: there are fewer rows.
    """
    if len(body) < count * dtype.itemsize:
        raise InputError(f"{path}: cut off: {len(body) // dtype.itemsize} of {count} points are there")
    if count == 0 or dtype.itemsize == 0:
        return np.zeros(0, dtype=dtype)
    return np.frombuffer(body, dtype=dtype, count=count)
