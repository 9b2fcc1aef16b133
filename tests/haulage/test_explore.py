"""All that can happen, gone through on the machine itself: the site that ships, on both sides of traffic, a map, faulty ones."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest
from lhdmap.errors import InputError
from lhdmap.haulage.explore import Exploration, explore
from lhdmap.haulage.layout import Layout, checked, faults_of
from lhdmap.haulage.machine import Errand, HaulageMachine
from lhdmap.haulage.of_map import layout_of_map
from lhdmap.haulage.site import find_site, load_site, shipped_sites
from lhdmap.haulage.site_layout import layout_of_site
from lhdmap.haulage.states import Event, State

from tests.haulage.plans import map_of_plan

CPU_S = 5.0


def timed(machine: HaulageMachine) -> Exploration:
    """Explore, three times at most: what else a machine does makes its CPU time longer, never shorter."""
    for _ in range(3):
        begin = time.process_time()
        found = explore(machine)
        if time.process_time() - begin < CPU_S:
            return found
    raise AssertionError(f"not within {CPU_S:.0f} s")


def assert_sound(found: Exploration) -> None:
    assert found.dead_ends == ()
    assert found.stranded == ()
    assert found.broken == ()
    assert found.sound


@pytest.mark.parametrize("name", shipped_sites())
@pytest.mark.parametrize("keeps", ["left", "right"])
def test_on_a_site_each_mission_can_always_be_finished(name: str, keeps: str) -> None:
    layout = layout_of_site(replace(load_site(find_site(name)), keeps=keeps))
    found = timed(HaulageMachine(layout))
    assert_sound(found)
    kinds = {edge.kind for edge in layout.edges}
    assert found.states == kinds | (set(State) - {*kinds, State.THROUGH})  # every state that the site has roads for


@pytest.mark.parametrize("name", ["level", "decline"])
def test_on_a_map_each_mission_can_always_be_finished(name: str) -> None:
    layout = layout_of_map(map_of_plan(name), name)
    found = timed(HaulageMachine(layout, Errand("DP1", "OP1", "P1")))
    assert_sound(found)
    assert found.states >= {State.ROAD, State.JUNCTION_OFF, State.QUEUE, State.ASSIST, State.REFUEL, State.ABORTED}


def test_each_draw_point_of_a_map_can_be_hauled_from() -> None:
    layout = checked(layout_of_map(map_of_plan("level"), "level"))
    assert len(layout.of("load")) == 10
    for load in layout.of("load"):
        for dump in layout.of("dump"):
            there, back = layout.route(load, dump), layout.route(dump, load)
            assert there
            assert back
            assert layout.edges[there[-1]].kind == layout.edges[back[-1]].kind == State.DOCK


@pytest.mark.parametrize("events", [{Event.RESET}, {Event.OPENED, Event.COMPLETED}])
def test_the_exploration_finds_a_machine_without_a_way_out(events: set[Event]) -> None:
    machine = HaulageMachine(layout_of_site(load_site(find_site("hejase"))))
    found = explore(machine, buckets=1, without=frozenset(events))
    assert found.stranded
    assert not found.sound


def without(layout: Layout, start: str, end: str) -> Layout:
    edges = tuple(edge for edge in layout.edges if (edge.start, edge.end) != (start, end))
    assert len(edges) == len(layout.edges) - 1
    return replace(layout, edges=edges)


def test_a_queue_point_without_an_exit_is_refused_in_words() -> None:
    layout = layout_of_site(load_site(find_site("hejase")))
    with pytest.raises(
        InputError, match=r"A1 queue: the queue point has no exit that does not lead through .*L1.*Add a way out"
    ):
        HaulageMachine(without(layout, "A1 queue", "A1 out"))


def test_a_site_file_without_the_exit_is_refused(tmp_path_factory: pytest.TempPathFactory) -> None:
    site = load_site(find_site("hejase"))
    areas = tuple(replace(area, exit=area.name != "A3") for area in site.areas)
    with pytest.raises(InputError, match="A3 queue: the queue point has no exit"):
        checked(layout_of_site(replace(site, areas=areas)))


def test_what_cannot_be_reached_is_refused_in_words() -> None:
    layout = without(layout_of_site(load_site(find_site("hejase"))), "A3 out back", "A1 in back")
    with pytest.raises(InputError, match=r"L1 \(load\) cannot be reached from"):
        checked(layout)


def test_a_layout_without_a_park_is_refused() -> None:
    layout = layout_of_site(load_site(find_site("hejase")))
    edges = tuple(edge for edge in layout.edges if "P1" not in (edge.start, edge.end))
    points = tuple(point for point in layout.points if point.name != "P1")
    assert "no point of purpose 'park'" in list(faults_of(replace(layout, points=points, edges=edges)))


def test_an_edge_of_the_wrong_kind_is_refused() -> None:
    layout = layout_of_site(load_site(find_site("hejase")))
    edges = tuple(edge._replace(kind=State.AREA_IN) if edge.end == "L1" else edge for edge in layout.edges)
    assert any("of kind 'dock'" in fault for fault in faults_of(replace(layout, edges=edges)))
