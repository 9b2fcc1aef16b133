"""The walls at the face: what bounds its width, and how well that is known."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.pile.face import PileFace
from lhdmap.pile.order import cell_numbers, grouped, quantile, select, spread_about

_WALL_CELL_M = 0.1
_MOUTH_M = 1.2
_STEP_M = 0.3  # both walls together stand so much farther out at the face than at a mouth: as likely a stope as rock
_WIDENS_M = 0.12  # the same against the line of the walls before, which rocks before the face do not draw in
_BEYOND_TOE_M = 0.6  # a mouth lies before the toe: drift's wall seen so far beyond it is no stope's
_STEP_STD_M = 0.05  # roughness of what these are measured on
_UNSEEN_CHANCE, _UNSEEN_STEP_M = 0.95, 0.15  # of a stope where neither wall was seen at the face; what may hide a wall
_VISIBLE = 0.75  # one looks along a wall: what stands in hides what lies behind, the seen part is the nearer one
_HEIGHTS = 12.0  # cells in the heights that the width is defined over
_BUMPS = 2.0  # independent bumps in these heights: rock is alike over half a metre
_WALL_SLACK_M = 0.45  # a wall at the face stands no farther from the line of the wall before


class FaceLimits(NamedTuple):
    """Left and right wall at the face, y in the end frame (m), with standard deviations.

    Either the walls reach the face, or the drift opens into a stope and its mouth counts: `mouth_chance` is the probability of
    the latter, and the limits are the mean of both, weighted by it. `step_m`: by how much the walls stand farther apart than the
    mouth. `gap_m`: length before the face on which the worse side's wall was not seen.
    """

    left_m: float
    right_m: float
    left_std_m: float
    right_std_m: float
    mouth_chance: float
    step_m: float
    gap_m: float

    def width_m(self, askew: float) -> tuple[float, float]:
        """Return the width in the plane of a face that stands askew (dx/dy), and its standard deviation.

        A mouth's width is what one sees along the drift. That it is not sure which of the two counts is part of the deviation.
        """
        mouth = self.left_m - self.right_m - (1.0 - self.mouth_chance) * self.step_m
        wall_to_wall = (mouth + self.step_m) * math.sqrt(1.0 + askew * askew)
        width = self.mouth_chance * mouth + (1.0 - self.mouth_chance) * wall_to_wall
        doubt = self.mouth_chance * (1.0 - self.mouth_chance) * (wall_to_wall - mouth) ** 2
        return width, math.sqrt(self.left_std_m**2 + self.right_std_m**2 + doubt)


def limits_of(points: FloatArray, face: PileFace, floor_m: float, half_m: float) -> FaceLimits:
    """Return the walls in the last metre before the face, from hits (N, 4) in the end frame; where the drift opens, its mouth."""
    return FaceLimits(*_limits(points, (face.a, face.b, face.c), floor_m, half_m))


@nb.njit(cache=True, nogil=True)
def _limits(points, face, floor, half):  # type: ignore[no-untyped-def]
    """Return the fields of `FaceLimits`."""
    a, b, c = face
    # rubble of a shallow face reaches far along the drift: off it by a distance along the normal
    off = max(0.15, 0.2 * math.sqrt(1.0 + c**2))
    before = points[:, 0] - (a + b * points[:, 1] + c * points[:, 2])
    height = points[:, 2] - floor
    standing = (height > 0.3) & (height < 1.5) & (before < -off) & (before > -8.0)
    hits, before_wall = points[standing], before[standing]
    at_face, drift = hits[before_wall > -0.75 - off], hits[before_wall < -0.15 - off]
    left, left_std = _wall(at_face, 1.0, half)
    right, right_std = _wall(at_face, -1.0, half)
    before_that = hits[(before_wall < -0.75 - off) & (before_wall > -1.75 - off)]
    left_std = _farther(left, left_std, _wall(before_that, 1.0, half)[0], off)
    right_std = _farther(right, right_std, _wall(before_that, -1.0, half)[0], off)
    mouth_left, mouth_left_std, left_end = _mouth(drift, 1.0, half)
    mouth_right, mouth_right_std, right_end = _mouth(drift, -1.0, half)
    left_step, right_step, widens = left - mouth_left, right - mouth_right, left + right - 2.0 * half
    beyond = min(left_end, right_end) - (a + c * floor)
    chance, left_step, right_step = _opening(left_step, right_step, widens, beyond)
    if math.isnan(left):
        left_std = math.hypot(mouth_left_std, _UNSEEN_STEP_M)
    if math.isnan(right):
        right_std = math.hypot(mouth_right_std, _UNSEEN_STEP_M)
    gap = max(_gap(points, before, 1.0, half), _gap(points, before, -1.0, half))
    return (
        mouth_left + (1.0 - chance) * left_step,
        -(mouth_right + (1.0 - chance) * right_step),
        math.sqrt(chance * mouth_left_std**2 + (1.0 - chance) * left_std**2),
        math.sqrt(chance * mouth_right_std**2 + (1.0 - chance) * right_std**2),
        chance,
        left_step + right_step,
        gap,
    )


@nb.njit(cache=True, nogil=True)
def _farther(wall, std, wall_before, off):  # type: ignore[no-untyped-def]
    """Return a wall's deviation at the face, from its measure as far off, where a metre before it stands somewhere else."""
    return std if math.isnan(wall_before) else math.hypot(std, (wall - wall_before) * off)


@nb.njit(cache=True, nogil=True)
def _opening(left, right, widens, beyond):  # type: ignore[no-untyped-def]
    """Return the probability of a stope, and both steps from the mouth to the wall at the face (NaN: that was not seen).

    A stope steps back on both sides, so that a wall which was not seen is taken to stand as the other does.
    """
    if math.isnan(left) and math.isnan(right):
        return _UNSEEN_CHANCE, _UNSEEN_STEP_M, _UNSEEN_STEP_M
    if math.isnan(left):
        margin, left = 2.0 * right - _STEP_M, right
    elif math.isnan(right):
        margin, right = 2.0 * left - _STEP_M, left
    else:
        margin = min(left + right - _STEP_M, widens - _WIDENS_M, _BEYOND_TOE_M - beyond)
    return 1.0 / (1.0 + math.exp(-margin / _STEP_STD_M)), left, right


@nb.njit(cache=True, nogil=True)
def _gap(points, before, side, half):  # type: ignore[no-untyped-def]
    """Return the distance from the last hits of a wall to the face."""
    wall, count = np.empty(before.size), 0
    for i in range(before.size):
        y = side * points[i, 1]
        if y > half - 0.7 and y < half + 0.6 and before[i] < -0.1:
            wall[count] = before[i]
            count += 1
    return -select(wall, count, count - 8) if count >= 8 else 99.0


@nb.njit(cache=True, nogil=True)
def _wall(points, side, half):  # type: ignore[no-untyped-def]
    """Return the distance of a wall from the middle and its standard deviation; NaN where none is near."""
    y = _cell_medians(points[side * points[:, 1] > 0.5], side)
    y = y[np.abs(y - half) < _WALL_SLACK_M]
    if y.size < 5:
        return math.nan, math.nan
    wall = quantile(y, y.size, _VISIBLE)
    return wall, _deviation(y, quantile(y, y.size, 0.5))


@nb.njit(cache=True, nogil=True)
def _cell_medians(points, side):  # type: ignore[no-untyped-def]
    """Return how far to a side the wall is in each (x, z) cell: near patches have many hits and must not outvote."""
    numbers, count = cell_numbers(points[:, 0].copy(), points[:, 2].copy(), _WALL_CELL_M)
    y, starts = grouped(side * points[:, 1], numbers, count)
    out, used = np.empty(count), 0
    for k in range(count):
        hits = starts[k + 1] - starts[k]
        if hits:
            out[used] = select(y[starts[k] : starts[k + 1]], hits, hits // 2)
            used += 1
    return out[:used]


@nb.njit(cache=True, nogil=True)
def _mouth(points, side, half):  # type: ignore[no-untyped-def]
    """Return how far to a side one can look past the drift's last metre of wall: what stands out most at each height.

    With its standard deviation, and where the wall ends (x). No wall: its line.
    """
    wall = points[np.abs(side * points[:, 1] - half) < _WALL_SLACK_M]
    if wall.shape[0] < 16:
        return half, 0.5, -math.inf
    x = wall[:, 0].copy()
    end = select(x, x.size, x.size - 8)
    wall = wall[wall[:, 0] > end - _MOUTH_M]
    rows, count = cell_numbers(wall[:, 2].copy(), np.zeros(wall.shape[0]), _WALL_CELL_M)
    y, starts = grouped(side * wall[:, 1], rows, count)
    inner, used = np.empty(count), 0
    for k in range(count):
        hits = starts[k + 1] - starts[k]
        if hits:
            inner[used] = quantile(y[starts[k] : starts[k + 1]], hits, 0.05)
            used += 1
    # a median over heights of which only these were seen: each is one draw, few of them independent
    variance = inner[:used].var() * (1.0 / _BUMPS + max(_HEIGHTS / used - 1.0, 0.0))
    return quantile(inner, used, 0.5), max(math.sqrt(variance), 0.03), end


@nb.njit(cache=True, nogil=True)
def _deviation(y, middle):  # type: ignore[no-untyped-def]
    """Return the standard deviation of the middle of rough rock: few independent bumps in a metre."""
    return max(spread_about(y, y.size, middle) / math.sqrt(4.0), 0.03)
