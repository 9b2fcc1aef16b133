"""Meshes as binary PLY files, for comparing a cloud with the surface that it was measured on."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lhdmap.simulation.drift import Mesh


def write_ply(path: Path, mesh: Mesh) -> None:
    """Write a triangle mesh as binary little-endian PLY: x y z as float64, metres."""
    header = (
        f"ply\nformat binary_little_endian 1.0\ncomment frame map, metres\nelement vertex {len(mesh.vertices_m)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(mesh.triangles)}\nproperty list uchar uint vertex_indices\nend_header\n"
    )
    faces = np.empty(len(mesh.triangles), dtype=[("count", "u1"), ("index", "<u4", 3)])
    faces["count"], faces["index"] = 3, mesh.triangles
    with path.open("wb") as file:
        file.write(header.encode("ascii"))
        file.write(mesh.vertices_m.astype("<f8").tobytes())
        file.write(faces.tobytes())
