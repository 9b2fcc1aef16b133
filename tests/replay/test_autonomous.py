"""A machine that drives itself, in a drift of 46 m: it arrives, needs no truth, writes the same again, and a contact ends it."""

from __future__ import annotations

from pathlib import Path

import pytest
from lhdmap.errors import UsageError
from lhdmap.replay.assemble import parts_of
from lhdmap.replay.journal import Event
from lhdmap.replay.processes.station import Station
from lhdmap.replay.processes.told import Word
from lhdmap.replay.scenario import load_scenario
from lhdmap.simulation.history import START_NS

from tests.replay.short import drive, tram

KEPT = Path(__file__).parent / "kept"
FOR_S = 8.0
WATCH = ("monitor", "engine", "faults")


def told(events: list[Event], process: str, event: str = "") -> list[tuple[float, str, str]]:
    """Return what a process wrote: when (s), the state after it, the cause."""
    return [
        ((one.t_ns - START_NS) * 1e-9, str(one.after or one.values.get("after", "")), one.cause)
        for one in events
        if one.process == process and event in ("", one.event)
    ]


def states(events: list[Event], process: str) -> list[str]:
    return [state for _, state, _ in told(events, process, "state")]


@pytest.fixture(scope="module")
def once(taught: Path) -> tuple[float, list[Event]]:
    run, events = drive(tram(taught), taught)
    assert run.monitor.tally.reason == "arrived"
    assert run.monitor.tally.touched.clearance_m is not None
    return run.monitor.tally.touched.clearance_m, events


def test_it_arrives_with_room_on_both_sides(once: tuple[float, list[Event]]) -> None:
    clearance_m, events = once
    assert clearance_m > 0.2
    assert states(events, "navigation") == ["driving", "arrived"]
    assert states(events, "executor")[-1] in ("stopping", "standing", "braking")


def test_truth_is_not_needed_and_the_journal_is_the_same(taught: Path, once: tuple[float, list[Event]]) -> None:
    run, events = drive(tram(taught), taught, for_s=FOR_S, withhold_truth=True)
    assert run.monitor.tally.drive.distance_m == 0.0
    until_ns = START_NS + round(FOR_S * 1e9)
    seen, withheld = (
        [one for one in each if one.process not in WATCH and one.t_ns < until_ns] for each in (once[1], events)
    )
    assert withheld == seen
    assert "forward" in states(events, "guidance")


def test_a_contact_ends_the_run(taught: Path) -> None:
    unseen = {"kind": "obstacle", "at_s": 6.0, "size": 0.9}  # 12 m ahead a thing so low is below the scanner's look
    run, _ = drive(tram(taught, fault=[unseen]), taught)
    assert run.monitor.tally.reason.startswith("contact: ")
    assert not run.monitor.tally.ok


def test_a_person_is_waited_for_a_frozen_scanner_stops_it_and_modes_change_as_the_station_wants(taught: Path) -> None:
    faults = [
        {"kind": "person", "at_s": 5.0, "duration_s": 9.0},
        {"kind": "frozen", "at_s": 19.0, "duration_s": 1.0, "target": "/lidar/front/scan"},
    ]
    modes = [
        {"at_s": 24.0, "mode": "teleoperated", "speed_kmh": -2.0},
        {"at_s": 26.5, "mode": "idle"},
        {"at_s": 28.0, "mode": "assisted", "speed_kmh": 5.0},
    ]
    run, events = drive(tram(taught, start="T1", fault=faults, mode=modes, rearm_s=2.0), taught, for_s=80.0)
    assert run.monitor.tally.reason == "arrived"
    assert run.monitor.tally.touched.clearance_m is not None
    assert run.monitor.tally.touched.clearance_m > 0.1
    assert "backing" not in states(events, "navigation")
    assert run.monitor.tally.mission.assists == 0
    stops = [cause for _, after, cause in told(events, "executor", "watchdog: armed") if after == "disarmed"]
    assert len(stops) == 1
    assert "scan_front" in stops[0] or "disagree" in stops[0]
    modes_seen = [after for _, after, _ in told(events, "executor", "modes: mode")]
    assert modes_seen == ["autonomous", "teleoperated", "idle", "assisted"]
    assert 3.6 * max(_speeds_after(events, 28.0), default=0.0) < 5.6


def _speeds_after(events: list[Event], from_s: float) -> list[float]:
    return [
        abs(float(one.values["speed_mps"]))
        for one in events
        if one.event == "executor: state" and (one.t_ns - START_NS) * 1e-9 > from_s
    ]


def test_without_arming_nothing_moves(taught: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Station, "_arming", lambda self, now_ns, health, wanted: _silent(now_ns))
    run, events = drive(tram(taught), taught, for_s=6.0)
    assert run.monitor.tally.drive.distance_m < 0.01
    assert "driving" not in states(events, "executor")


def _silent(now_ns: int) -> Word:
    return Word(now_ns)


@pytest.mark.parametrize("path", sorted(KEPT.glob("*.toml")), ids=lambda path: path.stem)
def test_runs_that_failed_once_do_not_again(taught: Path, path: Path) -> None:
    run, _ = drive(load_scenario(path, map=str(taught / "short.map")), taught)
    assert run.monitor.tally.reason == "arrived"
    assert run.monitor.tally.touched.clearance_m is not None
    assert run.monitor.tally.touched.clearance_m > 0.08


def test_names_that_the_map_lacks_are_refused(taught: Path) -> None:
    with pytest.raises(UsageError):
        parts_of(tram(taught, goal="OP9"), taught)
    with pytest.raises(UsageError, match="OP7"):
        parts_of(tram(taught, mode=[{"at_s": 2.0, "goal": "OP7"}]), taught)
