"""PLY files as others write them: line ends, comments, elements and lists beside the points; Open3D reads the same."""

from __future__ import annotations

import struct
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.errors import InputError
from lhdmap.integration.cloud_io import read_cloud
from lhdmap.messages import Float32Array

POINTS = np.random.default_rng(4).uniform(-20.0, 20.0, (30, 3)).astype(np.float32)
POINTS[0] = np.frombuffer(b"\n\r\n\r" * 3, dtype="<f4")  # data that begin with line ends
XYZ = "property float x\nproperty float y\nproperty float z\n"
FACES = "element face 2\nproperty list uchar int vertex_indices\n"
FACE_DATA = struct.pack("<BiiiBiiii", 3, 0, 1, 2, 4, 0, 1, 2, 3)


def write(path: Path, head: str, body: bytes, ends: str = "\n", encoding: str = "binary_little_endian") -> Path:
    text = f"ply\nformat {encoding} 1.0\n{head}end_header\n"
    path.write_bytes(text.replace("\n", ends).encode() + body)
    return path


def vertices(extra: str = "") -> str:
    return f"element vertex {len(POINTS)}\n{XYZ}{extra}"


def as_text(points: Float32Array, ends: str = "\n") -> bytes:
    return ends.join(" ".join(repr(float(value)) for value in row) for row in points).encode() + ends.encode()


@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_line_ends(ends: str, encoding: str, tmp_path: Path) -> None:
    bodies = {
        "ascii": as_text(POINTS, ends) + f"3 0 1 2{ends}4 0 1 2 3{ends}".encode(),
        "binary_little_endian": POINTS.tobytes() + FACE_DATA,
        "binary_big_endian": POINTS.astype(">f4").tobytes(),
    }
    path = write(tmp_path / "a.ply", vertices() + FACES, bodies[encoding], ends, encoding)
    assert np.array_equal(read_cloud(path).points_m, POINTS)


@pytest.mark.parametrize(
    "comment",
    [
        "comment the word end_header ends this header",
        "comment end_header",
        "obj_info end_header",
        "comment element vertex 5",
        "comment",
        "obj_info num_cols 512",
    ],
)
def test_comments_are_no_header_lines(comment: str, tmp_path: Path) -> None:
    path = write(tmp_path / "a.ply", f"{comment}\n{vertices()}{comment}\n", POINTS.tobytes())
    assert np.array_equal(read_cloud(path).points_m, POINTS)


CAMERA = "element camera 2\nproperty float vx\nproperty double vy\nproperty uchar vz\n"


def test_elements_before_the_points_are_passed_over(tmp_path: Path) -> None:
    rows = struct.pack("<fdB", 1.0, 2.0, 3) * 2
    assert np.array_equal(
        read_cloud(write(tmp_path / "a.ply", CAMERA + vertices(), rows + POINTS.tobytes())).points_m, POINTS
    )
    triangles = struct.pack("<Biii", 3, 0, 1, 2) * 2
    path = write(tmp_path / "b.ply", CAMERA + FACES + vertices(), rows + triangles + POINTS.tobytes())
    assert np.array_equal(read_cloud(path).points_m, POINTS)
    text = b"1 2 3\n4 5 6\n3 0 1 2\n3 0 1 2\n" + as_text(POINTS)
    path = write(tmp_path / "c.ply", CAMERA + FACES + vertices(), text, encoding="ascii")
    assert np.array_equal(read_cloud(path).points_m, POINTS)
    path = write(tmp_path / "d.ply", CAMERA.replace("camera 2", "camera 0") + vertices(), POINTS.tobytes())
    assert np.array_equal(read_cloud(path).points_m, POINTS)


@pytest.mark.parametrize("before", ["", CAMERA.replace("camera 2", "camera 0")])
@pytest.mark.parametrize("length", [0, 3])
def test_lists_of_one_length_beside_the_points(length: int, before: str, tmp_path: Path) -> None:
    """Not checked against Open3D, which crashes on them."""
    head = before + vertices("property list uint float64 descriptor\nproperty uchar red\n")
    rows = b"".join(point.tobytes() + struct.pack(f"<I{length}dB", length, *[9.0] * length, 200) for point in POINTS)
    assert np.array_equal(read_cloud(write(tmp_path / "a.ply", head, rows)).points_m, POINTS)
    text = b"".join(as_text(POINTS[k : k + 1], f" {length}{' 9.0' * length} 200\n") for k in range(len(POINTS)))
    assert np.array_equal(read_cloud(write(tmp_path / "b.ply", head, text, encoding="ascii")).points_m, POINTS)


def test_lists_of_different_lengths_are_refused(tmp_path: Path) -> None:
    head = vertices("property list uchar int seen_by\n")
    rows = b"".join(point.tobytes() + struct.pack("<Bi", 1, 7) for point in POINTS[:-1])
    path = write(tmp_path / "a.ply", head, rows + POINTS[-1].tobytes() + struct.pack("<Bii", 2, 7, 8))
    with pytest.raises(InputError, match=r"a\.ply: the list 'seen_by' of its element 'vertex' has not the same length"):
        read_cloud(path)
    path = write(tmp_path / "b.ply", FACES + vertices(), FACE_DATA + POINTS.tobytes())
    with pytest.raises(InputError, match=r"b\.ply: the list 'vertex_indices' of its element 'face'"):
        read_cloud(path)


@pytest.mark.parametrize("names", ["X Y Z NX NY NZ", "x y z nx ny nz", "X y Z Nx nY nz"])
def test_names_in_either_case(names: str, tmp_path: Path) -> None:
    head = f"element Vertex {len(POINTS)}\n" + "".join(f"property Float {name}\n" for name in names.split())
    found = read_cloud(write(tmp_path / "a.ply", head, np.column_stack([POINTS, -POINTS]).tobytes()))
    assert np.array_equal(found.points_m, POINTS)
    assert found.normals is not None
    assert np.array_equal(found.normals, -POINTS)


@pytest.mark.parametrize("ends", ["\n", "\r\n"])
@pytest.mark.parametrize("before", ["", "comment end_header\n", CAMERA])
@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
def test_open3d_reads_the_same(ends: str, before: str, encoding: str, tmp_path: Path) -> None:
    import open3d as o3d

    points = POINTS[1:]
    head = f"{before}element vertex {len(points)}\n{XYZ}{FACES}"
    camera = before == CAMERA
    if encoding == "ascii":
        body = (b"1 2 3\n4 5 6\n" if camera else b"") + as_text(points) + b"3 0 1 2\n4 0 1 2 3\n"
    else:
        body = (struct.pack("<fdB", 1.0, 2.0, 3) * 2 if camera else b"") + points.tobytes() + FACE_DATA
    path = write(tmp_path / "a.ply", head, body, ends, encoding)
    theirs = np.asarray(o3d.io.read_point_cloud(path).points)
    assert read_cloud(path).points_m == pytest.approx(theirs.astype(np.float32), abs=1e-6)


@given(st.binary(min_size=24, max_size=24), st.sampled_from(["\n", "\r\n", "\r"]))
def test_any_bytes_may_follow_the_header(body: bytes, ends: str) -> None:
    head = "element vertex 8\nproperty uchar x\nproperty uchar y\nproperty uchar z\n"
    with tempfile.TemporaryDirectory() as folder:
        found = read_cloud(write(Path(folder) / "a.ply", head, body, ends)).points_m
    assert np.array_equal(found, np.frombuffer(body, dtype=np.uint8).reshape(8, 3).astype(np.float32))
