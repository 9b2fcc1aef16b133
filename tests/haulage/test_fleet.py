"""Several missions under section control: nobody shares a section, all buckets are dumped, who cannot load makes way."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from lhdmap.haulage.fleet import Fleet
from lhdmap.haulage.layout import Layout
from lhdmap.haulage.machine import NOWHERE, Errand
from lhdmap.haulage.mission_io import Buckets, MissionInput, MissionOutput
from lhdmap.haulage.records import Phase
from lhdmap.haulage.site import find_site, load_site
from lhdmap.haulage.site_layout import layout_of_site
from lhdmap.haulage.states import State
from lhdmap.traffic.sections import Leg, Place

from tests.haulage.drives import Drive

PARKS = ("P1", "P2", "P3")


@pytest.fixture(scope="module")
def site() -> Layout:
    """The paper's site with two more parks, and checkpoints on the road."""
    given = load_site(find_site("hejase"))
    load = given.areas[0]
    park = load.places[1]
    second = replace(park, name="P2", pose=(46.0, 26.0, 90.0), out=((46.0, 42.0), (20.0, 42.0), (20.0, 2.1)))
    third = replace(park, name="P3", pose=(58.0, -26.0, -90.0), out=((58.0, -42.0), (20.0, -42.0), (20.0, 2.1)))
    area = replace(load, places=(*load.places, second, third))
    road = replace(given.road, checkpoint_m=60.0)
    return layout_of_site(replace(given, areas=(area, given.areas[1]), road=road))


class _Machine(Drive):
    """A machine of a fleet: its mission is that of the fleet, which tells it what to do."""

    def __init__(self, layout: Layout, fleet: Fleet, name: str) -> None:
        super().__init__(layout)
        self.task = fleet.tasks[name]

    def told(self, orders: tuple[Buckets, ...]) -> MissionInput:
        return self.inputs(orders)

    def follows(self, output: MissionOutput) -> None:
        self.follow(output)


def fleet_of(layout: Layout, count: int) -> tuple[Fleet, dict[str, _Machine]]:
    errands = {f"m{k}": Errand("L1", "D1", PARKS[k]) for k in range(count)}
    fleet = Fleet(layout, errands)
    return fleet, {name: _Machine(layout, fleet, name) for name in errands}


def tick(layout: Layout, fleet: Fleet, machines: dict[str, _Machine], told: dict[str, MissionInput]) -> bool:
    """Let all drive on; return whether all are parked and done."""
    outputs = fleet.update(told)
    for name, one in machines.items():
        one.follows(outputs[name])
    nodes = [held(layout, one) for one in machines.values()]
    assert all(a != b for a, b in combinations(nodes, 2)), nodes
    return all(one.state == State.IDLE and not one.left for one in outputs.values()) and bool(machines["m0"].cycles)


def run(
    layout: Layout, buckets: dict[str, int], hours: float, seed: int | None = None
) -> tuple[Fleet, dict[str, _Machine]]:
    """Run until all is done; with a seed obstacles come and go in front of each machine."""
    fleet, machines = fleet_of(layout, len(buckets))
    orders = {name: (Buckets("L1", "D1", count),) for name, count in buckets.items()}
    random, until = np.random.default_rng(seed or 0), dict.fromkeys(buckets, 0)
    for number in range(int(hours * 36_000)):
        told = {name: one.told(orders[name]) for name, one in machines.items()}
        for name in buckets if seed is not None else ():
            if number % 100 == 0 and random.random() < 0.3:
                until[name] = number + int(random.integers(10, 300))
            told[name] = told[name]._replace(obstacle=number < until[name])
        if tick(layout, fleet, machines, told):
            break
    return fleet, machines


def held(layout: Layout, one: _Machine) -> str:
    edge = one.task.status.edge
    assert edge != NOWHERE
    return layout.edges[edge].node


@pytest.mark.parametrize("seed", [None, 3])
def test_three_machines_dump_all_their_buckets_and_never_share_a_section(site: Layout, seed: int | None) -> None:
    fleet, machines = run(site, {"m0": 2, "m1": 1, "m2": 1}, 2.0, seed)
    assert {name: len(one.cycles) for name, one in machines.items()} == {"m0": 2, "m1": 1, "m2": 1}
    assert set(fleet.control.held()) >= {"P1", "P2", "P3"}
    assert any(one.cycles[0].seconds(Phase.TRAFFIC, Phase.QUEUE_LOAD) > 0.0 for one in machines.values())


def test_a_machine_alone_is_never_held(site: Layout) -> None:
    _, machines = run(site, {"m0": 1}, 1.0)
    waits = sum(one.seconds(Phase.TRAFFIC, Phase.QUEUE_LOAD, Phase.QUEUE_DUMP) for one in machines["m0"].cycles)
    assert len(machines["m0"].cycles) == 1
    assert waits < 3.0


def test_a_machine_that_was_let_home_alone_makes_way_and_then_takes_up_its_next_bucket(site: Layout) -> None:
    fleet, machines = fleet_of(site, 1)
    orders, one, parked = (Buckets("L1", "D1", 2),), machines["m0"], 0
    for _ in range(36_000):
        done = tick(site, fleet, machines, {"m0": one.told(orders)})
        place = fleet.control.place("m0")
        if place == Place(Leg.EMPTY, "A3 out") and len(one.cycles) == 1 and not parked:
            cycle = fleet.control.claims.cycles[0]  # as if the next cycle had been refused at the dump
            fleet.control._at = (cycle.places.index(Place(Leg.HOME, "A3 out")),)
            parked = 1
        parked += one.states[-1] == State.REFUEL
        if done:
            break
    assert parked > 1
    assert len(one.cycles) == 2
    assert one.cycles[1].seconds(Phase.REFUEL) == 0.0
    assert one.cycles[1].seconds(Phase.PARK) > 0.0
