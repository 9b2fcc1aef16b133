"""Names on a plan: each as near to its place as it can stand without covering another, or what is drawn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

Flags = npt.NDArray[np.bool_]
_PER_LETTER, _HIGH = 0.62, 1.25  # of the size of the letters: width of one, height of a line (DejaVu Sans)
_DIRECTIONS = 16
_RINGS = (0.0, 4.0, 9.0, 15.0, 22.0, 31.0, 42.0, 56.0, 72.0)  # from the place's own mark outwards, in points
_COVERED, _FAR = 1.0, 0.35  # what a drawn point under the name costs, and a point of distance


class Label(NamedTuple):
    """A name for a place `at` (2,), which has a mark of radius `mark`; `size` of its letters; all in points of 1/72 inch."""

    text: str
    at: FloatArray
    mark: float = 3.0
    size: float = 7.5


class Standing(NamedTuple):
    """Where the name `number` stands: its middle (2,), and whether it is so far away that a line has to lead to it."""

    number: int
    middle: FloatArray
    apart: bool


def placed(labels: Sequence[Label], drawn: FloatArray, size: tuple[float, float]) -> list[Standing]:
    """Return where labels can stand, the first ones first; one that has no room within `size` (width, height) is left out.

    `drawn` (N, 2): points that are not to be covered, where it can be helped. No two names overlap.
    """
    counted = _summed(drawn, size)
    boxes = np.empty((0, 4))
    found = []
    for number, label in enumerate(labels):
        middles, distances = _candidates(label)
        around = _boxes(middles, label)
        free = _inside(around, size) & ~_overlaps(around, boxes)
        if not free.any():
            continue
        cost = np.where(free, _COVERED * _count(counted, around) + _FAR * distances, np.inf)
        best = int(np.argmin(cost))
        boxes = np.vstack([boxes, around[best]])
        found.append(Standing(number, middles[best], bool(distances[best] > _RINGS[2])))
    return found


def extent(label: Label) -> tuple[float, float]:
    """Return about how wide and high a name is."""
    return _PER_LETTER * label.size * len(label.text), _HIGH * label.size


def _candidates(label: Label) -> tuple[FloatArray, FloatArray]:
    """Return middles (K, 2) round the place, and how far each name then is from the mark (K,)."""
    angles = np.arange(_DIRECTIONS) * 2.0 * math.pi / _DIRECTIONS
    ways = np.tile(np.column_stack([np.cos(angles), np.sin(angles)]), (len(_RINGS), 1))
    far = np.repeat(_RINGS, _DIRECTIONS)
    half = 0.5 * np.array(extent(label))
    edge = np.clip(ways * 1.5, -1.0, 1.0) * half  # the box touches the ring, also beside a corner
    return label.at + edge + ways * (label.mark + far)[:, None], far


def _boxes(middles: FloatArray, label: Label) -> FloatArray:
    half = 0.5 * np.array(extent(label))
    return np.hstack([middles - half, middles + half])


def _inside(boxes: FloatArray, size: tuple[float, float]) -> Flags:
    x0, y0, x1, y1 = boxes.T
    within: Flags = (x0 >= 0.0) & (y0 >= 0.0) & (x1 <= size[0]) & (y1 <= size[1])
    return within


def _overlaps(boxes: FloatArray, others: FloatArray) -> Flags:
    """Return which of boxes (K, 4: x0, y0, x1, y1) lie over any of others (M, 4)."""
    a, b = boxes.T[:, :, None], others.T[:, None]
    over: Flags = (a[0] < b[2]) & (a[2] > b[0]) & (a[1] < b[3]) & (a[3] > b[1])
    return np.asarray(over.any(axis=1))


def _summed(drawn: FloatArray, size: tuple[float, float]) -> FloatArray:
    """Return sums of the cells of one point that something is drawn in, over all rectangles from the corner."""
    width, height = (math.ceil(side) + 1 for side in size)
    cells = np.zeros((height + 1, width + 1))
    at = np.floor(drawn).astype(np.int64)
    at = at[((at >= 0) & (at < (width, height))).all(axis=1)]
    cells[at[:, 1] + 1, at[:, 0] + 1] = 1.0
    return cells.cumsum(axis=0).cumsum(axis=1)


def _count(summed: FloatArray, boxes: FloatArray) -> FloatArray:
    """Return how many drawn cells each box (K, 4) covers."""
    most = (summed.shape[1] - 1, summed.shape[0] - 1)
    x0, y0 = (np.clip(np.floor(boxes[:, k]).astype(np.int64), 0, most[k]) for k in (0, 1))
    x1, y1 = (np.clip(np.ceil(boxes[:, k + 2]).astype(np.int64), 0, most[k]) for k in (0, 1))
    counts: FloatArray = summed[y1, x1] - summed[y0, x1] - summed[y1, x0] + summed[y0, x0]
    return counts
