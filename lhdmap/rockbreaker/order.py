"""In which order to go to several places in least time: exact up to a dozen of them, beyond that improved step by step.

Times need not be the same both ways: the side of a piston that is fed depends on the direction.
"""

from __future__ import annotations

import numpy as np

from lhdmap.messages import FloatArray

EXACT = 12  # places up to which the best order is found; beyond it the effort doubles with each

Order = tuple[int, ...]


def order_s(order: Order, start_s: FloatArray, between_s: FloatArray, end_s: FloatArray) -> float:
    """Return the time of an order: start_s (N,) to the first, between_s (N, N) from row to column, end_s (N,) from the last."""
    if not order:
        return 0.0
    rows = np.array(order)
    return float(start_s[rows[0]] + between_s[rows[:-1], rows[1:]].sum() + end_s[rows[-1]])


def best_order(start_s: FloatArray, between_s: FloatArray, end_s: FloatArray, exact: int = EXACT) -> Order:
    """Return the order of least time, as `order_s` counts it, by dynamic programming for up to `exact` places.

    For more it is the best of the nearest-first order and what moving and turning round parts of it makes of it.
    """
    if len(start_s) == 0:
        return ()
    if len(start_s) <= exact:
        return _held_karp(start_s, between_s, end_s)
    return _improved(_nearest(start_s, between_s), start_s, between_s, end_s)


def _held_karp(start_s: FloatArray, between_s: FloatArray, end_s: FloatArray) -> Order:
    """Return the best order: least time (2^N, N) to have been at the places of a set and to stand at one of them.

    Source: Held and Karp (1962), A dynamic programming approach to sequencing problems.
    """
    count = len(start_s)
    least_s = np.full((1 << count, count), np.inf)
    before = np.full((1 << count, count), -1, dtype=np.int64)
    bits = 1 << np.arange(count)
    least_s[bits, np.arange(count)] = start_s
    for been in range(1, 1 << count):
        ways_s = least_s[been][:, None] + between_s
        last, to = np.argmin(ways_s, axis=0), np.flatnonzero(~been & bits)
        reached_s, sets = ways_s[last[to], to], been | bits[to]
        better = reached_s < least_s[sets, to]
        least_s[sets[better], to[better]] = reached_s[better]
        before[sets[better], to[better]] = last[to][better]
    been = (1 << count) - 1
    at = int(np.argmin(least_s[been] + end_s))
    order = [at]
    while before[been, at] >= 0:
        been, at = been & ~(1 << at), int(before[been, at])
        order.append(at)
    return tuple(reversed(order)) if len(order) == count else tuple(range(count))


def _nearest(start_s: FloatArray, between_s: FloatArray) -> Order:
    order = [int(np.argmin(start_s))]
    while len(order) < len(start_s):
        ways_s = between_s[order[-1]].copy()
        ways_s[order] = np.inf
        left = [one for one in range(len(start_s)) if one not in order]
        order.append(min(left, key=lambda one: float(ways_s[one])))
    return tuple(order)


def _improved(order: Order, start_s: FloatArray, between_s: FloatArray, end_s: FloatArray) -> Order:
    """Return an order that neither turning round a part of it (2-opt) nor moving one (or-opt) makes faster."""
    best, best_s = order, order_s(order, start_s, between_s, end_s)
    found = True
    while found:
        found = False
        for other in _neighbours(best):
            other_s = order_s(other, start_s, between_s, end_s)
            if other_s < best_s - 1e-9:
                best, best_s, found = other, other_s, True
                break
    return best


def _neighbours(order: Order) -> list[Order]:
    count, made = len(order), []
    for i in range(count):
        for j in range(i + 1, count + 1):
            part, rest = order[i:j], order[:i] + order[j:]
            if j - i > 1:
                made.append(order[:i] + part[::-1] + order[j:])
            if j - i <= 3:
                made += [rest[:k] + part + rest[k:] for k in range(len(rest) + 1) if k != i]
    return made
