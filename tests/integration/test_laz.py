"""LAS and LAZ: what is written comes back, files of other writers, grids to the millimetre, damage."""

from __future__ import annotations

from pathlib import Path

import laspy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lhdmap.errors import InputError
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.cloud_io import read_cloud, write_cloud

from tests.integration.test_cloud_io import known, outcome, some_cloud

UTM_M = np.array([412_345.0, 6_743_210.0, 312.0])


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize("n", [0, 1, 50])
def test_everything_comes_back(suffix: str, n: int, tmp_path: Path) -> None:
    cloud = some_cloud(n)
    write_cloud(tmp_path / f"cloud{suffix}", cloud)
    found = read_cloud(tmp_path / f"cloud{suffix}")
    assert found.points_m.dtype == np.float32
    assert len(found) == n
    assert np.abs(found.points_m - cloud.points_m).max(initial=0.0) <= 0.00006
    for name in () if n == 0 else ("normals", "curvature", "stamps_ns", "hits"):
        assert np.array_equal(known(getattr(found, name)), getattr(cloud, name))


def of_another_writer(path: Path, points: np.ndarray, kind: int, version: str) -> None:
    header = laspy.LasHeader(point_format=kind, version=version)
    header.offsets, header.scales = UTM_M, np.full(3, 0.001)
    las = laspy.LasData(header)
    las.xyz = points
    las.write(str(path))


@pytest.mark.parametrize("suffix", [".las", ".laz", ".LAZ"])
@pytest.mark.parametrize(("kind", "version"), [(0, "1.2"), (3, "1.2"), (6, "1.4"), (7, "1.4")])
def test_coordinates_of_a_grid_keep_their_millimetres(suffix: str, kind: int, version: str, tmp_path: Path) -> None:
    points = np.round(np.random.default_rng(0).uniform(-40.0, 40.0, (2000, 3)), 3) + UTM_M
    of_another_writer(tmp_path / f"utm{suffix}", points, kind, version)
    found = read_cloud(tmp_path / f"utm{suffix}")
    assert np.abs(found.exact_m() - points).max() < 5e-5
    assert np.abs(found.points_m).max() < 500.0  # about their middle where they are large, and else as they are
    write_cloud(tmp_path / "again.laz", found)
    assert np.abs(read_cloud(tmp_path / "again.laz").exact_m() - points).max() < 1e-4
    write_cloud(tmp_path / "again.ply", found)
    assert np.abs(read_cloud(tmp_path / "again.ply").exact_m() - points).max() < 5e-5


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
def test_32_bit_floats_of_a_grid_are_refused_and_near_ones_stay_as_they_are(suffix: str, tmp_path: Path) -> None:
    write_cloud(tmp_path / f"far{suffix}", GridCloud((some_cloud().points_m + UTM_M).astype(np.float32)))
    with pytest.raises(InputError, match="32-bit floats keep no millimetres"):
        read_cloud(tmp_path / f"far{suffix}")
    near = GridCloud((some_cloud().points_m + np.float32(50_000.0)).astype(np.float32))
    write_cloud(tmp_path / f"near{suffix}", near)
    assert np.array_equal(read_cloud(tmp_path / f"near{suffix}").points_m, near.points_m)


def test_what_is_no_laz_file_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.laz").write_bytes(b"ply\n")
    with pytest.raises(InputError, match=r"a\.laz: no LAS or LAZ file"):
        read_cloud(tmp_path / "a.laz")


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@given(data=st.data())
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damage_ends_in_a_clear_error(suffix: str, tmp_path: Path, data: st.DataObject) -> None:
    path = tmp_path / f"own{suffix}"
    write_cloud(path, some_cloud(20))
    content = bytearray(path.read_bytes())
    content = content[: data.draw(st.integers(0, len(content)))]
    for _ in range(data.draw(st.integers(0, 4)) if content else 0):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(content)
    assert outcome(path) in ("cloud", "clear error")


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize("at", [103, 246])
def test_records_that_are_only_promised_are_refused_at_once(suffix: str, at: int, tmp_path: Path) -> None:
    """Billions of them were read one by one, until the memory was full."""
    path = tmp_path / f"own{suffix}"
    write_cloud(path, some_cloud(20))
    content = bytearray(path.read_bytes())
    content[at] = 0xAB  # the highest byte of a count
    path.write_bytes(content)
    with pytest.raises(InputError, match="the header promises"):
        read_cloud(path)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_a_file_that_is_cut_off_is_refused(suffix: str, share: float, tmp_path: Path) -> None:
    path = tmp_path / f"cut{suffix}"
    write_cloud(path, some_cloud(3000))
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(InputError, match=r"cut\.la[sz]: .*(cut off|damaged)"):
        read_cloud(path)
