"""Scan to map: Gauss-Newton on the distances of scan points to the walls' lines, with the motion's prediction as a prior."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.scan_matching.surface_map import LINE, fit_line

# Finest cells that a pose may move before lines are fitted anew. Where the walls hold: measured, no loss, half the time. Where
# they hardly do, one step corrects only a part of an error along them, and what pulls towards standing still adds up. There lines
# are wide, too: the direction of a short one is mostly noise, and noise that the map keeps holds the pose where it is.
_LINES_HOLD, _WEAK_LINES_HOLD = 0.3, 0.03
_WEAK_M = 0.003  # deviation of a match in its worse direction from which walls hardly hold
_SMOOTH_RATIO = 8.0  # of both deviations: rough walls give 2, moderate ones 4, smooth ones 10, a coarse scanner 1
_CLOT_SIGMAS = 1.5
_APART_M, _MOST_ACROSS = 0.3, 0.2  # of the hits beside a hit; how far a line may run across them, as a share
NO_SLANTS = np.zeros((0, 2))


class MatchModel(NamedTuple):
    """How far a hit may be from the wall's line: see `AnchorSettings` and `OdometrySettings` for the units."""

    noise_m: float
    cutoff_sigmas: float
    min_cells: float
    coarse_noise: float
    rounds: int
    lean: float = 0.0
    lean_patch_m: float = 2.0


class Hits(NamedTuple):
    """Points (N, 3) in the level base frame, heights absolute; `front`: how many come from the front scanner, which are first.

    `layered`: the scanner tilts, heights matter; `slants` (N, 2) of `lhdmap.scan_matching.slant`, or none. Other scanners'
    hits help to place the scan; how well it fits is judged by the front one's alone.
    """

    points: FloatArray
    front: int
    layered: bool
    slants: FloatArray = NO_SLANTS


class Prior(NamedTuple):
    """What is known before the match: mean pose (3,) and information (3, 3)."""

    pose: FloatArray
    information: FloatArray


class Match(NamedTuple):
    """Result: `pose` (3,), `information` (3, 3) of the scan alone in map axes, share of hits with a line, share that agrees.

    `lines` (N, LINE): the wall at each hit, as `fit_line` gives it, [6] the cell size of the level that served (0: none).
    `smooth`: the walls hardly hold one direction, so lines were wide.
    """

    pose: FloatArray
    information: FloatArray
    covered: float
    support: float
    residual_sigmas: float
    lines: FloatArray
    smooth: bool


@nb.njit(cache=True, nogil=True, inline="always")
def _uncross(points, i, turn, noise_m, line):  # type: ignore[no-untyped-def]
    """Let a line say hardly anything that the scan's own neighbours of the hit, far apart, do not lie along.

    Hits on a far face that come nearer scan by scan, at a speed slightly wrong, leave streaks along the way and no wall.
    """
    x, y = points[i + 1, 0] - points[i - 1, 0], points[i + 1, 1] - points[i - 1, 1]
    length2 = x * x + y * y
    if length2 < _APART_M * _APART_M:
        return
    c, s = turn
    across = line[2] * (c * x - s * y) + line[3] * (s * x + c * y)
    along_way = abs(line[2] * c + line[3] * s) < math.sqrt(0.5)
    if along_way and abs(across) > _MOST_ACROSS * math.sqrt(length2) + 3.0 * noise_m:
        line[4] += length2


@nb.njit(cache=True, nogil=True)
def lines_at(map_, pose, hits, model, wide, lines):  # type: ignore[no-untyped-def]
    """Fit the wall's line at each hit, lines (N, LINE); return how many of the front scanner's have one.

    The finest level that supports a line serves; with `wide` the next one instead where its line fits at least as well: where the
    wall is straight over both, its cells have more hits each and stand less beside it.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    points, sums, wider = hits.points, np.empty(8), np.empty(LINE)
    wanted = (model.min_cells, (_CLOT_SIGMAS * model.noise_m) ** 2 if wide else 0.0)
    found = 0
    for i in range(points.shape[0]):
        at = (
            pose[0] + c * points[i, 0] - s * points[i, 1],
            pose[1] + s * points[i, 0] + c * points[i, 1],
            points[i, 2],
        )
        lines[i, 6] = 0.0
        if fit_line(map_.fine, at, hits.layered, wanted, sums, lines[i]):
            lines[i, 6] = map_.fine.cell_m
            if wide and fit_line(map_.middle, at, hits.layered, wanted, sums, wider) and wider[4] < lines[i, 4]:
                wider[6] = map_.middle.cell_m
                lines[i] = wider
        elif fit_line(map_.middle, at, hits.layered, wanted, sums, lines[i]):
            lines[i, 6] = map_.middle.cell_m
        elif fit_line(map_.coarse, at, hits.layered, wanted, sums, lines[i]):
            lines[i, 6] = map_.coarse.cell_m
        if wide and 0 < i < hits.front - 1 and lines[i, 6] > 0.0:
            _uncross(points, i, (c, s), model.noise_m, lines[i])
        found += i < hits.front and lines[i, 6] > 0.0
    return found


@nb.njit(cache=True, nogil=True, inline="always")
def line_weight(line, distance2, incidence2, fine_m, model):  # type: ignore[no-untyped-def]
    """Return the robust weight (Tukey's) and the weight (1/m²) of a hit at a squared distance (m²) from its line.

    `incidence2`: squared cosine between beam and normal; the range's noise counts across the wall.
    """
    coarse_m = model.coarse_noise * (line[6] - fine_m)
    variance = model.noise_m**2 * incidence2 + line[4] * (1.0 + 1.0 / line[5]) + coarse_m * coarse_m + 1e-6
    u2 = distance2 / (variance * model.cutoff_sigmas**2)
    robust = (1.0 - u2) ** 2 if u2 < 1.0 else 0.0
    return robust, robust / variance


@nb.njit(cache=True, nogil=True, inline="always")
def slanted(hits, i, line, c, s, nx, ny):  # type: ignore[no-untyped-def]
    """Return how far (m) along the normal (nx, ny) hit `i` moves when it is put beside what it is like at the line's height.

    `c`, `s`: cosine and sine of the heading.
    """
    if i >= hits.slants.shape[0]:
        return 0.0
    x, y = hits.slants[i, 0], hits.slants[i, 1]
    return line[7] * (nx * (c * x - s * y) + ny * (s * x + c * y))


@nb.njit(cache=True, nogil=True)
def _eliminate(patch, lean, sums):  # type: ignore[no-untyped-def]
    """Take the unknown lean of a patch of wall out of the sums of the equations, and begin the next patch.

    Its hits are off by lean x (height over the map's hits), alike for all of them: the Schur complement of that one unknown,
    with prior N(0, lean²).
    """
    pivot = 1.0 / (patch[3] + 1.0 / (lean * lean))
    g0, g1, g2, gc = patch[0], patch[1], patch[2], patch[4]
    sums[0] -= g0 * g0 * pivot
    sums[1] -= g0 * g1 * pivot
    sums[2] -= g0 * g2 * pivot
    sums[3] -= g1 * g1 * pivot
    sums[4] -= g1 * g2 * pivot
    sums[5] -= g2 * g2 * pivot
    sums[6] += g0 * gc * pivot
    sums[7] += g1 * gc * pivot
    sums[8] += g2 * gc * pivot
    patch[:] = 0.0


@nb.njit(cache=True, nogil=True, inline="always")
def _add(sums, w, nx, ny, jt, d):  # type: ignore[no-untyped-def]
    """Add one equation n · shift + jt turn = -d to the sums: upper triangle of H, then b."""
    wx, wy, wt = w * nx, w * ny, w * jt
    sums[0] += wx * nx
    sums[1] += wx * ny
    sums[2] += wx * jt
    sums[3] += wy * ny
    sums[4] += wy * jt
    sums[5] += wt * jt
    sums[6] -= wx * d
    sums[7] -= wy * d
    sums[8] -= wt * d


@nb.njit(cache=True, nogil=True)
def normal_equations(pose, hits, lines, fine_m, model, H, b):  # type: ignore[no-untyped-def]
    """Fill H (3, 3) and b (3,) of the weighted distances at `pose`; both in the map's axes about the machine.

    Returns (weighted square sum, sum of robust weights) of the front scanner's hits.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    points, sums, patch = hits.points, np.zeros(9), np.zeros(5)
    leaning = hits.layered and model.lean > 0.0
    patch_x = patch_y = math.inf
    total = weights = 0.0
    for i in range(points.shape[0]):
        if lines[i, 6] == 0.0:
            continue
        rx, ry = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
        nx, ny = lines[i, 2], lines[i, 3]
        towards = nx * rx + ny * ry
        if towards < 0.0:  # one sign for all normals: a lean moves a patch as a whole
            nx, ny = -nx, -ny
        d = nx * (pose[0] + rx - lines[i, 0]) + ny * (pose[1] + ry - lines[i, 1])
        d += slanted(hits, i, lines[i], c, s, nx, ny)
        robust, w = line_weight(lines[i], d * d, towards * towards / (rx * rx + ry * ry + 1e-12), fine_m, model)
        if w == 0.0:
            continue
        jt = -nx * ry + ny * rx
        _add(sums, w, nx, ny, jt, d)
        if i < hits.front:
            total += w * d * d
            weights += robust
        if leaning:
            if (rx - patch_x) ** 2 + (ry - patch_y) ** 2 > model.lean_patch_m**2:
                _eliminate(patch, model.lean, sums)
                patch_x, patch_y = rx, ry
            lag = w * lines[i, 7]
            patch[0] += lag * nx
            patch[1] += lag * ny
            patch[2] += lag * jt
            patch[3] += lag * lines[i, 7]
            patch[4] += lag * d
    if leaning:
        _eliminate(patch, model.lean, sums)
    H[0, 0], H[0, 1], H[0, 2] = sums[0], sums[1], sums[2]
    H[1, 0], H[1, 1], H[1, 2] = sums[1], sums[3], sums[4]
    H[2, 0], H[2, 1], H[2, 2] = sums[2], sums[4], sums[5]
    b[:] = sums[6:9]
    return total, weights


@nb.njit(cache=True, nogil=True)
def solve3(A: FloatArray, b: FloatArray) -> FloatArray:
    """Solve a symmetric positive definite 3 x 3 system by Cholesky; zeros where it is singular."""
    x = np.zeros(3)
    if not A[0, 0] > 0.0:
        return x
    l00 = math.sqrt(A[0, 0])
    l10, l20 = A[1, 0] / l00, A[2, 0] / l00
    d1 = A[1, 1] - l10 * l10
    if not d1 > 0.0:
        return x
    l11 = math.sqrt(d1)
    l21 = (A[2, 1] - l20 * l10) / l11
    d2 = A[2, 2] - l20 * l20 - l21 * l21
    if not d2 > 0.0:
        return x
    l22 = math.sqrt(d2)
    y0 = b[0] / l00
    y1 = (b[1] - l10 * y0) / l11
    y2 = (b[2] - l20 * y0 - l21 * y1) / l22
    x[2] = y2 / l22
    x[1] = (y1 - l21 * x[2]) / l11
    x[0] = (y0 - l10 * x[1] - l20 * x[2]) / l00
    return x


@nb.njit(cache=True, nogil=True, inline="always")
def _held(H):  # type: ignore[no-untyped-def]
    """Return the information (1/m²) of H (3, 3) along its worse and its better direction of the plane."""
    half, difference = 0.5 * (H[0, 0] + H[1, 1]), 0.5 * (H[0, 0] - H[1, 1])
    root = math.sqrt(difference * difference + H[0, 1] * H[0, 1])
    return half - root, half + root


@nb.njit(cache=True, nogil=True)
def match(map_, hits, prior, start, model):  # type: ignore[no-untyped-def]
    """Return the `Match` of `hits` with the map: maximum a posteriori from `start` (3,) under the `Prior`.

    Lines are fitted anew when the pose has moved.
    """
    pose = start.copy()
    lines = np.zeros((hits.points.shape[0], LINE))
    H, b = np.zeros((3, 3)), np.zeros(3)
    fine_m = map_.fine.cell_m
    found, wide = 0, False
    for _ in range(model.rounds):
        found = lines_at(map_, pose, hits, model, wide, lines)
        moved = 0.0
        for _ in range(3):
            normal_equations(pose, hits, lines, fine_m, model, H, b)
            step = solve3(H + prior.information, b + prior.information @ (prior.pose - pose))
            pose += step
            size = abs(step[0]) + abs(step[1]) + 5.0 * abs(step[2])
            moved += size
            if size < 2e-5:
                break
        worse, better = _held(H)
        weak = worse < 1.0 / _WEAK_M**2
        if weak and not wide and worse * _SMOOTH_RATIO**2 < better:
            wide = True
        elif moved < (_WEAK_LINES_HOLD if weak and (wide or not hits.layered) else _LINES_HOLD) * fine_m:
            break
    total, weights = normal_equations(pose, hits, lines, fine_m, model, H, b)
    n = max(hits.front, 1)
    return Match(pose, H, found / n, weights / n, math.sqrt(total / max(weights, 1e-9)), lines, wide)
