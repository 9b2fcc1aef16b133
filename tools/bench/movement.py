"""Routes over the paper's benchmark mine, 8 streets with 19 intersections each, and over one of a hundred times its size."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
from lhdmap.movement.costs import pace_of
from lhdmap.movement.movement_map import MovementMap, movement_map
from lhdmap.movement.rules import STATE_COUNT
from lhdmap.movement.search import Landmarks, Searcher, landmarks_of
from lhdmap.movement.settings import MovementSettings
from tests.movement.mines import ARMS, streets

from tools.evaluate.figures import Figure

_GROUP = "Routes over the movement map, corner to corner, with the path, warm"
_SMALL, _LARGE = (8, 19), (80, 190)
_PAIRS = 100


def movement_figures() -> Iterator[Figure]:
    """Measure building and searching: medians."""
    pace = pace_of(MovementSettings())
    ways, many = streets(*_SMALL), streets(*_LARGE)
    movement = movement_map(ways, pace)
    size = f"{movement.state_count} states, {len(movement.edges.to)} edges"
    yield Figure(_GROUP, "8 × 19: build", _median_ms(lambda: movement_map(ways, pace), 30), "ms", 50.0, size)
    yield Figure(_GROUP, "8 × 19: route", _route_ms(movement, _SMALL, None, 300), "ms", 0.6, "Dijkstra")
    large = movement_map(many, pace)
    size = f"{large.state_count} states, {len(large.edges.to)} edges"
    yield Figure(_GROUP, "80 × 190: build", _median_ms(lambda: movement_map(many, pace), 3), "ms", None, size)
    yield Figure(_GROUP, "80 × 190: route", _route_ms(large, _LARGE, None, 5), "ms", None, "Dijkstra")
    started = time.perf_counter()
    landmarks = landmarks_of(large)
    spent_s = time.perf_counter() - started
    yield Figure(_GROUP, "80 × 190: landmarks, once", spent_s, "s", None, f"{landmarks.table.nbytes / 2**20:.0f} MiB")
    yield Figure(_GROUP, "80 × 190: route with landmarks", _route_ms(large, _LARGE, landmarks, 15), "ms", 60.0, "A*")
    spent = _random_ms(large, landmarks)
    note = f"p95 {np.percentile(spent, 95):.1f} ms, slowest {max(spent):.1f} ms"
    yield Figure(_GROUP, "80 × 190: random pairs with landmarks", float(np.median(spent)), "ms", None, note)


def _route_ms(movement: MovementMap, size: tuple[int, int], landmarks: Landmarks | None, times: int) -> float:
    searcher = Searcher(movement.edges, len(movement.ways.start))
    first, last = ARMS - 2, ARMS * (size[0] * size[1] - 1)  # the west arm of the first, the east arm of the last
    start, goal = _standing(first), _all(last)
    assert searcher.path(start, goal, landmarks=landmarks) is not None  # warm
    return _median_ms(lambda: searcher.path(start, goal, landmarks=landmarks), times)


def _random_ms(movement: MovementMap, landmarks: Landmarks) -> list[float]:
    searcher = Searcher(movement.edges, len(movement.ways.start))
    pairs = np.random.default_rng(1).integers(0, movement.ways.point_count, (_PAIRS, 2))
    return [_median_ms(lambda a=a, b=b: searcher.path(_standing(a), _all(b), landmarks=landmarks), 1) for a, b in pairs]  # type: ignore[misc]


def _standing(point: int) -> np.ndarray:
    return STATE_COUNT * point + np.array([4, 5])


def _all(point: int) -> np.ndarray:
    return STATE_COUNT * point + np.arange(STATE_COUNT)


def _median_ms(run: Callable[[], object], times: int) -> float:
    spent = []
    for _ in range(times):
        started = time.perf_counter()
        run()
        spent.append(time.perf_counter() - started)
    return 1e3 * float(np.median(spent))
