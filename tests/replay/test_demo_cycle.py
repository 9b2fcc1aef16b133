"""The end of the demo: a mine is taught, the machine works on its map, and all that is told is where it says."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from lhdmap.cli.main import main
from lhdmap.replay.scenario import load_scenario as load_replay
from lhdmap.simulation.scenario import load_scenario

from tests.cli.test_demo import shortened
from tests.replay.short import tram


def test_the_demo_works_on_the_map_that_was_taught_and_tells_a_miss(
    taught: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The drive through `short` stands for the cycle: it has two seconds, so it is not done, and the exit code says so."""
    told = tram(taught, map="", limits={"time_s": 2.0})
    maps: list[Path] = []

    def teach(*given: Any) -> None:
        maps.append(given[3])
        shutil.copytree(taught / "short.map", given[3])

    monkeypatch.setattr("lhdmap.replay.demo.load_scenario", lambda path: shortened(load_scenario(path)))
    monkeypatch.setattr("lhdmap.replay.demo.load_replay", lambda _: told)
    monkeypatch.setattr("lhdmap.replay.demo.teach", teach)
    folder = tmp_path / "demo"
    assert main(["demo", "-o", str(folder), "--json", "--quiet"]) == 1
    values = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert [one.name for one in maps] == ["mine_map"]
    assert values["cycle"]["run"] == str(folder / "cycle")
    assert values["cycle"]["reason"].startswith("time limit")
    assert (folder / "cycle" / "report.html").is_file()
    run = json.loads((folder / "cycle" / "run.json").read_text(encoding="utf-8"))
    assert run["options"]["scenario"]["map"] == str(folder / "mine_map")  # where it is now, not where it grew
    assert (folder / "mine_map" / "topology.geojson").is_file()


def test_what_ships_is_one_whole_cycle() -> None:
    from lhdmap.replay.demo import CYCLE
    from lhdmap.replay.scenario import find_scenario

    found = load_replay(find_scenario(CYCLE))
    assert (found.kind, [one.buckets for one in found.mission], found.faults) == ("mission", [1], ())
