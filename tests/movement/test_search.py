"""The movement map's size is that of the paper; costs against SciPy's Dijkstra; landmarks change nothing but the time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lhdmap.messages import FloatArray
from lhdmap.movement.costs import pace_of
from lhdmap.movement.movement_map import TURN, MovementMap, movement_map
from lhdmap.movement.rules import STATE_COUNT, STATES, reversed_kind, successors
from lhdmap.movement.search import Searcher, landmarks_of
from lhdmap.movement.settings import MovementSettings
from lhdmap.movement.ways import Ways
from lhdmap.topology.model import KINDS
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from tests.movement.mines import blocked, streets

PACE = pace_of(MovementSettings())


def independent_costs(movement: MovementMap, sources: list[int]) -> FloatArray:
    """Return SciPy's least costs (N,) from any of the sources; of parallel edges it is given the cheapest."""
    edges, count = movement.edges, movement.state_count
    origin = np.repeat(np.arange(count), np.diff(edges.first))
    order = np.lexsort((edges.cost_s, edges.to, origin))
    pairs = np.stack([origin, edges.to], axis=1)[order]
    first = np.r_[True, (np.diff(pairs, axis=0) != 0).any(axis=1)]
    costs = np.maximum(edges.cost_s[order][first], 1e-300)  # SciPy takes 0 for no edge
    graph = csr_matrix((costs, (pairs[first, 0], pairs[first, 1])), shape=(count, count))
    found: FloatArray = dijkstra(graph, indices=sources, min_only=True)
    return found


def test_the_benchmark_of_the_paper_has_its_states_and_edges() -> None:
    """896 access points and 5376 states; 17 280 edges without cross drifts, 2128 more with them."""
    plain, crossed = (movement_map(streets(8, 19, crossed=c), PACE) for c in (False, True))
    assert plain.ways.point_count == 896
    assert plain.state_count == 5376
    assert len(plain.edges.to) == 17_280
    assert len(crossed.edges.to) == 17_280 + 2_128


@st.composite
def mines(draw: st.DrawFn) -> Ways:
    ways = streets(draw(st.integers(1, 4)), draw(st.integers(2, 5)), seed=draw(st.integers(0, 999)))
    ways = blocked(ways, draw(st.sampled_from([0.0, 0.2, 0.5])), draw(st.integers(0, 999)))
    bays = np.random.default_rng(draw(st.integers(0, 999))).random(ways.point_count) < 0.05
    return replace(ways, bays=bays, kind=np.where(ways.within, draw(st.integers(0, 3)), ways.kind).astype(np.int32))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(mines(), st.integers(0, 10**6), st.integers(0, 10**6))
def test_costs_are_those_of_an_independent_dijkstra_and_paths_follow_the_rules(ways: Ways, a: int, b: int) -> None:
    movement = movement_map(ways, PACE)
    source, goal = a % movement.state_count, b % movement.state_count
    wanted = independent_costs(movement, [source])
    searcher = Searcher(movement.edges, len(ways.start))
    for landmarks in (None, landmarks_of(movement)):
        path = searcher.path(np.array([source]), np.array([goal]), landmarks=landmarks)
        if path is None:
            assert np.isinf(wanted[goal])
            continue
        assert path.cost_s == pytest.approx(wanted[goal], abs=1e-9)
        assert movement.edges.cost_s[path.edges].sum() == pytest.approx(path.cost_s, abs=1e-9)
        assert_follows_rules(ways, path.states, movement.edges.way[path.edges])
    np.testing.assert_allclose(searcher.distances(np.array([source])), wanted, atol=1e-9)


def assert_follows_rules(ways: Ways, states: np.ndarray, way: np.ndarray) -> None:
    """Each state follows from the one before by the rules, over a free way between their points, or turns in a bay."""
    for before, after, one in zip(states[:-1].tolist(), states[1:].tolist(), way.tolist(), strict=True):
        (p, k), (q, m) = divmod(before, STATE_COUNT), divmod(after, STATE_COUNT)
        if one == TURN:
            assert p == q
            assert ways.bays[p]
            assert {STATES[k].motion, STATES[m].motion} == {0}
            continue
        assert ways.blocked[one] == 0
        kind = KINDS[ways.kind[one]]
        turned = (p, q) != (ways.start[one], ways.end[one])
        assert {p, q} == {ways.start[one], ways.end[one]}
        assert m in successors(k, reversed_kind(kind) if turned else kind, within=bool(ways.within[one]))


def test_several_goals_with_costs_of_their_own_and_tolls() -> None:
    movement = movement_map(streets(3, 6), PACE)
    searcher = Searcher(movement.edges, len(movement.ways.start))
    goals, extra = np.array([40, 200, 301]), np.array([90.0, 0.0, 17.0])
    wanted = independent_costs(movement, [4, 5])[goals] + extra
    path = searcher.path(np.array([4, 5]), goals, extra)
    assert path is not None
    assert path.cost_s == pytest.approx(wanted.min(), abs=1e-9)
    assert path.states[-1] == goals[wanted.argmin()]
    used = movement.edges.way[path.edges]
    toll = np.zeros(len(movement.ways.start))
    toll[used[len(used) // 2]] = np.inf
    other = searcher.path(np.array([4, 5]), goals, extra, toll)
    assert other is None or (
        other.cost_s >= path.cost_s and used[len(used) // 2] not in movement.edges.way[other.edges]
    )
    assert searcher.path(np.array([4, 5]), goals, extra).cost_s == path.cost_s  # type: ignore[union-attr]


def test_a_part_that_cannot_be_reached_is_said_with_landmarks_too() -> None:
    ways = streets(2, 8, crossed=False)
    movement = movement_map(ways, PACE)
    searcher, landmarks = Searcher(movement.edges, len(ways.start)), landmarks_of(movement)
    here, there = np.array([4]), np.array([STATE_COUNT * 4 * 8 + 4])
    assert searcher.path(here, there) is None
    guided = searcher.path(here, there, landmarks=landmarks)
    assert guided is None
    assert searcher.path(here, np.array([6 * 20 + 2]), landmarks=landmarks) is not None


def test_nothing_is_left_of_an_empty_map() -> None:
    none = np.empty(0, np.int32)
    ways = Ways(none, none, none, none.astype(bool), np.empty(0), np.empty(0), none.astype(np.int8), np.zeros(1, bool))
    movement = movement_map(ways, PACE)
    assert Searcher(movement.edges, 0).path(np.array([4]), np.array([5])) is None
