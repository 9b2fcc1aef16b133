"""Order, latency, overruns, bounded inboxes: against what the clock of each process says by arithmetic."""

from __future__ import annotations

import time

import pytest
from lhdmap.replay.engine import Engine
from lhdmap.replay.faults import Faults
from lhdmap.replay.journal import Event, Journal
from lhdmap.replay.process import EVERYWHERE
from lhdmap.simulation.history import START_NS
from lhdmap.simulation.sensing.faults import FaultSettings

from tests.replay.doubles import Ticker, texts

MS = 1_000_000


def run(processes: list[Ticker], for_ms: float, *, faults: tuple[FaultSettings, ...] = ()) -> list[Event]:
    journal, events = Journal(), list[Event]()
    journal.listeners.append(events.append)
    engine = Engine(processes, journal, faults=Faults(faults, journal))
    for _ in engine.run(START_NS + round(for_ms * MS)):
        pass
    engine.finish()
    return events


def test_turns_come_at_their_period_and_in_one_order() -> None:
    order: list[tuple[int, str]] = []
    processes = [
        Ticker("b", 30.0, priority=1),
        Ticker("c", 20.0, priority=0),
        Ticker("a", 30.0, priority=1),
    ]
    for one in processes:
        one.on_turn = lambda now_ns, name=one.name: order.append((now_ns - START_NS, name))  # type: ignore[misc]
    run(processes, 60.0)
    expected = [
        (t * MS, name) for t in range(0, 61, 10) for name, every in (("c", 20), ("a", 30), ("b", 30)) if t % every == 0
    ]
    assert order == expected


def test_a_message_without_latency_is_there_for_who_comes_later_at_the_same_time() -> None:
    first, before = Ticker("z", 20.0, "/x", priority=5), Ticker("a", 20.0, priority=1, reads=("/x",))
    after = Ticker("b", 20.0, priority=9, reads=("/x",))
    run([first, before, after], 40.0)
    assert texts(after) == ["1", "2", "3"]
    assert texts(before) == ["1", "2"]


def test_latency_delays_what_a_process_says() -> None:
    slow, reader = Ticker("slow", 20.0, "/x", latency_ns=15 * MS), Ticker("reader", 1.0, reads=("/x",))
    run([slow, reader], 60.0)
    assert [now_ns - START_NS for now_ns, _ in reader.got] == [15 * MS, 35 * MS, 55 * MS]
    assert all(now_ns == one.sent_ns for now_ns, one in reader.got)
    assert len(slow.turns) == 4


def test_a_busy_process_misses_its_turns() -> None:
    slow = Ticker("slow", 10.0, latency_ns=25 * MS)
    events = run([slow], 100.0)
    assert [now_ns - START_NS for now_ns in slow.turns] == [0, 30 * MS, 60 * MS, 90 * MS]
    assert [(one.event, one.values.get("missed")) for one in events][:2] == [("overrun", None), ("on time", 2)]


def test_an_injected_overrun_takes_its_size_and_ends() -> None:
    fault = FaultSettings(kind="overrun", target="worker", at_s=0.1, duration_s=0.1, size=0.045)
    worker, other = Ticker("worker", 10.0), Ticker("other", 10.0)
    events = run([worker, other], 300.0, faults=(fault,))
    turns = [(now_ns - START_NS) // MS for now_ns in worker.turns]
    assert turns == [*range(0, 101, 10), 150, *range(200, 301, 10)]  # 45 ms end before the turns at 150 and 200
    assert len(other.turns) == 31
    assert [one.event for one in events if one.process == "faults"] == ["begins", "ends"]


def test_an_inbox_is_bounded_and_what_is_lost_is_told() -> None:
    source, sink = Ticker("source", 1.0, "/x"), Ticker("sink", 100.0, reads=("/x",), inbox_size=10, priority=99)
    events = run([source, sink], 100.0)
    assert texts(sink) == ["1", *map(str, range(92, 102))]
    assert [one.values["lost"] for one in events if one.event == "inbox full"] == [90]


def test_names_are_unlike() -> None:
    with pytest.raises(ValueError, match="one name"):
        Engine([Ticker("a"), Ticker("a")], Journal())


def test_the_engine_costs_little() -> None:
    """300 messages a second, three readers of each, turns at 100, 50 and 20 Hz: at most 5 ms of CPU a simulated second."""
    sources = [Ticker(f"source {k}", 10.0, f"/x{k}", priority=k) for k in range(3)]
    reads = tuple(f"/x{k}" for k in range(3))
    sinks = [Ticker(f"sink {k}", 20.0 + 15.0 * k, reads=reads, site=EVERYWHERE) for k in range(3)]
    journal = Journal()
    engine = Engine([*sources, *sinks], journal)
    best = 1.0
    for second in range(1, 11):
        before = time.process_time()
        for _ in engine.run(START_NS + second * 1000 * MS):
            pass
        best = min(best, time.process_time() - before)
    assert best < 0.005 * 3  # what the test's own processes do is in it, and a loaded machine
