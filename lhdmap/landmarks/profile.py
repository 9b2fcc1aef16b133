"""The profile of a tunnel's walls: how far they are to the left and right of its smoothed mid line, step by step along it.

The mid line lies between the walls, so the profile is the same wherever in the tunnel the machine drove. It is made of averaged
hits and the way that was driven; a live window of some metres and a whole tunnel get theirs from the same function.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from scipy.ndimage import median_filter
from scipy.spatial import cKDTree

from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.messages import Float32Array, FloatArray

WALL_MOST_M = 6.0
"""What is farther to the side is no wall of the tunnel."""
_WALL_LEAST_M, _WALL_DEPTH_M = 0.3, 0.25
_FLOOR_M = 0.003  # deviation of a bin that no averaging goes below
_STEP_M = 0.3
_PASSES = 3


class WallProfile(NamedTuple):
    """Walls along a tunnel, P bins: float32 (P,) but for `line_m`, (P, 2).

    `at_m`: place along the node's line; `line_m`: the mid line in the node's frame; `heading_rad`: its heading there. `left_m`,
    `right_m`: distance of the walls from it, NaN where none is seen; `left_var`, `right_var`: their variances (m²). `gap`: how
    much less likely the most similar other place of the tunnel is, in nats (inf where there is no other).
    """

    at_m: Float32Array
    line_m: Float32Array
    heading_rad: Float32Array
    left_m: Float32Array
    right_m: Float32Array
    left_var: Float32Array
    right_var: Float32Array
    gap: Float32Array

    @property
    def step_m(self) -> float:
        """Length of a bin."""
        return (
            float(np.median(np.hypot(*np.diff(self.line_m.astype(np.float64), axis=0).T)))
            if len(self.at_m) > 1
            else 0.0
        )


def profile_of(
    cells_m: FloatArray, counts: FloatArray, way_m: FloatArray, at_m: FloatArray, settings: LandmarkSettings
) -> WallProfile:
    """Return the profile of averaged hits (M, 2) along a way (K, 2) that was driven, all in one frame.

    Args:
        cells_m: mean hit of each cell.
        counts: (M,) hits of each cell.
        way_m: where `base_link` was, in order.
        at_m: (K,) place of these along the node's line, rising.
        settings: step of the profile, length over which its mid line is smoothed.
    """
    if len(way_m) < 2:
        return _empty()
    line, at = _resampled(way_m, at_m, settings.profile_m)
    if len(line) < 3:
        return _empty()
    for _ in range(_PASSES):
        walls = _walls_along(line, cells_m, counts, settings)
        left, right = (_without_niches(wall, settings) for wall in walls.T[:2])
        middle = _smoothed(0.5 * (left - right), settings)
        turned = _heading(line)
        line = line + middle[:, None] * np.column_stack([-np.sin(turned), np.cos(turned)])
        line = np.column_stack([_smoothed(column, settings) for column in line.T])
        line, at = _resampled(line, at, settings.profile_m)
    walls = _walls_along(line, cells_m, counts, settings)
    single_left, single_right, left_var, right_var = (np.asarray(column, dtype=np.float32) for column in walls.T)
    gap = np.full(len(at), np.inf, dtype=np.float32)
    single_at, single_line, heading = (np.asarray(column, dtype=np.float32) for column in (at, line, _heading(line)))
    return WallProfile(single_at, single_line, heading, single_left, single_right, left_var, right_var, gap)


def _empty() -> WallProfile:
    none = np.zeros(0, dtype=np.float32)
    return WallProfile(none, np.zeros((0, 2), dtype=np.float32), none, none, none, none, none, none)


def _resampled(line_m: FloatArray, at_m: FloatArray, step_m: float) -> tuple[FloatArray, FloatArray]:
    """Return a line (K, 2) at equal steps of its length, and the places (K,) of these points."""
    lengths = np.hypot(*np.diff(line_m, axis=0).T)
    moved = np.r_[True, lengths > 1e-6]
    line_m, at_m = line_m[moved], at_m[moved]
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line_m, axis=0).T))])
    grid = step_m * np.arange(int(way[-1] / step_m) + 1)
    line = np.column_stack([np.interp(grid, way, column) for column in line_m.T])
    return line, np.interp(grid, way, at_m)


def _heading(line_m: FloatArray) -> FloatArray:
    dx, dy = np.gradient(line_m[:, 0]), np.gradient(line_m[:, 1])
    heading: FloatArray = np.unwrap(np.arctan2(dy, dx))
    return heading


def _smoothed(values: FloatArray, settings: LandmarkSettings) -> FloatArray:
    """Return values (P,) under a Hann window; the ends are continued by their point reflection."""
    half = min(round(0.5 * settings.smooth_m / settings.profile_m), len(values) - 1)
    if half < 1:
        return values
    kernel = np.hanning(2 * half + 3)[1:-1]
    padded = np.pad(values, half, mode="reflect", reflect_type="odd")
    smooth: FloatArray = np.convolve(padded, kernel / kernel.sum(), "valid")
    return smooth


def _without_niches(distances_m: FloatArray, settings: LandmarkSettings) -> FloatArray:
    """Return a wall's distances (P,) without gaps, and without what is a step deeper than the wall around: niches, openings."""
    wall = _filled(distances_m)
    around = median_filter(wall, size=max(round(2.0 * settings.smooth_m / settings.profile_m), 1), mode="nearest")
    known: FloatArray = np.minimum(wall, around + _STEP_M)
    return known


def _filled(values: FloatArray) -> FloatArray:
    """Return values (P,) with gaps (NaN) filled linearly; zeros where there is nothing at all."""
    known = np.isfinite(values)
    if not known.any():
        return np.zeros_like(values)
    return np.interp(np.arange(len(values)), np.flatnonzero(known), values[known])


def _walls_along(line: FloatArray, cells_m: FloatArray, counts: FloatArray, settings: LandmarkSettings) -> FloatArray:
    """Return (P, 4) along a line (P, 2): distance of the left and right wall (m), and their variances (m²)."""
    out = np.full((len(line), 4), np.nan)
    if not len(cells_m):
        return out
    away, nearest = cKDTree(line).query(cells_m, distance_upper_bound=WALL_MOST_M)
    near = np.isfinite(away)
    k, cells = nearest[near], cells_m[near]
    heading, beside = _heading(line)[k], cells - line[k]
    along = np.cos(heading) * beside[:, 0] + np.sin(heading) * beside[:, 1]
    lateral = -np.sin(heading) * beside[:, 0] + np.cos(heading) * beside[:, 1]
    inside = np.abs(along) <= settings.profile_m  # beyond the line's ends: no wall of its
    _walls(k[inside], lateral[inside], counts[near][inside], out)
    return out


@nb.njit(cache=True, nogil=True)
def _walls(bins, lateral, counts, out):  # type: ignore[no-untyped-def]
    """Fill the nearest wall to each side: the mean of the cells up to a depth behind the nearest one, and its variance."""
    first = np.full((out.shape[0], 2), np.inf)
    for i in range(bins.shape[0]):
        side, d = (0 if lateral[i] > 0.0 else 1), abs(lateral[i])
        if d > _WALL_LEAST_M:
            first[bins[i], side] = min(first[bins[i], side], d)
    sums = np.zeros((out.shape[0], 2, 4))
    for i in range(bins.shape[0]):
        side, d = (0 if lateral[i] > 0.0 else 1), abs(lateral[i])
        if d > _WALL_LEAST_M and d < first[bins[i], side] + _WALL_DEPTH_M:
            w = counts[i]
            sums[bins[i], side, 0] += w
            sums[bins[i], side, 1] += w * d
            sums[bins[i], side, 2] += w * d * d
            sums[bins[i], side, 3] += 1.0
    for k in range(out.shape[0]):
        for side in range(2):
            w, wd, wdd, n = sums[k, side]
            if n > 0.0:
                mean = wd / w
                out[k, side] = mean
                out[k, 2 + side] = max(wdd / w - mean * mean, 0.0) / n + _FLOOR_M**2


def line_pose(profile: WallProfile, at_m: float) -> FloatArray:
    """Return the pose (3,) of the mid line at a place along the node, in the node's frame."""
    columns = (profile.line_m[:, 0], profile.line_m[:, 1], profile.heading_rad)
    x, y, heading = (float(np.interp(at_m, profile.at_m, column)) for column in columns)
    return np.array([x, y, math.remainder(heading, 2.0 * math.pi)])
