"""Same scenario and seed, same journal to the bit: in one process, in others with other threads; and truth is not needed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from lhdmap.replay.assemble import Watchers, assemble
from lhdmap.replay.bus import Bus
from lhdmap.replay.journal import Event, Journal
from lhdmap.replay.process import EVERYTHING, STATE, TRUTH
from lhdmap.replay.processes.film import Film

from tests.replay.doubles import Blind, Straight, Ticker, parts
from tests.replay.runs import go, scenario

ROOT = Path(__file__).resolve().parents[2]
FAULTS = [
    {"kind": "noisy", "at_s": 1.0, "duration_s": 1.0, "target": "/machine/tachometer", "size": 0.3},
    {"kind": "link_degraded", "at_s": 2.0, "duration_s": 1.0, "target": "link", "size": 0.4},
    {"kind": "overrun", "at_s": 3.0, "duration_s": 0.5, "target": "perception", "size": 0.2},
    {"kind": "dead", "at_s": 4.0, "duration_s": 0.5, "target": "/lidar/front/scan"},
]
IN_A_PROCESS = """
import sys
from pathlib import Path
from tests.replay.test_same_bytes import journal
journal(Path(sys.argv[1]), seed=int(sys.argv[2]))
"""


def journal(path: Path, *, seed: int) -> bytes:
    """Drive 10 m with perception and faults, and return the journal."""
    told = scenario(perception=True, driver="teleoperator", seed=seed, fault=FAULTS)
    go(told, parts(Straight(10.0)), path=path)
    return path.read_bytes()


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return journal(tmp_path_factory.mktemp("journal") / "journal.jsonl", seed=1)


def test_two_runs_have_one_journal_and_another_seed_another(tmp_path: Path, once: bytes) -> None:
    assert journal(tmp_path / "a", seed=1) == once
    assert journal(tmp_path / "b", seed=2) != once


@pytest.mark.parametrize("threads", [1, 4])
def test_other_threads_and_cores_change_nothing(tmp_path: Path, once: bytes, threads: int) -> None:
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS", "PYTHONHASHSEED")
    environment = os.environ | dict.fromkeys(names, str(threads))
    command = [sys.executable, "-c", IN_A_PROCESS, str(tmp_path / "journal.jsonl"), "1"]
    if threads == 1 and sys.platform.startswith("linux"):
        command = ["taskset", "-c", str(min(os.sched_getaffinity(0))), *command]
    subprocess.run(command, cwd=ROOT, env=environment, check=True)
    assert (tmp_path / "journal.jsonl").read_bytes() == once


def test_lines_have_the_keys_of_the_contract_in_their_order(once: bytes) -> None:
    keys = ("t_ns", "process", "event", "from", "to", "cause", "values")
    lines = [json.loads(line) for line in once.splitlines()]
    assert all(tuple(line) == keys for line in lines)
    times = [line["t_ns"] for line in lines]
    assert times == sorted(times)
    states = [(line["process"], line["to"]) for line in lines if line["event"] == "state"]
    assert ("perception", "tracking") in states
    assert {"perception", "operator", "plant", "monitor", "faults"} <= {line["process"] for line in lines}


def autonomy(*, withhold_truth: bool) -> list[Event]:
    """Return what the processes that drive write where nobody sees the truth, or some may."""
    told, whole = scenario(perception=True, limits={"time_s": 8.0}), replace(parts(), operator=None)
    journal, events = Journal(), list[Event]()
    journal.listeners.append(events.append)
    blind = Blind(journal.of("autonomy"))
    run = assemble(told, whole, journal, Watchers(Film(whole.machine), more=[blind]), withhold_truth=withhold_truth)
    for _ in run.engine.run(run.engine.now_ns + 6_000_000_000):
        pass
    assert blind.poses > 50
    return [one for one in events if one.process in ("autonomy", "perception")]


def test_with_the_truth_withheld_autonomy_writes_the_same() -> None:
    seen, withheld = autonomy(withhold_truth=False), autonomy(withhold_truth=True)
    assert seen == withheld
    assert len(seen) > 3


def test_only_those_that_may_subscribe_to_the_truth() -> None:
    for topic in (STATE, "/ground_truth/odometry"):
        with pytest.raises(ValueError, match="may not see /ground_truth/"):
            Bus([Ticker("guidance", reads=(topic,))], None)
    curious, source = Ticker("curious", reads=(EVERYTHING,)), Ticker("source")
    bus = Bus([curious, source], None)
    assert not list(bus.deliveries(source, f"{TRUTH}odometry", 0))
    assert list(bus.deliveries(source, "/odom", 0))
