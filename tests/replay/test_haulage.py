"""`kind = "haulage"` from the scenario to the folder: both bodies in the lane, docks in tolerance, the same to the bit."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from lhdmap.cli.main import main
from lhdmap.errors import ConfigError, UsageError
from lhdmap.haulage.records import Phase
from lhdmap.haulage.site import find_site
from lhdmap.haulage.stages import stage_of
from lhdmap.haulage.states import State
from lhdmap.production.journal import cycles_of_journal
from lhdmap.replay.assemble import parts_of
from lhdmap.replay.run import ReplayRequest, replay
from lhdmap.replay.scenario import Scenario, load_scenario
from lhdmap.replay.verdict import KEYS
from lhdmap.settings_tree import tree_from
from lhdmap.simulation.history import START_NS

FILES = {"run.json", "run.mcap", "journal.jsonl", "verdict.json", "report.html"}
LANE_RMS_M, LANE_MAX_M = 0.09, 0.30  # the issue's, for the truck
DOCK_M, DOCK_DEG = 0.2, 2.0  # haulage findings, section 3


def _scenario(**table: Any) -> Scenario:
    return tree_from(Scenario, {"kind": "haulage", "site": "hejase", **table})


def _events(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "journal.jsonl").read_text().splitlines()]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the command: the truck, one load, the paper's traffic on the left."""
    folder = tmp_path_factory.mktemp("haulage")
    (folder / "one.toml").write_text('kind = "haulage"\nsite = "hejase"\nseed = 3\n', encoding="utf-8")
    told = ["replay", str(folder / "one.toml"), "-o", str(folder / "run"), "--quiet", "--no-recording"]
    assert main(told) == 0
    return folder / "run"


def test_a_load_is_hauled(run: Path) -> None:
    verdict = json.loads((run / "verdict.json").read_text())
    assert {path.name for path in run.iterdir()} == FILES
    assert set(KEYS) <= set(verdict)
    assert (verdict["ok"], verdict["kind"], verdict["cycles"], verdict["tonnes"]) == (True, "haulage", 1, 28.0)
    assert sum(verdict["time_by_phase_s"].values()) == pytest.approx(verdict["duration_s"], abs=1e-3)


def test_both_bodies_stay_in_the_lane(run: Path) -> None:
    verdict = json.loads((run / "verdict.json").read_text())
    assert verdict["contacts"] == []
    assert verdict["lane_sum_rms_m"] <= LANE_RMS_M
    assert verdict["lane_sum_max_m"] <= LANE_MAX_M
    assert 1.45 < verdict["half_lane_used_m"] < verdict["half_lane_m"] == 2.1  # no body is narrower than itself


def test_the_page_tells_of_lane_and_docks(run: Path) -> None:
    page = (run / "report.html").read_text()
    assert "half a lane used" in page
    assert "the edge of its lane" in page


def test_each_dock_is_in_tolerance(run: Path) -> None:
    docks = json.loads((run / "verdict.json").read_text())["docks"]
    assert [one["place"] for one in docks] == ["L1", "D1", "P1"]
    for one in docks:
        assert one["off_m"] <= DOCK_M
        assert one["off_deg"] <= DOCK_DEG


def test_the_papers_stages_come_in_their_order(run: Path) -> None:
    """Loaded, they are 2 to 7; empty again, 8 on, and 13 at the end (Section 2.2)."""
    stages = [one["values"]["stage"] for one in _events(run) if one["process"] == "mission" and one["event"] == "state"]
    loaded = stages[stages.index(1) : stages.index(7) + 1]
    assert loaded == sorted(loaded)
    assert stages[-1] == stage_of(State.IDLE, loaded=False) == 13


def test_production_reads_its_cycles(run: Path) -> None:
    cycles = cycles_of_journal(run / "journal.jsonl")
    first = cycles[0]
    assert (first.load, first.dump, first.mass_t, first.finished) == ("L1", "D1", 28.0, True)
    assert all(one.to_ns == other.from_ns for one, other in pairwise(first.intervals))
    assert first.seconds(Phase.LOAD) == pytest.approx(26.0, abs=0.5)


def test_the_same_seed_gives_the_same_journal_and_another_one_does_not(tmp_path: Path) -> None:
    journals = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        told = _scenario(seed=seed, limits={"time_s": 45.0})
        result = replay(ReplayRequest(told, tmp_path / name, recording=False))
        assert "time limit" in result.verdict["reason"]
        journals.append((result.folder / "journal.jsonl").read_bytes())
    assert journals[0] == journals[1] != journals[2]


def test_traffic_on_the_right_is_the_mirror_image() -> None:
    """On the straight road each lane lies on the other side of the centre line."""
    sides = []
    for keeps in ("left", "right"):
        haulage = parts_of(_scenario(haulage={"keeps": keeps}), Path()).haulage
        assert haulage is not None
        edges = haulage.ground.layout.edges
        lane = next(one for one in edges if (one.start, one.end) == ("A1 out ahead", "A3 in ahead")).line_m
        assert lane is not None
        sides.append(lane[0, 1])
        turns = {(one.start, one.end): one.gives_way for one in edges if one.kind == State.JUNCTION_ON}
        assert turns[("A1 out", "A1 out ahead")] == (keeps == "right")
    assert sides[0] == pytest.approx(2.1, abs=1e-6)
    assert sides[1] == pytest.approx(-2.1, abs=1e-6)


def test_a_receiver_that_is_silent_for_a_while_stops_the_machine_and_it_goes_on(tmp_path: Path) -> None:
    fault = {"kind": "dead", "target": "/site/pose", "at_s": 15.0, "duration_s": 4.0}
    told = _scenario(seed=1, limits={"time_s": 40.0}, fault=[fault])
    result = replay(ReplayRequest(told, tmp_path / "run", recording=False))
    states = [one for one in _events(result.folder) if one["process"] == "driver" and one["event"] == "state"]
    halted = next(one for one in states if one["to"] == "halted")
    after = states[states.index(halted) + 1]
    assert 15.4e9 <= halted["t_ns"] - START_NS <= 15.7e9  # settings: a motion is too old after 0.5 s
    assert after["to"] == "driving"
    assert 19.0e9 <= after["t_ns"] - START_NS <= 19.2e9
    assert result.verdict["time_by_phase_s"]["place not known"] == pytest.approx(3.5, abs=0.3)


def test_a_thing_on_the_way_is_waited_for_and_not_touched(tmp_path: Path) -> None:
    """A box of 1 m stands on the queue point of A1 from the start on, for 40 s."""
    fault = {"kind": "obstacle", "at": "A1 queue", "duration_s": 40.0, "size": 1.0}
    told = _scenario(seed=1, limits={"time_s": 62.0}, fault=[fault])
    fault_at = parts_of(told, Path()).places["A1 queue"]
    result = replay(ReplayRequest(told, tmp_path / "run", recording=False))
    verdict, events = result.verdict, _events(result.folder)
    states = [one for one in events if one["process"] == "driver" and one["event"] == "state"]
    blocked = next(one for one in states if one["to"] == "blocked")
    after = states[states.index(blocked) + 1]
    assert verdict["contacts"] == []
    assert 40.0e9 <= after["t_ns"] - START_NS <= 40.5e9
    assert verdict["time_by_phase_s"]["obstacle"] > 5.0
    assert 2.0 < verdict["min_clearance_m"] < 8.0, fault_at


def test_a_dock_that_is_missed_is_tried_again_from_the_queue_point(tmp_path: Path) -> None:
    """For the last metres before L1 the receiver is 1 m off, and stays so until the machine has stood."""
    fault = {"kind": "biased", "target": "/site/pose", "at_s": 50.0, "duration_s": 6.0, "size": 1.0}
    told = _scenario(seed=1, limits={"time_s": 168.0}, fault=[fault])
    result = replay(ReplayRequest(told, tmp_path / "run", recording=False))
    events = _events(result.folder)
    happened = [one["cause"] for one in events if one["process"] == "mission" and one["event"] == "event"]
    assert "dock missed" in happened
    assert "end of the edge crossed" in happened[happened.index("dock missed") :]
    assert [one["to"] for one in events if one["process"] == "work"] == ["loads"]
    docks = [one for one in result.verdict["docks"] if one["place"] == "L1"]
    assert docks[-1]["off_m"] <= DOCK_M


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ({"site": ""}, "wants a site"),
        ({"kind": "tram", "mine": "ring"}, "nothing else"),
        ({"cycles": 0}, "range"),
        ({"mine": "ring"}, "a site has none"),
        ({"goal": "D1"}, "a site has none"),
    ],
)
def test_what_is_wrong_is_refused(table: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        _scenario(**table)


@pytest.mark.parametrize(
    ("table", "told"), [({"site": "hejas"}, "hejase"), ({"machine": "truck"}, "truck_28t"), ({"start": "P2"}, "P1")]
)
def test_names_that_are_not_there_are_refused_with_the_nearest(table: dict[str, Any], told: str) -> None:
    with pytest.raises(UsageError, match=told):
        parts_of(_scenario(**table), Path())


def test_a_site_beside_the_scenario_is_found(tmp_path: Path) -> None:
    shipped = find_site("hejase").read_text(encoding="utf-8")
    (tmp_path / "own.toml").write_text(shipped.replace('name = "L1"', 'name = "North"'), encoding="utf-8")
    (tmp_path / "one.toml").write_text('kind = "haulage"\nsite = "own.toml"\n', encoding="utf-8")
    assert "North" in parts_of(load_scenario(tmp_path / "one.toml"), tmp_path).places
