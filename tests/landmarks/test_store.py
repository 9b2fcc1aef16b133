"""`landmarks.npz`: the contract's arrays, both ways, and what is wrong with a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.landmarks.build import landmarks_of
from lhdmap.landmarks.model import Landmarks
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.landmarks.store import read_landmarks, write_landmarks

from tests.landmarks.conftest import Taught

SETTINGS = LandmarkSettings()


@pytest.fixture(scope="module")
def mine(bent: Taught, rough: Taught) -> Landmarks:
    """Two tunnels and an intersection."""
    crossing = [scan._replace(node="x-1") for scan in rough.scans[:6]]
    second = [scan._replace(node="u") for scan in bent.scans[:40]]
    frames = {"t": rough.world.frame(), "x-1": rough.world.frame(), "u": bent.world.frame()}
    return landmarks_of([*second, *crossing, *rough.scans[:30]], frames, {"t", "u"}, SETTINGS)


def same(a: Landmarks, b: Landmarks) -> None:
    for name in ("points_m", "offsets", "poses_node", "node", "at_m", "threshold", "delta", "radius", "key"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        assert getattr(a, name).dtype == getattr(b, name).dtype
    assert list(a.similarity) == list(b.similarity)
    assert list(a.surfaces) == list(b.surfaces)
    for node in a.similarity:
        np.testing.assert_array_equal(a.similarity[node], b.similarity[node])
    for node, surface in a.surfaces.items():
        other = b.surfaces[node]
        np.testing.assert_array_equal(surface.cells.points_m, other.cells.points_m)
        np.testing.assert_array_equal(surface.cells.counts, other.cells.counts)
        assert surface.cells.cell_m == other.cells.cell_m
        np.testing.assert_array_equal(surface.quality, other.quality)
        assert (surface.profile is None) == (other.profile is None)
        if surface.profile is not None and other.profile is not None:
            for column, again in zip(surface.profile, other.profile, strict=True):
                np.testing.assert_array_equal(column, again)


def test_what_is_written_is_read(mine: Landmarks, tmp_path: Path) -> None:
    write_landmarks(tmp_path / "landmarks.npz", mine)
    same(mine, read_landmarks(tmp_path / "landmarks.npz"))


def test_the_same_landmarks_give_the_same_bytes(mine: Landmarks, tmp_path: Path) -> None:
    for name in ("a.npz", "b.npz"):
        write_landmarks(tmp_path / name, mine)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_numpy_alone_reads_the_contracts_arrays(mine: Landmarks, tmp_path: Path) -> None:
    write_landmarks(tmp_path / "landmarks.npz", mine)
    stored = np.load(tmp_path / "landmarks.npz")
    count = len(mine)
    assert stored["points"].dtype == np.float32
    assert stored["points"].shape == (stored["offsets"][-1], 2)
    assert stored["offsets"].shape == (count + 1,)
    assert stored["poses_node"].shape == (count, 3)
    assert stored["key"].dtype == np.bool_
    for name in ("node", "at_m", "threshold", "delta", "radius", "key"):
        assert stored[name].shape == (count,)
    for node in ("t", "u"):
        n = int((stored["node"] == node).sum())
        assert stored[f"similarity_{node}"].shape == (n, n)
    assert "similarity_x-1" not in stored.files


def test_an_intersection_has_one_landmark_which_is_its_key(mine: Landmarks) -> None:
    (k,) = mine.of("x-1")
    assert mine.key[k]
    assert np.isnan(mine.threshold[k])
    assert len(mine.cloud(k)) > 100
    assert mine.surfaces["x-1"].profile is None


def test_nothing_is_stored_and_read_too(tmp_path: Path) -> None:
    nothing = landmarks_of([], {}, set(), SETTINGS)
    write_landmarks(tmp_path / "landmarks.npz", nothing)
    same(nothing, read_landmarks(tmp_path / "landmarks.npz"))


def test_what_is_no_file_of_landmarks_is_told(mine: Landmarks, tmp_path: Path) -> None:
    file = tmp_path / "landmarks.npz"
    with pytest.raises(InputError, match="not there"):
        read_landmarks(file)
    file.write_bytes(b"no archive")
    with pytest.raises(InputError, match="not a readable"):
        read_landmarks(file)
    np.savez(file.open("wb"), points=np.zeros((3, 2)))
    with pytest.raises(InputError, match="offsets"):
        read_landmarks(file)
    write_landmarks(file, mine)
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="not a readable"):
        read_landmarks(file)


@pytest.mark.parametrize("name", ["threshold", "offsets", "surface_offsets", "profile_at_m"])
def test_lengths_that_do_not_belong_together_are_told(mine: Landmarks, tmp_path: Path, name: str) -> None:
    file = tmp_path / "landmarks.npz"
    write_landmarks(file, mine)
    arrays = dict(np.load(file))
    arrays[name] = arrays[name][:-1]
    with file.open("wb") as out:
        np.savez(out, allow_pickle=False, **arrays)
    with pytest.raises(InputError, match="damaged"):
        read_landmarks(file)
