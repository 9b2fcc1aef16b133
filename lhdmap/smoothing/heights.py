"""Heights that close: a place that is seen again has the height that it had.

What a slope adds is not known exactly, so the height's error walks at random along the drive; each closure says how much the later
key should be higher than the earlier one: by what the floor rises between the two places. Least squares, closures that do not fit
weigh less (Huber).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse import csr_matrix, vstack
from scipy.sparse.linalg import spsolve

from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.smoothing.closures import Closure

_WALK = 0.004  # m per square root of a metre: of an inclinometer whose lag and bias are known
_SAME_M, _PER_METRE = 0.02, 0.03  # of a closure: floors are rough, and its slope is taken from both sides
_SHORTEST_M = 0.2
_HUBER = 2.0
_ROUNDS = 4
_SLOPE_KEYS = 3


def closed_heights(keys: list[KeyScan], heights_m: FloatArray, closures: list[Closure]) -> FloatArray:
    """Return by how much each key (N,) is to be raised; `heights_m` (N,) of the floor at the keys, by the inclinometer."""
    count = len(keys)
    travelled = np.array([key.travelled_m for key in keys])
    walk = 1.0 / (_WALK * np.sqrt(np.maximum(np.diff(travelled), _SHORTEST_M)))
    rows = np.arange(count - 1)
    steps = csr_matrix(
        (np.concatenate([-walk, walk]), (np.concatenate([rows, rows]), np.concatenate([rows, rows + 1]))),
        shape=(count - 1, count),
    )
    first = csr_matrix(([1e4], ([0], [0])), shape=(1, count))
    early, late = np.array([one.earlier for one in closures]), np.array([one.current for one in closures])
    offsets = np.array([one.T_earlier_current[:2] for one in closures])
    wanted = np.array([_rise_m(keys, heights_m, one) for one in closures]) - (heights_m[late] - heights_m[early])
    sigma = _SAME_M + _PER_METRE * np.hypot(offsets[:, 0], offsets[:, 1])
    raised, weight = np.zeros(count), 1.0 / sigma
    k = np.arange(len(closures))
    for _ in range(_ROUNDS):
        ties = csr_matrix(
            (np.concatenate([-weight, weight]), (np.concatenate([k, k]), np.concatenate([early, late]))),
            shape=(len(k), count),
        )
        A = vstack([first, steps, ties]).tocsr()
        b = np.concatenate([np.zeros(count), weight * wanted])
        raised = spsolve((A.T @ A).tocsc(), A.T @ b)
        misfit = np.abs(raised[late] - raised[early] - wanted) / sigma
        weight = np.sqrt(np.minimum(1.0, _HUBER / np.maximum(misfit, 1e-9))) / sigma
    return np.asarray(raised, dtype=float)


def _rise_m(keys: list[KeyScan], heights_m: FloatArray, closure: Closure) -> float:
    """Return how much the floor rises from the earlier key to where the current one is, by the slope around the earlier key."""
    low, high = max(closure.earlier - _SLOPE_KEYS, 0), min(closure.earlier + _SLOPE_KEYS, len(keys) - 1)
    way = keys[high].pose[:2] - keys[low].pose[:2]
    heading = keys[closure.earlier].pose[2]
    run = math.cos(heading) * way[0] + math.sin(heading) * way[1]
    if abs(run) < 1.0:
        return 0.0
    slope = float(heights_m[high] - heights_m[low]) / run
    return slope * float(closure.T_earlier_current[0])
