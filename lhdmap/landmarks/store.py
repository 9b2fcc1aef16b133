"""`landmarks.npz` of the map folder: the contract's arrays, and those of the fused walls beside them.

| array | |
| --- | --- |
| `points`, `offsets`, `poses_node`, `node`, `at_m`, `threshold`, `delta`, `radius`, `key` | as in `Landmarks` |
| `similarity_<node>` | of each tunnel |
| `surface_node` (n,), `surface_offsets` (n + 1,), `surface_points`, `surface_counts`, `surface_cell_m` | fused walls by node |
| `surface_height_dm` | of each cell, the floor's height in `map`, dm; not in older maps |
| `surface_quality` (n, 8) | `Quality`, in the order of its fields |
| `profile_node` (t,), `profile_offsets` (t + 1,), `profile_<field>` | `WallProfile` of each tunnel, one after the other |
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.landmarks.model import Landmarks, NodeSurface
from lhdmap.landmarks.profile import WallProfile
from lhdmap.landmarks.quality import Quality
from lhdmap.landmarks.surface import Cells

Arrays = Mapping[str, npt.NDArray[Any]]
_HEIGHTS_DM = np.iinfo(np.int16).min, np.iinfo(np.int16).max
_MATRIX = "similarity_"
_OF_LANDMARKS = ("poses_node", "node", "at_m", "threshold", "delta", "radius", "key")
_NEEDED = (
    *("points", "offsets", *_OF_LANDMARKS),
    *("surface_node", "surface_offsets", "surface_points", "surface_counts", "surface_cell_m", "surface_quality"),
    *("profile_node", "profile_offsets", *(f"profile_{name}" for name in WallProfile._fields)),
)


def write_landmarks(path: Path, landmarks: Landmarks) -> None:
    """Write `landmarks.npz`; the same landmarks give the same bytes."""
    arrays: dict[str, npt.NDArray[Any]] = {"points": landmarks.points_m, "offsets": landmarks.offsets}
    arrays |= {name: getattr(landmarks, name) for name in _OF_LANDMARKS}
    arrays |= {_MATRIX + node: matrix for node, matrix in landmarks.similarity.items()}
    arrays |= _surface_arrays(landmarks.surfaces)
    with path.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def _surface_arrays(surfaces: Mapping[str, NodeSurface]) -> dict[str, npt.NDArray[Any]]:
    cells = [surface.cells for surface in surfaces.values()]
    profiles = {node: surface.profile for node, surface in surfaces.items() if surface.profile is not None}
    empty = WallProfile(*(np.zeros((0, 2) if name == "line_m" else 0, np.float32) for name in WallProfile._fields))
    columns = zip(*(empty, *profiles.values()), strict=True)
    return {
        "surface_node": np.array(list(surfaces), dtype=np.str_),
        "surface_offsets": _offsets([len(one.counts) for one in cells]),
        "surface_points": np.concatenate([np.zeros((0, 2), np.float32), *(one.points_m for one in cells)]),
        "surface_counts": np.concatenate([np.zeros(0, np.uint16), *(one.counts for one in cells)]),
        "surface_height_dm": np.concatenate([np.zeros(0, np.int16), *map(_height_dm, cells)]),
        "surface_cell_m": np.array([one.cell_m for one in cells]),
        "surface_quality": np.array([one.quality for one in surfaces.values()]).reshape(-1, len(Quality._fields)),
        "profile_node": np.array(list(profiles), dtype=np.str_),
        "profile_offsets": _offsets([len(one.at_m) for one in profiles.values()]),
    } | {f"profile_{name}": np.concatenate(column) for name, column in zip(WallProfile._fields, columns, strict=True)}


def _height_dm(cells: Cells) -> npt.NDArray[np.int16]:
    heights = np.zeros(len(cells.counts)) if cells.heights_m is None else cells.heights_m
    return np.clip(np.round(10.0 * heights), *_HEIGHTS_DM).astype(np.int16)


def _offsets(lengths: list[int]) -> npt.NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)


def read_landmarks(path: Path) -> Landmarks:
    """Return the landmarks of a `landmarks.npz`.

    Raises:
        InputError: it is not there, is damaged, or lacks something.
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except FileNotFoundError as error:
        raise InputError(f"{path}: not there; build the map again with lhdmap build-map") from error
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: not a readable landmarks.npz ({error}); build the map again") from error
    missing = [name for name in _NEEDED if name not in arrays]
    if missing:
        raise InputError(f"{path}: no landmarks.npz of lhdmap: {', '.join(missing[:3])} missing; build the map again")
    _check(path, arrays)
    return Landmarks(
        points_m=arrays["points"],
        offsets=arrays["offsets"],
        **{name: arrays[name] for name in _OF_LANDMARKS},
        similarity={name.removeprefix(_MATRIX): matrix for name, matrix in arrays.items() if name.startswith(_MATRIX)},
        surfaces=_surfaces(arrays),
    )


def _check(path: Path, arrays: Arrays) -> None:
    """Refuse arrays whose lengths do not belong together."""
    count = len(arrays["node"])
    lengths = {name: len(arrays[name]) for name in _OF_LANDMARKS}
    wrong = [f"{name} has {length}" for name, length in lengths.items() if length != count]
    for offsets, values, rows in (
        ("offsets", "points", count),
        ("surface_offsets", "surface_points", len(arrays["surface_node"])),
        ("profile_offsets", "profile_at_m", len(arrays["profile_node"])),
    ):
        ends = arrays[offsets]
        if len(ends) != rows + 1 or (np.diff(ends) < 0).any() or ends[0] != 0 or ends[-1] != len(arrays[values]):
            wrong.append(f"{offsets} do not cut the {len(arrays[values])} rows of {values} into {rows}")
    if wrong:
        raise InputError(f"{path}: damaged landmarks of {count}: {'; '.join(wrong[:2])}; build the map again")


def _surfaces(arrays: Arrays) -> dict[str, NodeSurface]:
    profiles: dict[str, WallProfile] = {}
    cuts = arrays["profile_offsets"]
    for number, node in enumerate(arrays["profile_node"]):
        rows = slice(cuts[number], cuts[number + 1])
        profiles[str(node)] = WallProfile(*(arrays[f"profile_{name}"][rows] for name in WallProfile._fields))
    surfaces, cuts = {}, arrays["surface_offsets"]
    for number, node in enumerate(arrays["surface_node"]):
        rows = slice(cuts[number], cuts[number + 1])
        cell_m = float(arrays["surface_cell_m"][number])
        heights = arrays["surface_height_dm"][rows] * np.float32(0.1) if "surface_height_dm" in arrays else None
        cells = Cells(arrays["surface_points"][rows], arrays["surface_counts"][rows], cell_m, heights)
        quality = Quality(*arrays["surface_quality"][number].tolist())
        surfaces[str(node)] = NodeSurface(cells, quality, profiles.get(str(node)))
    return surfaces
