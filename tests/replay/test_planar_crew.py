"""Two machines of a crew haul and come home in plan: on routes, sections and states as in a replay, without scans."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from lhdmap.config import Settings
from lhdmap.machine import Machine
from lhdmap.mine.make_network import make_network
from lhdmap.mine.network import Network
from lhdmap.mine.plan import find_plan, load_plan
from lhdmap.mine.route import start_of
from lhdmap.replay.crew_mission import crew_mission, section_watch
from lhdmap.replay.engine import Engine
from lhdmap.replay.journal import Event, Journal
from lhdmap.replay.parking import parks_of
from lhdmap.replay.scenario import Scenario
from lhdmap.settings_tree import tree_from
from lhdmap.simulation.history import SECOND_NS, START_NS
from lhdmap.topology.model import TopologicalMap

from tests.haulage.plans import map_of_plan
from tests.replay.planar_crew import crew_processes

LIMIT_S, LONGEST_WAIT_S = 400, 100.0


def test_two_machines_haul_a_bucket_each_and_nobody_shares_a_section() -> None:
    lines, shared = run([("DP1", 1), ("DP3", 1)])
    assert not shared
    assert sorted(one.process for one in lines if (one.event, one.cause) == ("mission", "done")) == [
        "lhd2/mission",
        "mission",
    ]
    assert sorted(one.values["load"] for one in lines if one.event == "cycle") == ["DP1", "DP3"]
    assert not [one for one in lines if one.after in ("backing", "assistance") or one.event in ("closed", "refused")]
    assert 0.0 < max(waits_s(lines)) < LONGEST_WAIT_S


def run(errands: list[tuple[str, int]]) -> tuple[list[Event], list[dict[str, Any]]]:
    """Return the journal and the sections that were shared, of machines with draw points and numbers of buckets."""
    told = [{"machine": k, "from": name, "to": "OP1", "buckets": n} for k, (name, n) in enumerate(errands, start=1)]
    table = {"kind": "mission", "mine": "branches", "machines": len(errands), "start": "P1", "mission": told}
    scenario = tree_from(Scenario, table)
    network, topology = make_network(load_plan(find_plan("branches"))), faced_in(map_of_plan("branches"))
    crew, starts = crew_of(scenario, network, topology)
    journal, lines = Journal(), list[Event]()
    journal.listeners.append(lines.append)
    given = crew_mission(scenario, crew)
    watch = section_watch(given, crew, journal.of("crew/monitor"))
    engine = Engine([*crew_processes(scenario, given, topology, starts, journal), watch], journal)
    for _ in engine.run(START_NS + LIMIT_S * SECOND_NS):
        if sum((one.event, one.cause) == ("mission", "done") for one in lines) == len(errands) or watch.shared:
            break
    return lines, watch.shared


def crew_of(scenario: Scenario, network: Network, topology: TopologicalMap) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what a crew's mission wants of the parts of each machine, and where each stands, on the drawn map of the plan."""
    machine = Machine()
    crew, starts = {}, {}
    for number, park in enumerate(parks_of(scenario, network), start=1):
        begin = start_of(network, machine, park)
        x, y, _, yaw = network.tubes[begin.tube].pose(begin.at_m, begin.facing).tolist()
        autonomous = SimpleNamespace(known=SimpleNamespace(topology=topology))
        crew[f"lhd{number}"] = SimpleNamespace(
            park=park, T_mine_map=None, autonomous=autonomous, machine=machine, settings=Settings(),
            start=SimpleNamespace(yaw_rad=yaw),
        )  # fmt: skip
        starts[f"lhd{number}"] = np.array([x, y, yaw])
    return crew, starts


def faced_in(topology: TopologicalMap) -> TopologicalMap:
    """Return a drawn map with parks that head into their dead ends, as the way to them tells on a taught one."""
    turned = np.array([0.0, 0.0, 0.0, math.pi])
    points = (replace(one, pose=one.pose + turned) if one.purpose == "park" else one for one in topology.waypoints)
    return replace(topology, waypoints=tuple(points))


def waits_s(lines: list[Event]) -> list[float]:
    """Return how long each machine waited each time, s."""
    found, since = [], dict[str, int]()
    for one in lines:
        if one.event == "state" and one.process.endswith("navigation"):
            if one.after == "waiting":
                since[one.process] = one.t_ns
            elif one.process in since:
                found.append((one.t_ns - since.pop(one.process)) / SECOND_NS)
    return found
