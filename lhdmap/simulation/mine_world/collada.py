"""Triangle meshes out of COLLADA files (DAE), which Open3D does not read: geometry, its place in the scene, units."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

import numpy as np

from lhdmap.errors import InputError
from lhdmap.messages import FloatArray
from lhdmap.simulation.drift import Mesh, Triangles

_FACES = ("triangles", "polylist", "polygons")


def read_dae(path: Path) -> Mesh:
    """Return the mesh of a COLLADA file, in metres by the file's unit, axes as in the file.

    Raises:
        InputError: the file cannot be read, or holds no faces.
    """
    try:
        root = ET.parse(path).getroot()  # noqa: S314  # a file that its owner names
    except (OSError, ET.ParseError) as error:
        raise InputError(f"{path}: not a readable COLLADA file ({error})") from error
    for element in root.iter():
        element.tag = re.sub(r"^\{.*\}", "", element.tag)
    unit = root.find("asset/unit")
    scale = float(unit.get("meter", "1")) if unit is not None else 1.0
    try:
        parts = [
            Mesh(_moved(vertices, T) * scale, triangles)
            for T, name in _instances(root)
            for vertices, triangles in _geometry(root, name)
        ]
    except (ValueError, IndexError, AttributeError, KeyError, RuntimeError) as error:
        raise InputError(f"{path}: damaged COLLADA file ({error})") from error
    if not parts:
        raise InputError(f"{path}: no faces were found in it; a mesh was wanted")
    offsets = np.cumsum([0, *(len(part.vertices_m) for part in parts[:-1])])
    triangles = [part.triangles + np.uint32(offset) for part, offset in zip(parts, offsets.tolist(), strict=True)]
    return Mesh(np.concatenate([part.vertices_m for part in parts]), np.concatenate(triangles))


def _instances(root: Element) -> Iterator[tuple[FloatArray, str]]:
    """Yield the pose (4, 4) and the geometry of each instance in the scene; without a scene each geometry as it is."""
    scenes = root.findall(".//visual_scene")
    if not scenes:
        yield from ((np.eye(4), geometry.get("id", "")) for geometry in root.iter("geometry"))
    for scene in scenes:
        for node in scene.findall("node"):
            yield from _of_node(node, np.eye(4))


def _of_node(node: Element, T_parent: FloatArray) -> Iterator[tuple[FloatArray, str]]:
    T = T_parent.copy()
    for element in node:
        values = np.array((element.text or "").split(), dtype=float) if element.tag in _MOVES else None
        if values is not None:
            T = T @ _MOVES[element.tag](values)
    for instance in node.findall("instance_geometry"):
        yield T, instance.get("url", "").lstrip("#")
    for child in node.findall("node"):
        yield from _of_node(child, T)


def _shifted(values: FloatArray) -> FloatArray:
    T = np.eye(4)
    T[:3, 3] = values
    return T


def _turned(values: FloatArray) -> FloatArray:
    axis, angle = values[:3] / np.linalg.norm(values[:3]), math.radians(values[3])
    K = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    T = np.eye(4)
    T[:3, :3] += math.sin(angle) * K + (1.0 - math.cos(angle)) * K @ K
    return T


_MOVES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "matrix": lambda values: values.reshape(4, 4),
    "translate": _shifted,
    "rotate": _turned,
    "scale": lambda values: np.diag([*values, 1.0]),
}


def _geometry(root: Element, name: str) -> Iterator[tuple[FloatArray, Triangles]]:
    """Yield vertices and triangles of each set of faces of a geometry."""
    for geometry in root.iter("geometry"):
        if geometry.get("id") != name:
            continue
        for mesh in geometry.findall("mesh"):
            for kind in _FACES:
                for faces in mesh.findall(kind):
                    yield _vertices(mesh, faces), _triangles(faces)


def _vertices(mesh: Element, faces: Element) -> FloatArray:
    wanted = (
        next(one for one in faces.findall("input") if one.get("semantic") == "VERTEX").get("source", "").lstrip("#")
    )
    vertices = next(one for one in mesh.findall("vertices") if one.get("id") == wanted)
    position = next(one for one in vertices.findall("input") if one.get("semantic") == "POSITION")
    source = next(one for one in mesh.findall("source") if one.get("id") == position.get("source", "").lstrip("#"))
    return np.array((source.find("float_array").text or "").split(), dtype=float).reshape(-1, 3)  # type: ignore[union-attr]


def _triangles(faces: Element) -> Triangles:
    """Return the triangles of a set of faces; polygons become fans."""
    inputs = faces.findall("input")
    stride = max(int(one.get("offset", "0")) for one in inputs) + 1
    offset = next(int(one.get("offset", "0")) for one in inputs if one.get("semantic") == "VERTEX")
    lists = [np.array((p.text or "").split(), dtype=np.int64)[offset::stride] for p in faces.findall("p")]
    counts = faces.find("vcount")
    if faces.tag == "triangles":
        return np.concatenate(lists).reshape(-1, 3).astype(np.uint32)
    if counts is not None:
        ends = np.cumsum(np.array((counts.text or "").split(), dtype=np.int64))
        lists = np.split(lists[0], ends[:-1])
    fans = [np.stack([np.full(len(one) - 2, one[0]), one[1:-1], one[2:]], axis=1) for one in lists if len(one) > 2]
    return np.concatenate(fans).astype(np.uint32)


def _moved(points: FloatArray, T: FloatArray) -> FloatArray:
    moved: FloatArray = points @ T[:3, :3].T + T[:3, 3]
    return moved
