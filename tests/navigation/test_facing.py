"""With which end first a machine comes to a goal at a dead end."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import pytest
from lhdmap.movement.routes import RouteOptions, RoutePlanner
from lhdmap.navigation.along import facing
from lhdmap.navigation.begin import Errand, Reach, route_from
from lhdmap.topology.model import Purpose

from tests.topology.maps import ladder


@pytest.mark.parametrize(
    ("purpose", "tail_m", "heading"),
    [("draw_point", 3.0, "along"), ("dump", 3.0, "along"), ("park", 6.0, "along"), ("park", 3.5, None)],
)
def test_a_machine_is_not_backed_to_where_its_tail_has_no_room(
    purpose: Purpose, tail_m: float, heading: str | None
) -> None:
    """4 m are left behind the place: with a tail of 6 m it stood before the end of the drift and was taken to be stuck."""
    topology = ladder()
    topology = replace(topology, waypoints=tuple(replace(one, purpose=purpose) for one in topology.waypoints))
    assert facing(topology, "DP1", tail_m) == heading


def test_a_point_that_is_no_place_may_be_come_to_either_way() -> None:
    assert facing(ladder(), "t1.end", 6.0) is None


class Backed:
    """A planner that knows no route with a heading at the goal."""

    def __init__(self, purpose: Purpose) -> None:
        topology = ladder()
        places = tuple(replace(one, purpose=purpose) for one in topology.waypoints)
        self.topology = replace(topology, waypoints=places)

    def route(self, _start: str, _goal: str, asked: RouteOptions) -> SimpleNamespace:
        return SimpleNamespace(feasible=asked.goal_heading is None, states=())


@pytest.mark.parametrize(("purpose", "feasible"), [("park", True), ("draw_point", False)])
def test_a_place_that_cannot_be_come_to_bucket_first_is_backed_to(purpose: Purpose, *, feasible: bool) -> None:
    planner = cast("RoutePlanner", Backed(purpose))
    assert route_from(planner, "t1.start", Errand("DP1", 0.0, ()), Reach(3.2, 6.0, 0.5)).feasible == feasible
