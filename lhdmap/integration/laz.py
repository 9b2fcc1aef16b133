"""LAS and LAZ files (version 1.4, point format 6), written with laspy."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lhdmap.integration.cloud import Cloud

SCALE_M = 0.0001  # a tenth of a millimetre: +-214 km fit


def write_laz(path: Path, cloud: Cloud) -> None:
    """Write LAS or, by the suffix, LAZ.

    Normals, curvature and the exact stamp (64-bit integer) are extra dimensions under the names of the PLY file; the
    standard `gps_time` holds the stamp in seconds (the log's own clock, not GPS time).
    """
    import laspy

    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = np.full(3, SCALE_M)
    header.offsets = np.floor(cloud.points_m.min(axis=0)).astype(np.float64) if len(cloud) else np.zeros(3)
    extra = _extra(cloud)
    if extra:
        header.add_extra_dims(
            [laspy.ExtraBytesParams(name=name, type=values.dtype.str) for name, values in extra.items()]
        )
    las = laspy.LasData(header)
    las.xyz = cloud.points_m.astype(np.float64)
    if cloud.stamps_ns is not None:
        las.gps_time = cloud.stamps_ns / 1e9
    for name, values in extra.items():
        las[name] = values
    las.write(str(path))


def _extra(cloud: Cloud) -> dict[str, np.ndarray]:
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
