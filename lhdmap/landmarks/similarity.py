"""The similarity matrix of a tunnel's landmarks (paper, Section 3.2, step 2): the fitness of each cloud on each other one.

F[i, j] is the fitness (m²) of landmark i, the source, on landmark j, the target; it is not symmetric. The live scan is a source,
so what landmark j can be mistaken for stands in column j. Neighbours start at their known relative pose, and must stay near it:
a match elsewhere is none. All others start from shifts along the axis, and the best counts. Nothing is pruned: the most similar
landmark that is no neighbour is an extreme among equals, which no cheaper measure finds.

Each column needs one prepared target, so memory beside the matrix is one grid (about 1.5 MB) a thread; the time grows with the
number of landmarks times those within `window_m`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numba as nb
import numpy as np

from lhdmap.geometry import se2
from lhdmap.landmarks.icp import align, best_of
from lhdmap.landmarks.scans import NodeCloud
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.landmarks.target import IcpModel, prepare
from lhdmap.messages import Float32Array, FloatArray

STRAY_M, STRAY_RAD = 0.5, 0.1
"""How far a neighbour's match may end from where the neighbour is known to be."""


def icp_model(settings: LandmarkSettings) -> IcpModel:
    """Return how clouds are compared under these settings."""
    return IcpModel(
        settings.limit_m, settings.range_m, settings.centre_m, settings.min_share, settings.fitness == "line"
    )


def similarity(
    clouds: Sequence[NodeCloud],
    settings: LandmarkSettings,
    *,
    threads: int | None = None,
    done: Callable[[float], None] | None = None,
) -> Float32Array:
    """Return F (n, n) of a tunnel's landmarks in their order: source i on target j, m².

    The diagonal is 0; NaN where two are farther apart than the window.

    Args:
        clouds: of one tunnel, each with points.
        settings: `LandmarkSettings`.
        threads: how many columns at a time; None: one a core.
        done: is told the share (0 to 1) that is done.
    """
    n = len(clouds)
    F = np.full((n, n), np.nan, dtype=np.float32)
    if not n:
        return F
    poses, at_m = np.array([cloud.pose_node_base for cloud in clouds]), np.array([cloud.at_m for cloud in clouds])
    offsets = np.concatenate([[0], np.cumsum([len(cloud.points_m) for cloud in clouds])])
    points = np.concatenate([cloud.points_m for cloud in clouds])
    forward, model = _forward(poses), icp_model(settings)
    steps = int(settings.shift_m / settings.shift_step_m)
    shifts_m = settings.shift_step_m * np.arange(-steps, steps + 1)

    def column(j: int) -> None:
        compared = np.abs(at_m - at_m[j]) <= settings.window_m
        F[:, j] = _column(j, points, offsets, poses, forward, compared, shifts_m, settings.neighbours, model)

    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        for count, _ in enumerate(pool.map(column, range(n)), start=1):
            if done is not None:
                done(count / n)
    return F


def _forward(poses: FloatArray) -> FloatArray:
    """Return for each landmark 1 where the machine faced the next ones, -1 where those before."""
    if len(poses) < 2:
        return np.ones(len(poses))
    step = np.gradient(poses[:, :2], axis=0)
    ahead = step[:, 0] * np.cos(poses[:, 2]) + step[:, 1] * np.sin(poses[:, 2])
    return np.where(ahead >= 0.0, 1.0, -1.0)


@nb.njit(cache=True, nogil=True)
def _column(j, points, offsets, poses, forward, compared, shifts_m, neighbours, model):  # type: ignore[no-untyped-def]
    """Return the fitness (n,) of all landmarks on landmark `j`."""
    n = offsets.shape[0] - 1
    out = np.full(n, np.nan, np.float32)
    target = prepare(points[offsets[j] : offsets[j + 1]], model)
    starts = np.zeros((shifts_m.shape[0], 3))
    for i in range(n):
        if i == j:
            out[i] = 0.0
            continue
        if not compared[i]:
            continue
        source = points[offsets[i] : offsets[i + 1]]
        if abs(i - j) <= neighbours:
            known = se2.between(poses[j], poses[i])
            fit = align(target, source, known, model)
            off = se2.between(known, fit.pose)
            strays = off[0] ** 2 + off[1] ** 2 > STRAY_M**2 or abs(off[2]) > STRAY_RAD
            out[i] = model.limit_m**2 if strays else fit.fitness
            continue
        starts[:, 0] = shifts_m
        starts[:, 2] = 0.0
        if forward[i] != forward[j]:  # taught the other way round: turned about the machine's centre
            starts[:, 0] = shifts_m + 2.0 * model.centre_m
            starts[:, 2] = np.pi
        out[i] = best_of(target, source, starts, model).fitness
    return out
