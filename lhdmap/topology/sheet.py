"""Sheets: the free space of a mine's levels as grids, and the file `free_space.npz` of the map folder that holds them."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.messages import FloatArray

UNKNOWN, FREE, OCCUPIED = 0, 1, 2
Cells = npt.NDArray[np.uint8]


class Sheet(NamedTuple):
    """One level's grid: `cells` (rows, columns) of UNKNOWN, FREE, OCCUPIED; row 0 has the lowest y, column 0 the lowest x.

    `origin_m` (2,): corner of cell [0, 0] in `map`; `height_m`: of the floor in the middle, `heights_m` from lowest to highest.
    """

    cells: Cells
    origin_m: FloatArray
    cell_m: float
    height_m: float = 0.0
    heights_m: tuple[float, float] = (0.0, 0.0)

    def at(self, points_m: FloatArray) -> npt.NDArray[np.int64]:
        """Return rows and columns (N, 2) of the cells that points (N, 2 or more) are in; they may lie outside."""
        columns_rows = np.floor((points_m[:, :2] - self.origin_m) / self.cell_m).astype(np.int64)
        return columns_rows[:, ::-1]

    def middles_m(self, rows_columns: npt.NDArray[np.int64]) -> FloatArray:
        """Return the middles (N, 2) of cells, given as rows and columns (N, 2), in `map`."""
        middles: FloatArray = self.origin_m + (rows_columns[:, ::-1] + 0.5) * self.cell_m
        return middles


def write_sheets(path: Path, sheets: Sequence[Sheet]) -> Path:
    """Write the sheets; a cell takes a few bits."""
    arrays: dict[str, npt.NDArray[np.generic]] = {
        "cell_m": np.array([sheet.cell_m for sheet in sheets]),
        "origin_m": np.array([sheet.origin_m for sheet in sheets]).reshape(-1, 2),
        "height_m": np.array([sheet.height_m for sheet in sheets]),
        "heights_m": np.array([sheet.heights_m for sheet in sheets]).reshape(-1, 2),
    }
    arrays |= {f"cells_{index}": sheet.cells for index, sheet in enumerate(sheets)}
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]  # its stub takes the names for options
    return path


def read_sheets(path: Path) -> list[Sheet]:
    """Return the sheets of a file.

    Raises:
        InputError: it is missing, damaged, or no such file.
    """
    try:
        with np.load(path, allow_pickle=False) as table:
            return [
                Sheet(
                    table[f"cells_{index}"],
                    table["origin_m"][index],
                    float(cell_m),
                    float(table["height_m"][index]),
                    (float(table["heights_m"][index, 0]), float(table["heights_m"][index, 1])),
                )
                for index, cell_m in enumerate(table["cell_m"])
            ]
    except (OSError, ValueError, KeyError, EOFError, BadZipFile, zlib.error) as error:
        raise InputError(f"{path}: not the free space of a map ({error}); build the map again") from error
