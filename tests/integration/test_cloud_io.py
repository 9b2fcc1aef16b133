"""Cloud files: exact round trips, other readers, real files, and damage of every kind."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lhdmap.errors import InputError, LhdmapError, UsageError
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.cloud_io import read_cloud, write_cloud
from lhdmap.integration.pcd import lzf_decompress

Scalar = TypeVar("Scalar", bound=np.generic)
FIRST_NS = 1_757_580_000_123_456_789


def some_cloud(n: int = 50) -> GridCloud:
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return GridCloud(
        points_m=rng.uniform(-30, 30, (n, 3)).astype(np.float32),
        normals=normals.astype(np.float32),
        curvature=rng.uniform(0, 0.33, n).astype(np.float32),
        stamps_ns=FIRST_NS + np.arange(n) * 20_000_001,
        hits=rng.integers(1, 900, n).astype(np.uint32),
    )


def known(array: npt.NDArray[Scalar] | None) -> npt.NDArray[Scalar]:
    """The array, which this test knows to be there."""
    assert array is not None
    return array


def assert_same(a: GridCloud, b: GridCloud) -> None:
    for name in ("points_m", "normals", "curvature", "stamps_ns", "hits"):
        one, other = getattr(a, name), getattr(b, name)
        assert (one is None) == (other is None), name
        assert one is None or (one.dtype == other.dtype and np.array_equal(one, other)), name


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
@pytest.mark.parametrize("n", [0, 1, 50])
def test_everything_comes_back_to_the_last_bit(tmp_path: Path, suffix: str, n: int) -> None:
    path = tmp_path / f"cloud{suffix}"
    write_cloud(path, some_cloud(n))
    assert_same(read_cloud(path), some_cloud(n))


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".las", ".laz"])
def test_a_cloud_of_points_alone_is_written_too(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"cloud{suffix}"
    bare = GridCloud(some_cloud().points_m)
    write_cloud(path, bare)
    if suffix in (".ply", ".pcd"):
        assert_same(read_cloud(path), bare)
    assert path.stat().st_size > 0


def test_the_ply_header_and_bytes_are_those_of_the_contract(tmp_path: Path) -> None:
    """A parser of its own, from the words of the PLY format only."""
    cloud, path = some_cloud(), tmp_path / "cloud.ply"
    write_cloud(path, cloud)
    head, _, body = path.read_bytes().partition(b"end_header\n")
    lines = [line.split() for line in head.decode("ascii").splitlines()]
    assert lines[0] == ["ply"]
    assert lines[1] == ["format", "binary_little_endian", "1.0"]
    assert ["element", "vertex", "50"] in lines
    properties = [(line[2], line[1]) for line in lines if line[0] == "property"]
    wanted = ("x", "y", "z", "nx", "ny", "nz", "curvature")
    assert [(name, kind) for name, kind in properties[:7]] == [(name, "float") for name in wanted]
    assert properties[7] == ("stamp_ns", "double")
    sizes = {"float": "<f4", "double": "<f8", "int": "<i4"}
    rows = np.frombuffer(body, dtype=[(name, sizes[kind]) for name, kind in properties])
    assert len(rows) == 50
    assert np.array_equal(rows["y"], cloud.points_m[:, 1])
    assert np.abs(rows["stamp_ns"].astype(np.int64) - known(cloud.stamps_ns)).max() <= 128
    assert np.array_equal(rows["stamp_ns"].astype(np.int64) + rows["stamp_rest_ns"], known(cloud.stamps_ns))


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
def test_open3d_reads_points_normals_and_attributes(
    tmp_path: Path, suffix: str, capfd: pytest.CaptureFixture[str]
) -> None:
    import open3d as o3d

    cloud, path = some_cloud(), tmp_path / f"cloud{suffix}"
    write_cloud(path, cloud)
    legacy = o3d.io.read_point_cloud(path)
    assert np.array_equal(np.asarray(legacy.points).astype(np.float32), cloud.points_m)
    assert np.array_equal(np.asarray(legacy.normals).astype(np.float32), known(cloud.normals))
    tensor = o3d.t.io.read_point_cloud(path).point
    assert np.array_equal(tensor["curvature"].numpy().ravel(), known(cloud.curvature))
    stamps = tensor["stamp_ns"].numpy().ravel().astype(np.int64)
    assert np.abs(stamps - known(cloud.stamps_ns)).max() <= 128
    out, err = capfd.readouterr()
    assert "WARNING" not in out + err


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_laspy_reads_points_stamps_and_extra_dimensions(tmp_path: Path, suffix: str) -> None:
    import laspy

    cloud, path = some_cloud(), tmp_path / f"cloud{suffix}"
    write_cloud(path, cloud)
    las = laspy.read(path)
    assert np.abs(np.asarray(las.xyz) - cloud.points_m).max() <= 0.00006
    assert np.array_equal(las["stamp_ns"], known(cloud.stamps_ns))
    assert np.array_equal(las["nz"], known(cloud.normals)[:, 2])
    assert np.array_equal(las["hits"], known(cloud.hits))
    assert las.header.point_format.id == 6


@pytest.mark.parametrize("encoding", ["ascii", "binary", "binary_compressed"])
def test_pcd_of_another_writer_is_read(tmp_path: Path, encoding: str) -> None:
    import open3d as o3d

    cloud, path = some_cloud(3000), tmp_path / "cloud.pcd"
    source = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(cloud.points_m.astype(float)))
    source.normals = o3d.utility.Vector3dVector(np.tile([0.0, 0.0, 1.0], (3000, 1)))  # something that compresses
    o3d.io.write_point_cloud(path, source, write_ascii=encoding == "ascii", compressed=encoding == "binary_compressed")
    assert f"DATA {encoding}\n".encode() in path.read_bytes()
    found = read_cloud(path)
    assert found.points_m == pytest.approx(cloud.points_m, abs=1e-5)
    assert (known(found.normals)[:, 2] == 1.0).all()


@pytest.mark.parametrize("ascii_text", [True, False])
def test_ply_of_another_writer_is_read(tmp_path: Path, ascii_text: bool) -> None:
    import open3d as o3d

    mesh, path = o3d.geometry.TriangleMesh.create_sphere(2.0), tmp_path / "mesh.ply"
    o3d.io.write_triangle_mesh(path, mesh, write_ascii=ascii_text)
    assert read_cloud(path).points_m == pytest.approx(np.asarray(mesh.vertices).astype(np.float32), abs=1e-5)


def test_big_endian_ply_is_read(tmp_path: Path) -> None:
    points = some_cloud().points_m
    path = tmp_path / "big.PLY"
    head = "ply\nformat binary_big_endian 1.0\ncomment x\nelement vertex 50\nproperty uchar red\n"
    head += "property double x\nproperty double y\nproperty double z\nend_header\n"
    rows = np.zeros(50, dtype=[("red", "u1"), ("x", ">f8"), ("y", ">f8"), ("z", ">f8")])
    for axis, name in enumerate("xyz"):
        rows[name] = points[:, axis]
    path.write_bytes(head.encode() + rows.tobytes())
    assert np.array_equal(read_cloud(path).points_m, points)


def test_points_that_are_not_finite_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "holes.pcd"
    text = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 3\nHEIGHT 1\nPOINTS 3\nDATA ascii\n"
    path.write_text(text + "1 2 3\nnan nan nan\n4 5 6\n")
    assert read_cloud(path).points_m.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]


PLY = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
PCD = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS 2\nDATA ascii\n"


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.ply", "", "no PLY file"),
        ("a.ply", "solid x\n", "no PLY file"),
        ("a.ply", PLY[:60], "no end"),
        ("a.ply", PLY + "1 2 3 4 5\n", "1 of 2 points"),
        ("a.ply", PLY + "1 2 3 4 5 x\n", "'z' holds"),
        ("a.ply", PLY.replace("ascii", "ternary"), "'ternary'"),
        ("a.ply", PLY.replace("vertex 2", "vertex 999999999999"), "promises"),
        ("a.ply", PLY.replace("vertex 2", "vertex two"), "number of points"),
        ("a.ply", PLY.replace("float x", "float16 x"), "float16"),
        ("a.ply", PLY.replace("float x", "list uchar int x"), "list"),
        ("a.ply", PLY.replace("float z", "float x"), "twice"),
        ("a.ply", PLY.replace("property float z\n", "") + "1 2 3 4\n", "x, y and z"),
        ("a.ply", PLY.replace("vertex", "face"), "not 'vertex'"),
        ("a.ply", PLY + "6000000 1 1 6000001 1 1\n", "local origin"),
        ("a.pcd", "", "no PCD file"),
        ("a.pcd", PCD + "1 2 3 4\n", "1 of 2 points"),
        ("a.pcd", PCD.replace("ascii", "zip"), "'zip'"),
        ("a.pcd", PCD.replace("SIZE 4 4 4", "SIZE 4 4"), "damaged"),
        ("a.pcd", PCD.replace("TYPE F", "TYPE Q"), "damaged"),
        ("a.pcd", PCD.replace("POINTS 2", "POINTS -2"), "promises"),
        ("a.pcd", PCD.replace("POINTS 2\n", ""), "damaged"),
        ("a.pcd", PCD.replace("ascii", "binary_compressed"), "cut off"),
        ("a.pcd", PCD.replace("ascii", "binary_compressed") + "12345", "cut off"),
        ("a.xyz", "1 2 3\n", ".ply, .pcd"),
    ],
)
def test_errors_name_the_file_and_what_is_wrong(tmp_path: Path, name: str, text: str, said: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_cloud(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_missing_file_and_a_wrong_suffix_are_errors(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        read_cloud(tmp_path / "absent.ply")
    with pytest.raises(UsageError, match=r"\.laz"):
        write_cloud(tmp_path / "cloud.obj", some_cloud())


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """One sound file of each kind."""
    import open3d as o3d

    folder = tmp_path_factory.mktemp("clouds")
    for suffix in (".ply", ".pcd"):
        write_cloud(folder / f"own{suffix}", some_cloud(20))
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(some_cloud(20).points_m.astype(float)))
    o3d.io.write_point_cloud(folder / "packed.pcd", cloud, compressed=True)
    o3d.io.write_point_cloud(folder / "text.pcd", cloud, write_ascii=True)
    o3d.io.write_point_cloud(folder / "text.ply", cloud, write_ascii=True)
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("name", ["own.ply", "own.pcd", "packed.pcd", "text.pcd", "text.ply"])
@given(data=st.data())
@settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damage_never_ends_in_anything_but_a_clear_error(
    tmp_path: Path, originals: dict[str, bytes], name: str, data: st.DataObject
) -> None:
    content = bytearray(originals[name][: data.draw(st.integers(0, len(originals[name])))])
    for _ in range(data.draw(st.integers(0, 4)) if content else 0):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path / name
    path.write_bytes(content)
    assert outcome(path) in ("cloud", "clear error")


def outcome(path: Path) -> str:
    try:
        points = len(read_cloud(path))
    except LhdmapError as error:
        return "clear error" if str(path) in str(error) else "vague error"
    return "cloud" if points <= 5000 else "invented points"


@given(packed=st.binary(max_size=80), room=st.integers(0, 400))
@settings(max_examples=200, deadline=None)
def test_lzf_stays_within_its_bounds(packed: bytes, room: int) -> None:
    out = np.full(room + 8, 0xAB, dtype=np.uint8)
    written = lzf_decompress(np.frombuffer(packed, dtype=np.uint8), out[:room])
    assert -1 <= written <= room
    assert (out[room:] == 0xAB).all()


@pytest.mark.shared
def test_real_clouds_are_read_as_open3d_reads_them(shared_data: Path) -> None:
    import open3d as o3d

    names = ("10_piles/Bin_8A.pcd", "10_piles/box_empty.pcd", "11_rocks_otira/Otira_1cm_grains.ply")
    for name in names:
        path = shared_data / name
        theirs = np.asarray(o3d.io.read_point_cloud(path).points)
        assert np.abs(read_cloud(path).points_m - theirs[np.isfinite(theirs).all(axis=1)]).max() < 1e-6
