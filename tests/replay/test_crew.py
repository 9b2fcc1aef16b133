"""Several machines of a mission: namespaces, who works where, the verdict of all."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import pytest
from lhdmap.errors import ConfigError, UsageError
from lhdmap.mine.make_network import make_network
from lhdmap.mine.plan import find_plan, load_plan
from lhdmap.replay.bus import Bus
from lhdmap.replay.crew_parts import errands_of
from lhdmap.replay.engine import Engine
from lhdmap.replay.journal import Event, Journal
from lhdmap.replay.judges import Judges
from lhdmap.replay.namespace import InNamespace, JournalOf, only, topic_of
from lhdmap.replay.parking import parks_of
from lhdmap.replay.parts import Nearness, Touch
from lhdmap.replay.process import STATE, Outgoing, Process, Received
from lhdmap.replay.processes.monitor import Monitor
from lhdmap.replay.scenario import Limits, Scenario
from lhdmap.replay.verdict import Tally
from lhdmap.settings_tree import tree_from
from lhdmap.simulation.history import START_NS

from tests.replay.doubles import Unicycle

SECOND_NS = 1_000_000_000


def scenario(**table: Any) -> Scenario:
    mission = [{"from": "DP1", "to": "OP1"}, {"machine": 2, "from": "DP2", "to": "OP1", "buckets": 2}]
    return tree_from(Scenario, {"kind": "mission", "mine": "branches", "machines": 2, "mission": mission, **table})


class Echo(Process):
    """Says what it hears."""

    name, period_ns, reads = "echo", 10_000_000, ("/in",)

    def __init__(self, scribe: Any) -> None:
        self.heard: list[Any] = []
        self._scribe = scribe

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        self.heard += [one.message for one in inbox if one.topic == "/in"]
        self._scribe.goes(f"heard {len(self.heard)}")
        yield Outgoing("/in", len(self.heard))


def test_machines_hear_their_own_topics_alone_and_their_lines_carry_them() -> None:
    journal, lines, second = Journal(), list[Event](), list[Event]()
    journal.listeners += [lines.append, only("lhd2", second.append)]
    echoes = [Echo(journal.of("echo")), Echo(JournalOf(journal, "lhd2").of("echo"))]
    engine = Engine([echoes[0], InNamespace(echoes[1], "lhd2")], journal)
    list(engine.run(START_NS + 50_000_000))
    assert echoes[0].heard == echoes[1].heard == [0, 1, 2, 3, 4]
    assert {one.process for one in lines} == {"echo", "lhd2/echo"}
    assert {one.process for one in second} == {"echo"}
    assert len(second) == len(lines) / 2


def test_the_truth_of_a_machine_stays_truth() -> None:
    assert topic_of("lhd2", STATE) == "/ground_truth/lhd2/state"
    assert topic_of("lhd2", "/lidar/front/scan") == "/lhd2/lidar/front/scan"
    assert topic_of("", STATE) == STATE
    curious = Echo(Journal().of("echo"))
    curious.reads = (STATE,)
    with pytest.raises(ValueError, match="may not see /ground_truth/lhd2/state"):
        Bus([InNamespace(curious, "lhd2")], None)


def test_each_machine_has_a_park_and_errands() -> None:
    network = make_network(load_plan(find_plan("branches")))
    assert parks_of(scenario(start="P2", machines=3), network) == ["P2", "P1", "P3"]
    own = errands_of(scenario(machines=3), ["lhd1", "lhd2", "lhd3"])
    assert [(one[0].source, one[0].buckets) for one in own.values()] == [("DP1", 1), ("DP2", 2), ("DP1", 1)]


def test_what_cannot_be_is_refused() -> None:
    network = make_network(load_plan(find_plan("cycle")))
    with pytest.raises(UsageError, match="machines = 2: each needs a place to park, mine 'cycle' has 1: P1"):
        parks_of(scenario(), network)
    with pytest.raises(UsageError, match="mission: machine = 2, there are 1"):
        errands_of(scenario(machines=1), ["lhd1"])
    two = [{"from": "DP1", "to": "OP1"}, {"from": "DP2", "to": "OP1"}]
    with pytest.raises(UsageError, match="mission of lhd1: one draw point and one dump were wanted"):
        errands_of(scenario(mission=two), ["lhd1", "lhd2"])
    with pytest.raises(ConfigError, match="several have a mission"):
        tree_from(Scenario, {"mine": "cycle", "machines": 2})


def judged(*limits: Limits) -> tuple[Judges, list[Monitor]]:
    journal = Journal()
    monitors = [Monitor(Tally("mission", one), journal.of("monitor")) for one in limits]
    return Judges({f"lhd{k}": one for k, one in enumerate(monitors, start=1)}), monitors


def at(monitor: Monitor, seconds: float, x_m: float) -> None:
    monitor.tally.at(Unicycle(START_NS + round(seconds * SECOND_NS), x_m))
    monitor.tally.judge(START_NS + round(seconds * SECOND_NS))


def test_who_waits_for_another_that_moves_is_not_stuck_and_two_that_stand_are() -> None:
    limits = Limits(no_progress_s=10.0)
    judges, (waits, moves) = judged(limits, limits)
    for second in range(30):
        at(moves, second, float(second))
        at(waits, second, 0.0)
    before = judges.ended
    for second in range(30, 42):
        at(moves, second, 29.0)
        at(waits, second, 0.0)
    assert (before, judges.ended) == (False, True)
    assert judges.reason.startswith("lhd")
    assert "no progress" in judges.reason


def test_the_run_ends_with_the_last_that_is_done_or_the_first_that_fails() -> None:
    judges, (one, other) = judged(Limits(), Limits())
    for monitor in (one, other):
        at(monitor, 0.0, 0.0)
    one.tally.said(START_NS, "done")
    at(one, 1.0, 0.0)
    assert (one.ended, judges.ended) == (True, False)
    other.tally.near(START_NS + SECOND_NS, Nearness((Touch("bucket with lhd1 rear", (1.0, 2.0, 0.5), 0.1),)))
    at(other, 1.0, 0.0)
    assert (judges.ended, judges.ok) == (True, False)
    assert judges.reason.startswith("lhd2: contact: bucket with lhd1 rear")
    told = judges.verdict(START_NS + SECOND_NS, [], 1.0, "", {})
    assert [contact["machine"] for contact in told["contacts"]] == ["lhd2"]
    told_of = [(each["machine"], each["ok"], each["contacts"]) for each in told["machines"]]
    assert told_of == [("lhd1", True, 0), ("lhd2", False, 1)]
