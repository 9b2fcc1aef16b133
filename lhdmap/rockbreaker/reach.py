"""Where the tip can be: the slice of Fig. 3, and the orientations at a point."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.rockbreaker.orientation import holds_vertical, nearest_vertical, phi_intervals, phi_range, planar_position

_STEP_M, _MOST_STEPS = 0.05, 400


def workspace_slice(machine: Rockbreaker) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return x (X,), z (Z,) and φ_min, φ_max (X, Z) over the slice at θ1 = 0, NaN where the tip cannot be."""
    reach = float(machine.links_m.sum())
    step_m = max(_STEP_M, reach / _MOST_STEPS)
    x = np.arange(0.0, reach + step_m, step_m)
    z = np.arange(machine.base.height_m - reach, machine.base.height_m + reach, step_m)
    low, high = phi_range(machine, np.stack(np.meshgrid(x, z, indexing="ij"), axis=-1))
    used = np.flatnonzero(~np.isnan(low).all(axis=0))
    rows = slice(max(int(used[0]) - 2, 0), int(used[-1]) + 3) if len(used) else slice(None)
    return x, z[rows], low[:, rows], high[:, rows]


def workspace_json(machine: Rockbreaker, at_m: FloatArray | None) -> dict[str, Any]:
    """Return limits of the joints, areas of the slice, and the orientations at a tip (3,) where one is given."""
    x, z, low, high = workspace_slice(machine)
    cell_m2 = float((x[1] - x[0]) * (z[1] - z[0]))
    seen = ~np.isnan(low)
    vertical = holds_vertical(low, high)
    values: dict[str, Any] = {
        "machine": machine.name,
        "theta_limits_deg": np.degrees(machine.theta_limits).T.tolist(),
        "swing_rate_limit_dps": math.degrees(machine.swing_rate_limit),
        "area_m2": float(seen.sum()) * cell_m2,
        "vertical_area_m2": float(vertical.sum()) * cell_m2,
        "x_m": _span(x[seen.any(axis=1)]),
        "z_m": _span(z[seen.any(axis=0)]),
        "folder": None,
    }
    return values | _orientations(machine, at_m)


def _span(values: FloatArray) -> list[float] | None:
    """Return the least and the largest of some values; None: there are none, as the workspace is narrower than a cell."""
    return [float(values.min()), float(values.max())] if len(values) else None


def _orientations(machine: Rockbreaker, at_m: FloatArray | None) -> dict[str, Any]:
    """Return the orientations at a tip; `reached` is None where none is given."""
    empty: dict[str, Any] = {
        "at_m": at_m,
        "phi_min_deg": None,
        "phi_max_deg": None,
        "phi_intervals_deg": [],
        "phi_deg": None,
    }
    if at_m is None:
        return empty | {"reached": None}
    phi = nearest_vertical(machine, at_m)
    if math.isnan(phi):
        return empty | {"reached": False}
    intervals = np.degrees(phi_intervals(machine, planar_position(at_m)))
    intervals = intervals[~np.isnan(intervals[:, 0])]
    ends = {"phi_min_deg": float(intervals.min()), "phi_max_deg": float(intervals.max())}
    return empty | ends | {"reached": True, "phi_intervals_deg": intervals.tolist(), "phi_deg": math.degrees(phi)}
