"""LAS and LAZ files with laspy: written as version 1.4, point format 6; read in all versions that laspy reads."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lhdmap.errors import InputError
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.cloud_fields import local_points

if TYPE_CHECKING:
    from laspy import LasReader

SCALE_M = 0.0001  # a tenth of a millimetre: +-214 km fit
EXTRA = ("nx", "ny", "nz", "curvature", "stamp_ns", "hits")
CHUNK = 1_000_000
MOST_POINTS_PER_BYTE = 2_000  # equal points pack well


def write_laz(path: Path, cloud: GridCloud) -> None:
    """Write LAS or, by the suffix, LAZ.

    Normals, curvature and the exact stamp (64-bit integer) are extra dimensions under the names of the PLY file; the
    standard `gps_time` holds the stamp in seconds (the log's own clock, not GPS time).
    """
    import laspy

    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = np.full(3, SCALE_M)
    points = cloud.exact_m()
    header.offsets = np.floor(points.min(axis=0)) if len(cloud) else np.zeros(3)
    extra = _extra(cloud)
    if extra:
        header.add_extra_dims(
            [laspy.ExtraBytesParams(name=name, type=values.dtype.str) for name, values in extra.items()]
        )
    las = laspy.LasData(header)
    las.xyz = points
    if cloud.stamps_ns is not None:
        las.gps_time = cloud.stamps_ns / 1e9
    for name, values in extra.items():
        las[name] = values
    las.write(str(path))


def read_laz(path: Path) -> GridCloud:
    """Return the points of a LAS or LAZ file; what `write_laz` adds comes back, other dimensions are passed over.

    Raises:
        InputError: it is no such file, or it is cut off or damaged.
    """
    import laspy

    data = path.read_bytes()
    if not data.startswith(b"LASF"):
        raise InputError(f"{path}: no LAS or LAZ file (it does not begin with 'LASF')")
    _check_records(path, data)
    try:
        with laspy.open(io.BytesIO(data)) as reader:
            parts = _parts(path, reader, len(data))
    except InputError:
        raise
    except (
        BaseException
    ) as error:  # laspy, its decoder in Rust (whose panics are no Exception) and numpy have no common family
        if isinstance(error, (KeyboardInterrupt, SystemExit)):
            raise
        raise InputError(
            f"{path}: the LAS or LAZ file is cut off or damaged: {error or type(error).__name__}"
        ) from None
    return _cloud(path, parts)


def _check_records(path: Path, data: bytes) -> None:
    """Refuse a header that promises more records than the file bears: laspy would read them one by one, without end.

    LAS 1.4 R15, Table 3: the number of variable-length records at byte 100 (54 bytes each at least), that of extended ones at
    byte 243 (60 bytes each at least).
    """
    is_14 = data[24:26] == b"\x01\x04"
    for start, least_bytes in ((100, 54), *(((243, 60),) if is_14 else ())):
        count = int.from_bytes(data[start : start + 4], "little")
        if count * least_bytes > len(data):
            raise InputError(f"{path}: damaged: the header promises {count} records, the file has {len(data)} bytes")


def _parts(path: Path, reader: LasReader, room: int) -> list[dict[str, np.ndarray]]:
    """Return the points in pieces, each a table of what is known; a damaged header asks for no more memory than the file bears."""
    promised = reader.header.point_count
    if promised > room * MOST_POINTS_PER_BYTE:
        raise InputError(f"{path}: the header promises {promised} points, the file has {room} bytes")
    names = set(reader.header.point_format.dimension_names)
    parts = []
    for points in reader.chunk_iterator(CHUNK):
        part = {"xyz": np.column_stack([points.x, points.y, points.z]).astype(np.float64)}
        parts.append(part | {name: np.asarray(points[name]) for name in EXTRA if name in names})
    found = sum(len(part["xyz"]) for part in parts)
    if found < promised:
        raise InputError(f"{path}: cut off: {found} of {promised} points are there")
    return parts


def _cloud(path: Path, parts: list[dict[str, np.ndarray]]) -> GridCloud:
    columns = {name: np.concatenate([part[name] for part in parts]) for name in (parts[0] if parts else ())}
    points, origin = local_points(path, columns.get("xyz", np.zeros((0, 3))), exact=True)
    keep = np.isfinite(points).all(axis=1)
    columns = {name: values[keep] for name, values in columns.items()}
    normals = [columns[name] for name in EXTRA[:3] if name in columns]
    return GridCloud(
        points[keep],
        np.column_stack(normals).astype(np.float32) if len(normals) == 3 else None,
        columns["curvature"].astype(np.float32) if "curvature" in columns else None,
        columns["stamp_ns"].astype(np.int64) if "stamp_ns" in columns else None,
        columns["hits"].astype(np.uint32) if "hits" in columns else None,
        origin_m=origin,
    )


def _extra(cloud: GridCloud) -> dict[str, np.ndarray]:
    extra: dict[str, np.ndarray] = {}
    if cloud.normals is not None:
        extra |= {name: cloud.normals[:, axis] for axis, name in enumerate(("nx", "ny", "nz"))}
    if cloud.curvature is not None:
        extra["curvature"] = cloud.curvature
    if cloud.stamps_ns is not None:
        extra["stamp_ns"] = cloud.stamps_ns
    if cloud.hits is not None:
        extra["hits"] = cloud.hits
    return extra
