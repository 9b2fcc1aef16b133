"""`views.npz` of the map folder: what the scanners saw along the drive, so that another drive can be added without the logs.

Hits are kept as millimetres in 16 bits (to 32 m; farther ones are not looked at); poses are those of the map's trajectory at the
views' times.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from lhdmap.errors import InputError
from lhdmap.topology.views import Fan, View

_MM = 1000.0
_FARTHEST_M = 32.0


def write_views(path: Path, views: Sequence[View]) -> Path:
    """Write views; about 2 kB each."""
    fans = [fan for view in views for fan in view.fans]
    hits = [_near(fan) for fan in fans]
    packed = np.concatenate([np.zeros((0, 3)), *hits])
    with path.open("wb") as file:
        np.savez_compressed(
            file,
            time_ns=np.array([view.time_ns for view in views], dtype=np.int64),
            travelled_m=np.array([view.travelled_m for view in views]),
            fans=np.array([len(view.fans) for view in views], dtype=np.int64),
            origin_m=np.array([fan.origin_m for fan in fans]).reshape(-1, 2),
            hits=np.array([len(part) for part in hits], dtype=np.int64),
            points_mm=np.round(_MM * packed).astype(np.int16),
        )
    return path


def read_views(path: Path) -> list[View]:
    """Return the views of a map.

    Raises:
        InputError: the file is missing, damaged, or of another kind.
    """
    try:
        with np.load(path, allow_pickle=False) as table:
            points = table["points_mm"].astype(np.float32) / np.float32(_MM)
            ends = np.concatenate([[0], np.cumsum(table["hits"])]).tolist()
            parts = [points[a:b] for a, b in pairwise(ends)]
            fans = [Fan(origin, hits) for origin, hits in zip(table["origin_m"], parts, strict=True)]
            first = np.concatenate([[0], np.cumsum(table["fans"])]).tolist()
            rows = zip(table["time_ns"].tolist(), table["travelled_m"].tolist(), strict=True)
            return [
                View(int(time_ns), float(travelled_m), tuple(fans[first[k] : first[k + 1]]))
                for k, (time_ns, travelled_m) in enumerate(rows)
            ]
    except (OSError, ValueError, KeyError, EOFError, BadZipFile, zlib.error) as error:
        raise InputError(f"{path}: not the views of a map ({error}); build the map again") from error


def _near(fan: Fan) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    hits = fan.hits_m.astype(float)
    return hits[(np.abs(hits) < _FARTHEST_M).all(axis=1)]
