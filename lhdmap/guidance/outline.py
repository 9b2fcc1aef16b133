"""The points whose clearance counts: outlines of both bodies, each with the point of the body's axis that it is seen from."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.driving.lead import Lead
from lhdmap.messages import FloatArray


class Outline(NamedTuple):
    """Points (N, 4) of the leading and of the trailing body in the frames of their axles: x, y, and x, y on the axis."""

    leading: FloatArray
    trailing: FloatArray


def outline_of(lead: Lead) -> Outline:
    """Return the points of a direction of motion."""
    return Outline(_with_axis(lead.leading_m), _with_axis(lead.trailing_m))


def _with_axis(points: FloatArray) -> FloatArray:
    half = 0.5 * float(np.ptp(points[:, 1]))
    middle = 0.5 * float(points[:, 1].max() + points[:, 1].min())
    x = np.clip(points[:, 0], points[:, 0].min() + half, points[:, 0].max() - half)
    return np.column_stack([points, x, np.full(len(points), middle)])
