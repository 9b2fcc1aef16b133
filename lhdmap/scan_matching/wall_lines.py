"""The wall's line at each hit of a scan: which level of the map serves, and how much a hit counts that is beside its line."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.scan_matching.surface_map import (
    BELOW,
    CELLS,
    LINE,
    NORMAL_X,
    NORMAL_Y,
    SCATTER,
    SERVED,
    fit_line,
)

_CLUSTER_SIGMAS = 1.5  # hits that scatter no more than that are a degenerate cluster: their direction is noise
# Length of the hits beside a hit from which their direction is known; how far a line may run across them, as a share: more is
# a streak along the way.
_APART_M, _MOST_ACROSS = 0.3, 0.2


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
    across = line[NORMAL_X] * (c * x - s * y) + line[NORMAL_Y] * (s * x + c * y)
    along_way = abs(line[NORMAL_X] * c + line[NORMAL_Y] * s) < math.sqrt(0.5)
    if along_way and abs(across) > _MOST_ACROSS * math.sqrt(length2) + 3.0 * noise_m:
        line[SCATTER] += length2


@nb.njit(cache=True, nogil=True)
def lines_at(map_, pose, hits, model, wide, lines):  # type: ignore[no-untyped-def]
    """Fit the wall's line at each hit, lines (N, LINE); return how many of the front scanner's have one.

    The finest level that supports a line serves; with `wide` the next one instead where its line fits at least as well: where the
    wall is straight over both, its cells have more hits each and stand less beside it.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    points, sums, wider = hits.points, np.empty(8), np.empty(LINE)
    wanted = (model.min_cells, (_CLUSTER_SIGMAS * model.noise_m) ** 2 if wide else 0.0)
    found = 0
    for i in range(points.shape[0]):
        at = (
            pose[0] + c * points[i, 0] - s * points[i, 1],
            pose[1] + s * points[i, 0] + c * points[i, 1],
            points[i, 2],
        )
        lines[i, SERVED] = 0.0
        if fit_line(map_.fine, at, hits.layered, wanted, sums, lines[i]):
            lines[i, SERVED] = map_.fine.cell_m
            if (
                wide
                and fit_line(map_.middle, at, hits.layered, wanted, sums, wider)
                and wider[SCATTER] < lines[i, SCATTER]
            ):
                wider[SERVED] = map_.middle.cell_m
                lines[i] = wider
        elif fit_line(map_.middle, at, hits.layered, wanted, sums, lines[i]):
            lines[i, SERVED] = map_.middle.cell_m
        elif fit_line(map_.coarse, at, hits.layered, wanted, sums, lines[i]):
            lines[i, SERVED] = map_.coarse.cell_m
        if wide and 0 < i < hits.front - 1 and lines[i, SERVED] > 0.0:
            _uncross(points, i, (c, s), model.noise_m, lines[i])
        found += i < hits.front and lines[i, SERVED] > 0.0
    return found


@nb.njit(cache=True, nogil=True, inline="always")
def line_weight(line, distance2, incidence2, fine_m, model):  # type: ignore[no-untyped-def]
    """Return the robust weight (Tukey's) and the weight (1/m²) of a hit at a squared distance (m²) from its line.

    `incidence2`: squared cosine between beam and normal; the range's noise counts across the wall.
    """
    coarse_m = model.coarse_noise * (line[SERVED] - fine_m)
    variance = model.noise_m**2 * incidence2 + line[SCATTER] * (1.0 + 1.0 / line[CELLS]) + coarse_m * coarse_m + 1e-6
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
    return line[BELOW] * (nx * (c * x - s * y) + ny * (s * x + c * y))
