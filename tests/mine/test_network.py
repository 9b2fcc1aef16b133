"""Networks: where drifts join and where they pass, what a junction's branches are, and turns that a machine can take."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from lhdmap.errors import ConfigError
from lhdmap.mine.network import Network
from lhdmap.mine.plan import find_plan, load_plan

from tests.mine.plans import TEE, lines, network_of


def degrees(network: Network) -> list[int]:
    return sorted(node.degree for node in network.nodes)


def test_a_tee_has_one_intersection_and_three_dead_ends() -> None:
    network = network_of(TEE)
    assert degrees(network) == [1, 1, 1, 3]
    assert sum(edge.length_m for edge in network.edges) == pytest.approx(130.0, abs=0.1)
    node = next(node for node in network.nodes if node.degree == 3)
    assert node.position_m == pytest.approx([40.0, 0.0, 0.0], abs=0.05)


@pytest.mark.parametrize(
    ("table", "found"),
    [
        (lines(("A", [[0, 0, 0], [80, 0, 0]]), ("B", [[40, -40, 0], [40, 40, 0.4]])), [1, 1, 1, 1, 4]),
        (lines(("A", [[0, 0, 0], [80, 0, 0]]), ("B", [[40, 0.4, 0], [40, 40, 0]])), [1, 1, 1, 3]),
        (lines(("A", [[0, 0, 0], [80, 0, 0]]), ("B", [[40, 1.5, 0], [40, 40, 0]])), [1, 1, 1, 1]),
        (lines(("A", [[0, 0, 0], [80, 0, 0]]), ("B", [[40, -40, 4], [40, 40, 4]])), [1, 1, 1, 1]),
        (lines(("A", [[0, 0, 0], [80, 0, 0]]), ("B", [[80, 0, 0], [120, 20, 0]])), [1, 1, 2]),
        (lines(("A", [[0, 0, 0], [60, 0, 0], [60, 60, 0], [0, 60, 0], [0, 0, 0]])), [2]),
    ],
)  # fmt: skip
def test_lines_join_where_they_meet_in_space(table: dict[str, Any], found: list[int]) -> None:
    assert degrees(network_of(table)) == found


def test_a_corner_that_is_named_is_joined_where_it_is_rounded() -> None:
    network = network_of(lines(("A", [[0, 0, 0], [60, 0, 0], [60, 60, 0]]), ("B", [[60, 0, 0], [100, -40, 0]])))
    node = next(node for node in network.nodes if node.degree == 3)
    assert (
        np.linalg.norm(
            node.position_m - [60.0 - 12.0 * (1 - math.cos(math.pi / 4)), 12.0 * (1 - math.sin(math.pi / 4)), 0.0]
        )
        < 0.1
    )


def test_lines_that_can_neither_join_nor_pass_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"'A' and 'B' cross 1\.5 m above each other at \(40, 0\)"):
        network_of(lines(("A", [[0, 0, 0], [80, 0, 0]]), ("B", [[40, -40, 1.5], [40, 40, 1.5]])))


def test_meetings_that_lie_close_together_are_one_node() -> None:
    both = lines(("A", [[0, 0, 0], [80, 0, 0]]), ("B", [[40, 0, 0], [40, 40, 0]]), ("C", [[42, 0, 0], [42, -40, 0]]))
    assert degrees(network_of(both)) == [1, 1, 1, 1, 4]
    apart = lines(("A", [[0, 0, 0], [80, 0, 0]]), ("B", [[36, 0, 0], [36, 40, 0]]), ("C", [[44, 0, 0], [44, -40, 0]]))
    assert degrees(network_of(apart)) == [1, 1, 1, 1, 3, 3]


def test_turns_have_the_radius_of_their_corner() -> None:
    network = network_of(TEE, junction=[{"at": [40, 0, 0], "corner_m": 5.0}])
    turns = [turn for turn in network.turns if turn.tube >= 0]
    assert len(turns) == 4  # two ways, both directions
    for turn in turns:
        assert turn.radius_m == pytest.approx(5.0 + 2.25, rel=0.02)
        line = network.tubes[turn.tube].line
        assert np.abs(line.curvature_pm).max() == pytest.approx(1.0 / 7.25, rel=0.02)


def test_a_junction_may_keep_its_corners() -> None:
    network = network_of(TEE, junction=[{"at": [40, 0, 0], "corner_m": 0.0, "name": "X"}])
    assert [turn.tube for turn in network.turns] == [-1, -1]
    assert [node.name for node in network.nodes if node.degree == 3] == ["X"]


def test_a_junction_that_is_none_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"\[\[junction\]\] at = \[10\.0, 0\.0, 0\.0\]: no drifts join"):
        network_of(TEE, junction=[{"at": [10, 0, 0]}])


def place(**values: Any) -> list[dict[str, Any]]:
    return [{"drift": "A", "at_m": 20.0, "name": "P", **values}]


def test_a_draw_point_is_a_branch_and_a_niche_is_none() -> None:
    assert degrees(network_of(TEE, place=place(kind="draw_point"))) == [1, 1, 1, 1, 3, 3]
    assert degrees(network_of(TEE, place=place(kind="niche"))) == [1, 1, 1, 3]


def test_a_slanting_draw_point_is_open_to_the_side_that_it_leans_away_from() -> None:
    network = network_of(TEE, place=place(kind="draw_point", angle_deg=60.0))
    index = network.tube("P")
    turns = [turn for turn in network.turns if turn.end.tube == index]
    assert [turn.start.outward for turn in turns] == [-1]  # from the beginning of A, by 60 degrees


def test_a_passing_bay_widens_its_drift() -> None:
    drift = network_of(TEE, place=place(kind="passing_bay", length_m=20.0, width_m=3.0)).tubes[0]
    assert [drift.half_width_m(s) for s in (5.0, 20.0, 35.0)] == pytest.approx([2.25, 3.75, 2.25])


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"at_m": 90.0, "kind": "niche"}, "at_m = 90 is not on drift 'A', which is 80.0 m long"),
        ({"drift": "AA", "kind": "niche"}, "drift = 'AA' is not in the plan; did you mean 'A'"),
        ({"kind": "nich"}, "one of draw_point"),
        ({"kind": "niche", "name": "B"}, "two drifts or places have it"),
        ({"kind": "niche", "site": "left"}, "unknown setting 'site'; did you mean 'side'"),
    ],
)
def test_wrong_places_are_refused(values: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigError, match=told.replace("(", r"\(")):
        network_of(TEE, place=place(**values))


@pytest.mark.parametrize(("name", "intersections", "length_m"), [("ring", 2, (600, 800)), ("level", 12, (600, 1000))])
def test_the_plans_that_ship(name: str, intersections: int, length_m: tuple[float, float]) -> None:
    from lhdmap.mine.make_network import make_network

    network = make_network(load_plan(find_plan(name)))
    assert sum(node.degree > 2 for node in network.nodes) == intersections
    assert length_m[0] < sum(edge.length_m for edge in network.edges) < length_m[1]
