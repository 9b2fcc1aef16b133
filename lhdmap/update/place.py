"""Where a drive lies in a map, from nothing: its walls are laid over the map's in all headings and shifts.

For each heading one correlation (FFT) of the map's field (walls count for, free room against) with the drive's walls tells the
score of all shifts. What lies best by this alone need not be right (a bend is like another bend, and a tunnel that the map does
not have counts for nothing), so some places are returned; scans tell between them (`lhdmap.update.fit`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from scipy.fft import irfft2, next_fast_len, rfft2

from lhdmap.messages import FloatArray
from lhdmap.topology.sheet import FREE, OCCUPIED, Sheet

_CELL_M = 0.4
_STEP_RAD = math.radians(2.0)
_FREE_COSTS = 0.6
_FEWEST_WALLS = 50
_APART_M, _APART_RAD = 5.0, math.radians(20.0)
_LEAST_SCORE = 0.25  # of the drive's walls: less is chance
_MOST_PLACES, _LEAST_OF_BEST = 6, 0.4


class Placed(NamedTuple):
    """A place of a drive in a map: `pose_map_drive` (3,) and the number of the map's sheet.

    `score`: share of the drive's walls that are the map's, less what contradicts.
    """

    pose_map_drive: FloatArray
    score: float
    sheet: int


def placings(sheets: list[Sheet], drive: Sheet, start: FloatArray | None = None) -> list[Placed]:
    """Return where a drive's sheet may lie in a map's sheets, best first, each at a place of its own; none where nowhere.

    `start` (3,): about where its first pose is, where somebody knows; then only places within 10 m and 20° are looked at.
    """
    walls = drive.middles_m(np.argwhere(drive.cells == OCCUPIED))
    if len(walls) < _FEWEST_WALLS:
        return []
    centre = walls.mean(axis=0)
    found = [
        Placed(one.pose_map_drive, one.score, number)
        for number, sheet in enumerate(sheets)
        for one in WallSearch(sheet).scored(walls, _headings(start), 3)
        if start is None or _is_near(one.pose_map_drive, start)
    ]
    kept: list[Placed] = []
    for one in sorted(found, key=lambda one: -one.score):
        if one.score < max(_LEAST_SCORE, _LEAST_OF_BEST * kept[0].score if kept else 0.0) or len(kept) == _MOST_PLACES:
            break
        if not any(
            one.sheet == better.sheet and _same(one.pose_map_drive, better.pose_map_drive, centre) for better in kept
        ):
            kept.append(one)
    return kept


def _field(sheet: Sheet) -> npt.NDArray[np.float32]:
    """Return the map's field in coarse cells: 1 at walls, negative in free room away from them."""
    factor = _CELL_M / sheet.cell_m
    size = (int(sheet.cells.shape[1] / factor) + 1, int(sheet.cells.shape[0] / factor) + 1)
    walls = _shrunk(sheet.cells == OCCUPIED, size, factor)
    free = _shrunk(sheet.cells == FREE, size, factor)
    near = cv2.dilate(walls, np.ones((3, 3), np.uint8))
    field = near.astype(np.float32)
    field[(near == 0) & (free > 0)] = -_FREE_COSTS
    return field


def _shrunk(cells: npt.NDArray[np.bool_], size: tuple[int, int], factor: float) -> npt.NDArray[np.uint8]:
    rows, columns = np.nonzero(cells)
    out = np.zeros((size[1], size[0]), np.uint8)
    out[(rows / factor).astype(int), (columns / factor).astype(int)] = 1
    return out


def _headings(start: FloatArray | None) -> FloatArray:
    if start is None:
        return np.arange(0.0, 2.0 * math.pi, _STEP_RAD)
    return start[2] + np.arange(-10, 11) * _STEP_RAD


def _scores(
    spectrum: npt.NDArray[np.complex64], shape: tuple[int, ...], walls: FloatArray, heading: float, size: int
) -> FloatArray:
    """Return the mean of the field under the walls for each shift of their middle."""
    c, s = math.cos(heading), math.sin(heading)
    turned = walls @ np.array([[c, s], [-s, c]])
    cells = np.floor(turned / _CELL_M).astype(int) + size // 2
    kernel = np.zeros((size, size), np.float32)
    kernel[cells[:, 1].clip(0, size - 1), cells[:, 0].clip(0, size - 1)] = 1.0
    total = float(kernel.sum())
    scores: FloatArray = irfft2(spectrum * np.conj(rfft2(kernel, shape)), shape) / total
    return scores


def _peaks(scores: FloatArray, count: int) -> list[tuple[int, int]]:
    """Return the places of the highest scores, a few metres apart; shifts beyond the field wrap to negative ones."""
    work, found = scores.copy(), []
    reach = int(_APART_M / _CELL_M)
    for _ in range(count):
        row, column = np.unravel_index(int(work.argmax()), work.shape)
        found.append((int(row), int(column)))
        work[max(row - reach, 0) : row + reach, max(column - reach, 0) : column + reach] = -1.0
    return found


def _pose(middle_m: FloatArray, centre: FloatArray, heading: float) -> FloatArray:
    c, s = math.cos(heading), math.sin(heading)
    x = middle_m[0] - (c * centre[0] - s * centre[1])
    y = middle_m[1] - (s * centre[0] + c * centre[1])
    return np.array([x, y, math.remainder(heading, 2.0 * math.pi)])


def _is_near(pose: FloatArray, start: FloatArray) -> bool:
    turn = abs(math.remainder(pose[2] - start[2], 2.0 * math.pi))
    return math.hypot(pose[0] - start[0], pose[1] - start[1]) < 10.0 and turn < _APART_RAD


def _same(a: FloatArray, b: FloatArray, centre: FloatArray) -> bool:
    """Return whether two placings put the drive's middle at one place, with about one heading."""
    turn = abs(math.remainder(a[2] - b[2], 2.0 * math.pi))
    apart = _moved(a, centre) - _moved(b, centre)
    return turn < _APART_RAD and float(np.hypot(*apart)) < 2.0 * _APART_M


def _moved(pose: FloatArray, point: FloatArray) -> FloatArray:
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.array([pose[0] + c * point[0] - s * point[1], pose[1] + s * point[0] + c * point[1]])


class Candidate(NamedTuple):
    """A place `pose_map_drive` (3,) and its score."""

    pose_map_drive: FloatArray
    score: float


class WallSearch:
    """One sheet of a map that is searched often: its field is made once."""

    def __init__(self, sheet: Sheet) -> None:
        self.sheet, self._map_field = sheet, _field(sheet)
        self._spectra: dict[int, tuple[tuple[int, ...], npt.NDArray[np.complex64]]] = {}

    def best(self, walls: FloatArray, count: int, step_rad: float = _STEP_RAD) -> list[Candidate]:
        """Return the best places of walls (N, 2), at most `count`, each at one of its own."""
        centre, kept = walls.mean(axis=0), list[Candidate]()
        found = self.scored(walls, np.arange(0.0, 2.0 * math.pi, step_rad), 2)
        for one in sorted(found, key=lambda one: -one.score):
            if len(kept) < count and not any(_same(one.pose_map_drive, other.pose_map_drive, centre) for other in kept):
                kept.append(one)
        return kept

    def scored(self, walls: FloatArray, headings: FloatArray, peaks: int) -> list[Candidate]:
        """Return the best `peaks` places of walls (N, 2) in each of the headings (rad)."""
        centre = walls.mean(axis=0)
        radius = float(np.linalg.norm(walls - centre, axis=1).max())
        size = 32 * (int((2 * radius / _CELL_M) / 32) + 1) + 3
        shape, spectrum = self._spectrum(size)
        found: list[Candidate] = []
        for heading in headings.tolist():
            scores = _scores(spectrum, shape, walls - centre, heading, size)
            for row, column in _peaks(scores, peaks):
                # Shifts to before the field's first cell wrap around to the end.
                places = zip((row, column), shape, self._map_field.shape, strict=True)
                first = [at - extent * (at >= wide) for at, extent, wide in places]
                middle = self.sheet.origin_m + _CELL_M * (np.array(first[::-1]) + size // 2 + 0.5)
                found.append(Candidate(_pose(middle, centre, heading), float(scores[row, column])))
        return found

    def _spectrum(self, size: int) -> tuple[tuple[int, ...], npt.NDArray[np.complex64]]:
        if size not in self._spectra:
            shape = tuple(next_fast_len(extent + size, real=True) for extent in self._map_field.shape)
            self._spectra = {size: (shape, rfft2(self._map_field, shape))}
        return self._spectra[size]
