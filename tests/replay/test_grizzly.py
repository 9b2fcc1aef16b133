"""`kind = "grizzly"` from the scenario to the folder: free, valid, in good order, the same to the bit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from lhdmap.cli.main import main
from lhdmap.errors import ConfigError, InputError
from lhdmap.logs.source import LogSource
from lhdmap.replay.run import ReplayRequest, replay
from lhdmap.replay.scenario import Scenario, load_scenario
from lhdmap.replay.verdict import KEYS
from lhdmap.settings_tree import tree_from

FILES = {"run.json", "run.mcap", "journal.jsonl", "verdict.json", "report.html", "recording.rrd"}


def _scenario(**table: Any) -> Scenario:
    return tree_from(Scenario, {"kind": "grizzly", **table})


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the command with three rocks, one of which takes more than a blow."""
    folder = tmp_path_factory.mktemp("grizzly")
    (folder / "three.toml").write_text('kind = "grizzly"\nrocks = 3\nseed = 4\n', encoding="utf-8")
    assert main(["replay", str(folder / "three.toml"), "-o", str(folder / "run"), "--quiet"]) == 0
    return folder / "run"


def test_the_grizzly_is_free(run: Path) -> None:
    verdict = json.loads((run / "verdict.json").read_text())
    assert {path.name for path in run.iterdir()} == FILES
    assert set(KEYS) <= set(verdict)
    assert (verdict["ok"], verdict["rocks"], verdict["rocks_left"], verdict["plans_invalid"]) == (True, 3, 0, 0)
    assert verdict["blows"] > 3
    assert verdict["contacts"] == []
    assert verdict["min_clearance_m"] > 0.0
    assert verdict["over_best"] < 1.1


def test_times_of_the_journal_add_up(run: Path) -> None:
    events = [json.loads(line) for line in (run / "journal.jsonl").read_text().splitlines()]
    verdict = json.loads((run / "verdict.json").read_text())
    moves = [one["values"] for one in events if one["event"] == "move"]
    blows = [one for one in events if one["event"] == "blow"]
    looks = [one for one in events if one["event"] == "rocks"]
    total_s = sum(one["time_s"] for one in moves) + 3.0 * len(blows) + 1.0 * len(looks)
    assert total_s == pytest.approx(verdict["duration_s"], abs=1e-3)
    assert 1e-9 * (events[-1]["t_ns"] - events[0]["t_ns"]) == pytest.approx(total_s, abs=1e-3)
    assert [one["t_ns"] for one in events] == sorted(one["t_ns"] for one in events)


def test_the_log_has_clouds_and_joints(run: Path) -> None:
    verdict = json.loads((run / "verdict.json").read_text())
    with LogSource([run / "run.mcap"]) as source:
        topics = source.topics()
    assert topics["/lidar/points"].count == verdict["looks"]
    assert (topics["/machine/joints"].count or 0) > 100


def test_the_same_scenario_gives_the_same_journal(tmp_path: Path) -> None:
    told = _scenario(rocks=1, seed=2)
    results = [replay(ReplayRequest(told, tmp_path / name, recording=False)) for name in "ab"]
    first, second = ((one.folder / "journal.jsonl").read_bytes() for one in results)
    assert first == second


def test_boulders_of_a_pile_are_handed_over(tmp_path: Path) -> None:
    """Those that fall through an opening of 0.4 m never come to lie on the grizzly."""
    boulders = [{"center_m": [0, 0, 0], "size_m": size} for size in (0.9, 0.3)]
    (tmp_path / "pile.json").write_text(json.dumps({"status": "loadable", "boulders": boulders}))
    (tmp_path / "one.toml").write_text('kind = "grizzly"\n[grizzly]\npile = "pile.json"\n', encoding="utf-8")
    told = load_scenario(tmp_path / "one.toml")
    result = replay(ReplayRequest(told, tmp_path / "run", recording=False))
    assert result.verdict["rocks"] == 1
    assert result.verdict["ok"]
    (tmp_path / "pile.json").write_text("{}")
    with pytest.raises(InputError, match="boulders"):
        replay(ReplayRequest(told, tmp_path / "other", recording=False))


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ({"rocks": 1, "goal": "DP1"}, "goal is given"),
        ({}, "wants rocks"),
        ({"kind": "tram", "mine": "ring", "rocks": 2}, "nothing else"),
        ({"rocks": -1}, "range"),
    ],
)
def test_what_is_wrong_is_refused(table: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        _scenario(**table)


def test_a_limit_of_time_is_kept(tmp_path: Path) -> None:
    told = _scenario(rocks=2, seed=1, limits={"time_s": 5.0})
    verdict = replay(ReplayRequest(told, tmp_path / "run", recording=False)).verdict
    assert not verdict["ok"]
    assert "time limit" in verdict["reason"]
