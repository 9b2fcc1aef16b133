"""Both bodies in plan: points along their outlines, in the frame of the axle that carries each."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.machine import Machine
from lhdmap.messages import FloatArray

OUTLINE_M = 0.3


class Bodies(NamedTuple):
    """Outline points (N, 2) of the front body in `base_link` and (M, 2) of the rear one in `rear_link`; boxes (2, 2) low, high."""

    front_m: FloatArray
    rear_m: FloatArray
    front_box_m: FloatArray
    rear_box_m: FloatArray


def bodies_of(machine: Machine, step_m: float = OUTLINE_M) -> Bodies:
    """Return the bodies of a machine, each as the rectangle around its boxes."""
    front, rear = _box(machine.boxes("base_link")), _box(machine.boxes("rear_link"))
    return Bodies(_outline(front, step_m), _outline(rear, step_m), front, rear)


def _box(boxes: FloatArray) -> FloatArray:
    if len(boxes) == 0:
        return np.zeros((2, 2))
    return np.stack([boxes[:, 0, :2].min(axis=0), boxes[:, 1, :2].max(axis=0)])


def _outline(box: FloatArray, step_m: float) -> FloatArray:
    """Return points along both long sides, corners included, and the middle of both short ones."""
    (x0, y0), (x1, y1) = box
    along = np.linspace(x0, x1, max(math.ceil((x1 - x0) / step_m), 1) + 1)
    sides = [np.column_stack([along, np.full(len(along), y)]) for y in (y0, y1)]
    across = np.linspace(y0, y1, max(math.ceil((y1 - y0) / (2.0 * step_m)), 1) + 1)[1:-1]
    ends = [np.column_stack([np.full(len(across), x), across]) for x in (x0, x1)]
    return np.concatenate([*sides, *ends])
