"""Kernels that the pile's stages share: order statistics on scratch arrays, hits sorted into cells.

They work in place on scratch of the caller and sort nothing: an estimate takes thousands of medians.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np


@nb.njit(cache=True, nogil=True)
def select(values, count, k):  # type: ignore[no-untyped-def]
    """Return the k-th smallest (from 0) of `values[:count]` by Hoare's method; no larger ones end before it."""
    low, high = 0, count - 1
    while low < high:
        pivot = values[k]
        i, j = low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if j < k:
            low = i
        if k < i:
            high = j
    return values[k]


@nb.njit(cache=True, nogil=True)
def quantile(values, count, share):  # type: ignore[no-untyped-def]
    """Return the quantile of `values[:count]` at a share (0 … 1), linear between neighbours; the order is lost."""
    at = share * (count - 1)
    k = int(at)
    found = select(values, count, k)
    if k + 1 >= count or at == k:
        return found
    above = values[k + 1]
    for i in range(k + 2, count):
        above = min(above, values[i])
    return found + (at - k) * (above - found)


@nb.njit(cache=True, nogil=True)
def spread_about(values, count, middle):  # type: ignore[no-untyped-def]
    """Return 1.4826 times the median distance of `values[:count]` from a middle; the values are lost."""
    for i in range(count):
        values[i] = abs(values[i] - middle)
    return 1.4826 * quantile(values, count, 0.5)


@nb.njit(cache=True, nogil=True)
def weighted_median(values, weights):  # type: ignore[no-untyped-def]
    """Return the smallest value up to which lies half the weight; both arrays lose their order."""
    target = 0.0
    for weight in weights:
        target += 0.5 * weight
    low, high, below = 0, values.size - 1, 0.0
    while low < high:
        pivot = values[(low + high) // 2]
        i, j, part = low, high, 0.0
        while i <= j:
            while values[i] < pivot:
                part += weights[i]
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                weights[i], weights[j] = weights[j], weights[i]
                part += weights[i]
                i += 1
                j -= 1
        if i - j == 2:  # the one between is the pivot itself
            part -= weights[j + 1]
        if below + part >= target and j >= low:
            high = j
        elif i - j == 2 and below + part + weights[j + 1] >= target:
            return pivot
        else:
            below += part + (weights[j + 1] if i - j == 2 else 0.0)
            low = i
    return values[min(low, values.size - 1)]


@nb.njit(cache=True, nogil=True)
def cell_numbers(u, v, cell_m):  # type: ignore[no-untyped-def]
    """Return the number of the cell of each (u, v), by u and then v, and how many numbers there may be; all are finite."""
    numbers = np.zeros(u.size, np.int64)
    if u.size == 0:
        return numbers, 0
    lowest_u = highest_u = u[0]
    lowest_v = highest_v = v[0]
    for i in range(u.size):
        lowest_u, highest_u = min(lowest_u, u[i]), max(highest_u, u[i])
        lowest_v, highest_v = min(lowest_v, v[i]), max(highest_v, v[i])
    row, column = int(math.floor(lowest_u / cell_m)), int(math.floor(lowest_v / cell_m))
    width = int(math.floor(highest_v / cell_m)) - column + 1
    for i in range(u.size):
        numbers[i] = (int(math.floor(u[i] / cell_m)) - row) * width + int(math.floor(v[i] / cell_m)) - column
    return numbers, (int(math.floor(highest_u / cell_m)) - row + 1) * width


@nb.njit(cache=True, nogil=True)
def grouped(values, numbers, count):  # type: ignore[no-untyped-def]
    """Return values by their number, as they come, and where each number's begin, shape (count + 1,)."""
    at, starts, out = np.zeros(count + 1, np.int64), np.zeros(count + 1, np.int64), np.empty(values.size)
    for i in range(numbers.size):
        starts[numbers[i] + 1] += 1
    for k in range(count):
        starts[k + 1] += starts[k]
        at[k + 1] = starts[k + 1]
    for i in range(numbers.size):
        out[at[numbers[i]]] = values[i]
        at[numbers[i]] += 1
    return out, starts
