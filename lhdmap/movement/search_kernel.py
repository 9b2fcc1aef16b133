"""Compiled search over a movement map: Dijkstra with an early stop, or A* where distances to landmarks are given.

Arrays of the workspace carry the number of the query that wrote them, so that nothing is cleared between queries.
"""

from __future__ import annotations

import numba as nb
import numpy as np


@nb.njit(cache=True, nogil=True)
def _push(keys, items, size, key, item):  # type: ignore[no-untyped-def]
    k = size
    while k > 0:
        parent = (k - 1) >> 1
        if keys[parent] <= key:
            break
        keys[k], items[k] = keys[parent], items[parent]
        k = parent
    keys[k], items[k] = key, item


@nb.njit(cache=True, nogil=True)
def _sift(keys, items, size):  # type: ignore[no-untyped-def]
    """Put the last entry (at `size`) in the place of the first, which is taken."""
    key, item = keys[size], items[size]
    k = 0
    while True:
        child = 2 * k + 1
        if child >= size:
            break
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[k], items[k] = keys[child], items[child]
        k = child
    keys[k], items[k] = key, item


@nb.njit(cache=True, nogil=True)
def _ahead(table, bounds, state):  # type: ignore[no-untyped-def]
    """Return a lower bound of what is left from a state to the goals; inf where no goal can be reached.

    `table` (N, 2 L): from each of L landmarks to the state, and from the state to it. `bounds` (2, L): the least distance from a
    landmark to a goal, the largest from a goal to it. Both differences are bounds by the triangle inequality. Infinite
    ones say more: what the landmark reaches cannot reach what it does not; a difference of two infinities says nothing.
    """
    count = bounds.shape[1]
    best = 0.0
    for k in range(count):
        from_it, to_it = table[state, k], table[state, count + k]
        if from_it < np.inf:
            best = max(best, bounds[0, k] - from_it)
        if bounds[1, k] < np.inf:
            best = max(best, to_it - bounds[1, k])
    return best


@nb.njit(cache=True, nogil=True)
def _fee(toll, way):  # type: ignore[no-untyped-def]
    return toll[way] if way >= 0 else 0.0


@nb.njit(cache=True, nogil=True)
def search(  # type: ignore[no-untyped-def]
    first, to, cost, way, toll, sources, goals, goal_costs, table, bounds, dist, ahead, state_before, edge_before,
    seen, done, goal_mark, goal_cost, keys, items, query,
):  # fmt: skip
    """Search from `sources` to the cheapest of `goals`, each with a cost of its own; return it and how many states were settled.

    `toll` (W,): what a way costs in addition; inf: not to be used. Without goals all distances are found. Returns state -1 where
    no goal is reached. `dist`, `state_before` and `edge_before` (N,) hold for the states with `seen == query`.
    """
    goal_mark[goals], goal_cost[goals] = query, goal_costs
    dist[sources], seen[sources], state_before[sources], edge_before[sources] = 0.0, query, -1, -1
    guided = bounds.shape[1] > 0
    size = 0
    for source in sources:
        ahead[source] = _ahead(table, bounds, source) if guided else 0.0
        key = ahead[source]
        _push(keys, items, size, key, source)
        size += key < np.inf
    best, best_state, settled = np.inf, -1, 0
    while size > 0 and keys[0] < best:
        state = items[0]
        size -= 1
        _sift(keys, items, size)
        if done[state] == query:
            continue
        done[state] = query
        settled += 1
        here = dist[state]
        if goal_mark[state] == query and here + goal_cost[state] < best:
            best, best_state = here + goal_cost[state], state
        for edge in range(first[state], first[state + 1]):
            after = to[edge]
            if done[after] == query:
                continue
            there = here + cost[edge] + _fee(toll, way[edge])
            known = seen[after] == query
            if not known:
                ahead[after], dist[after], seen[after] = _ahead(table, bounds, after) if guided else 0.0, np.inf, query
            if there < dist[after]:
                key = there + ahead[after]
                if key < best:
                    dist[after] = there
                    state_before[after], edge_before[after] = state, edge
                    _push(keys, items, size, key, after)
                    size += 1
    return best_state, best, settled


@nb.njit(cache=True, nogil=True)
def path_to(state, state_before, edge_before):  # type: ignore[no-untyped-def]
    """Return the states (n,) of the path that ends in `state`, and the edges (n - 1,) between them."""
    count, one = 1, state
    while state_before[one] >= 0:
        one = state_before[one]
        count += 1
    states, edges = np.empty(count, np.int64), np.empty(count - 1, np.int64)
    one = state
    for k in range(count - 1, 0, -1):
        states[k], edges[k - 1] = one, edge_before[one]
        one = state_before[one]
    states[0] = one
    return states, edges
