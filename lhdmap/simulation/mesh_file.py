"""Meshes as binary PLY files, for comparing a cloud with the surface that it was measured on."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lhdmap.simulation.drift import Mesh


def write_ply(path: Path, pieces: Iterable[Mesh]) -> None:
    """Write the pieces as one binary little-endian PLY: x y z as float64, metres, in `map`.

    The pieces are taken one by one, so that a long drift needs no room for all of its vertices.

    Raises:
        OSError: the file cannot be written.
    """
    vertices, faces = 0, []
    with path.open("xb") as file:
        file.write(_header(0, 0))
        for piece in pieces:
            file.write(piece.vertices_m.astype("<f8").tobytes())
            faces.append(_faces(piece, first=vertices))
            vertices += len(piece.vertices_m)
        for part in faces:
            file.write(part.tobytes())
        file.seek(0)
        file.write(_header(vertices, sum(map(len, faces))))


def _header(vertices: int, faces: int) -> bytes:
    """Return the header; its length does not depend on the counts."""
    return (
        f"ply\nformat binary_little_endian 1.0\ncomment frame map, metres\nelement vertex {vertices:012d}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {faces:012d}\nproperty list uchar uint vertex_indices\nend_header\n"
    ).encode("ascii")


def _faces(piece: Mesh, *, first: int) -> npt.NDArray[np.void]:
    faces = np.empty(len(piece.triangles), dtype=[("count", "u1"), ("index", "<u4", 3)])
    faces["count"], faces["index"] = 3, piece.triangles + np.uint32(first)
    return faces
