"""Sections that machines can hold: arms for changes of gear, short ones joined, places of work alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np
import pytest
from lhdmap.errors import UsageError
from lhdmap.haulage.fleet import Fleet
from lhdmap.haulage.joining import Drives, check_pull_back, ways_of, with_sections
from lhdmap.haulage.layout import Layout, checked
from lhdmap.haulage.machine import Errand
from lhdmap.haulage.of_map import layout_of_map
from lhdmap.navigation.hold import ROOM_M, Hold, hold_of
from lhdmap.navigation.leg import Leg, Target
from lhdmap.topology.model import TopologicalMap

from tests.haulage.plans import map_of_plan

LEAST_M = 15.0
ERRANDS = {"lhd1": Errand("DP1", "OP1", "P1"), "lhd2": Errand("DP2", "OP1", "P2"), "lhd3": Errand("DP3", "OP1", "P3")}


@pytest.fixture(scope="module")
def topology() -> TopologicalMap:
    return map_of_plan("branches")


@pytest.fixture(scope="module")
def layout(topology: TopologicalMap) -> Layout:
    return checked(layout_of_map(topology, "branches"))


def leg(nodes: Sequence[str], points: Sequence[str], *, inversion: bool = False, begin_m: float = 10.0) -> Leg:
    """Return a leg through nodes of 20 m each that end at points."""
    ends = zip(nodes, points, strict=True)
    targets = tuple(
        Target(point, node, begin_m + 20.0 * k, np.zeros(4), False) for k, (node, point) in enumerate(ends, 1)
    )
    return Leg(-1, np.zeros((2, 6)), targets[-1].at_m, targets[-1].at_m, targets, inversion, begin_m=begin_m)


def sections_on(layout: Layout, start: str, goal: str) -> list[tuple[str, float]]:
    route = layout.route(start, goal)
    assert route is not None
    edges = [layout.edges[layout.entering[start][0]], *(layout.edges[k] for k in route)]
    return [(name, sum(one.length_m for one in group)) for name, group in groupby(edges, key=lambda edge: edge.held)]


def no_turns() -> Drives:
    return {way: () for errand in ERRANDS.values() for way in ways_of(errand)}


def test_the_arm_of_a_change_of_gear_is_held_with_its_intersection(topology: TopologicalMap, layout: Layout) -> None:
    turns = leg(["T1.5", "I4", "T1.4", "I3", "T1.3", "I2", "T1.2", "I1"], [""] * 7 + ["I1.T1.1.1"], inversion=True)
    made = with_sections(layout, topology, ERRANDS, {**no_turns(), ("DP1", "OP1"): [turns]}, 0.0)
    held = {edge.node: edge.held for edge in made.edges}
    assert held["I1"] == "I1+T1.1"
    assert {node: name for node, name in held.items() if "+" not in name}.keys() == set(held) - {"I1"}


def test_a_stub_in_which_machines_turn_may_be_entered_with_its_intersection(
    topology: TopologicalMap, layout: Layout
) -> None:
    """No way of the map leads through it, so that no edge tells it."""
    turns = leg(["T1.2", "I1"], [""] * 1 + ["I1.T1.1.1"], inversion=True)
    errands = {"lhd1": ERRANDS["lhd1"]}
    drives: Drives = dict.fromkeys(ways_of(errands["lhd1"]), ()) | {("DP1", "OP1"): [turns]}
    fleet = Fleet(with_sections(layout, topology, errands, drives, 0.0), errands)
    now_ns = 0
    for section in ("T1.3", "T1.5"):
        assert section not in fleet.nodes_of("lhd1")
    while "I1" not in fleet.nodes_of("lhd1") and now_ns < 50:
        now_ns += 1
        fleet.control.left("lhd1")
        fleet.control.wants("lhd1", now_ns)
        fleet.control.step(now_ns)
    assert {"I1", "T1.1"} <= fleet.nodes_of("lhd1")


def test_each_section_between_two_others_has_room_for_a_machine(topology: TopologicalMap, layout: Layout) -> None:
    made = with_sections(layout, topology, ERRANDS, no_turns(), LEAST_M)
    for start, goal in no_turns():
        parts = sections_on(made, start, goal)
        assert all(length_m >= LEAST_M for _, length_m in parts[1:-1]), parts
    works = {made.edges[made.entering[point][0]].held for errand in ERRANDS.values() for point in errand}
    assert works == {"T1.5", "X2", "X3", "T2", "B1", "B2", "B3"}
    Fleet(made, ERRANDS)  # nobody is always in another one's way


def test_a_section_in_which_a_way_changes_gear_is_not_short_on_it(topology: TopologicalMap, layout: Layout) -> None:
    """It is wholly in the arm there, whatever the way through the intersection measures."""
    turns = [leg(["I2", "T1.2", "I1"], [""] * 2 + ["I1.T1.1.1"], inversion=True)]
    made = {
        name: with_sections(layout, topology, {"lhd3": ERRANDS["lhd3"]}, {("OP1", "DP3"): legs}, LEAST_M)
        for name, legs in (("turns", turns), ("passes", []))
    }
    lengths = {name: dict(sections_on(one, "OP1", "DP3")) for name, one in made.items()}
    assert lengths["turns"]["I1+T1.1"] < LEAST_M
    assert all(length_m >= LEAST_M for length_m in list(lengths["passes"].values())[1:-1])


def test_a_change_of_gear_where_another_one_works_is_refused(topology: TopologicalMap, layout: Layout) -> None:
    turns = leg(["T1.3", "I2"], ["", "I2.B1.0"], inversion=True)
    with pytest.raises(UsageError, match="from DP1 to OP1 machines change gear in B1, where another one may stand"):
        with_sections(layout, topology, ERRANDS, {**no_turns(), ("DP1", "OP1"): [turns]}, 0.0)


def test_a_draw_point_without_room_to_pull_back_in_is_refused(layout: Layout) -> None:
    behind_m = min(layout.edges[layout.entering[point][0]].length_m for point in ("DP1", "DP2", "DP3"))
    check_pull_back(layout, ERRANDS, behind_m - 0.1)
    with pytest.raises(
        UsageError, match=r"draw point DP\d: its section .* has .* m behind it, a machine that pulls back"
    ):
        check_pull_back(layout, ERRANDS, behind_m + 0.1)


def test_a_short_section_between_two_places_of_work_is_refused() -> None:
    topology = map_of_plan("cycle")
    layout = checked(layout_of_map(topology, "cycle"))
    errands: Mapping[str, Errand] = {"lhd1": Errand("DP1", "OP1", "P1")}
    drives: Drives = dict.fromkeys(ways_of(errands["lhd1"]), ())
    with pytest.raises(UsageError, match=r"section I1 between .* is shorter than a machine needs"):
        with_sections(layout, topology, errands, drives, 200.0)


@pytest.mark.parametrize(
    ("at_m", "free", "expected"),
    [
        (12.0, None, Hold()),
        (12.0, {"T1.3", "I2", "B1"}, Hold()),
        (12.0, {"T1.3"}, Hold(30.0 - 4.0, "I2")),
        (29.5, {"T1.3"}, Hold(30.0 - 4.0, "I2")),  # past its mark, not yet in it: it stops now
        (31.0, {"T1.3"}, Hold(50.0 - 4.0, "B1")),  # it is in I2 already; the next one counts
        (12.0, {"T1.3", "I2"}, Hold(50.0 - 4.0, "B1")),  # what the end of the leg reaches into
    ],
)
def test_a_machine_holds_before_the_first_node_that_is_not_its_own(
    topology: TopologicalMap, at_m: float, free: set[str] | None, expected: Hold
) -> None:
    assert hold_of(topology, leg(["T1.3", "I2"], ["", "I2.B1.0"]), at_m, free, 3.0 + ROOM_M) == expected
