"""The run folder and the command: what is written, exit codes, what can be read back."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from lhdmap.cli.main import main
from lhdmap.config import Settings
from lhdmap.logs.source import LogSource
from lhdmap.replay.parts import Parts
from lhdmap.replay.run import ReplayRequest, replay
from lhdmap.replay.scenario import Scenario
from lhdmap.replay.series import Series
from lhdmap.replay.verdict import KEYS
from lhdmap.runfolder import RunFolder

from tests.replay.doubles import Straight, parts
from tests.replay.runs import scenario

FILES = {"run.json", "run.mcap", "journal.jsonl", "verdict.json", "report.html", "recording.rrd"}
TOML = 'mine = "corridor"\nperception = false\n[[fault]]\nkind = "obstacle"\nat_s = 2.0\nduration_s = 1.0\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with scans, perception, a stop and a fault."""
    fault = {"kind": "frozen", "at_s": 4.0, "duration_s": 1.0, "target": "/machine/tachometer"}
    told = scenario(perception=True, fault=[fault])
    target = tmp_path_factory.mktemp("run") / "one"
    return replay(ReplayRequest(told, target, name="one"), parts(Straight(15.0, rests_m=[6.0]))).folder


def test_the_folder_is_whole(folder: Path) -> None:
    assert {path.name for path in folder.iterdir()} == FILES
    found = RunFolder.open(folder, ["replay"])
    assert found.changed_files() == []
    verdict = found.json("verdict.json")
    assert tuple(verdict) == KEYS
    assert (verdict["ok"], verdict["stops"], verdict["contacts"]) == (True, 1, [])
    assert verdict["journal_sha256"] == hashlib.sha256((folder / "journal.jsonl").read_bytes()).hexdigest()
    assert verdict["faults"][0]["began_s"] == 4.0
    assert found.info["options"]["scenario"]["seed"] == 0


def test_the_log_is_one_of_the_contract_with_the_truth_in_it(folder: Path) -> None:
    with LogSource([folder / "run.mcap"]) as source:
        assert {"front", "inclinometer", "joints", "tachometer", "command", "mode", "ground_truth"} <= set(source.roles)
        truth = [message for role, message in source.messages(["ground_truth"])]
        scans = sum(1 for _ in source.messages(["front"]))
    verdict = json.loads((folder / "verdict.json").read_text())
    way_m = float(np.linalg.norm(truth[-1].position_m - truth[0].position_m))  # type: ignore[union-attr]
    assert way_m == pytest.approx(verdict["distance_m"], abs=0.1)
    assert scans == pytest.approx(25.0 * verdict["duration_s"], abs=3)


def test_the_page_has_all_its_parts(folder: Path) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    for words in ("arrived", "Way", "Over time", "States", "Faults and what followed", "frozen"):
        assert words in page
    assert page.count("data:image/svg+xml") == 3
    assert "http://" not in page.replace("http://www.w3.org", "")


@pytest.fixture
def corridor(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[Straight], Path]:
    """Have the command drive in the corridor: the file of a scenario."""

    def made(operator: Straight) -> Path:
        def parts_of(_: Scenario, _folder: Path, _settings: Settings | None) -> Parts:
            return parts(operator)

        monkeypatch.setattr("lhdmap.replay.run.parts_of", parts_of)
        monkeypatch.chdir(tmp_path)
        path = tmp_path / "short.toml"
        path.write_text(TOML, encoding="utf-8")
        return path

    return made


def test_the_command_says_the_verdict_and_ends_with_it(
    corridor: Callable[[Straight], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    path = corridor(Straight(6.0))
    assert main(["replay", str(path), "--json", "--quiet", "--no-recording", "--seed", "5", "--no-truth"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert set(KEYS) | {"run"} == set(told)
    assert {path.name for path in Path("short_run").iterdir()} == FILES - {"recording.rrd"}
    assert json.loads(Path("short_run/run.json").read_text())["options"]["scenario"]["seed"] == 5
    with LogSource([Path("short_run/run.mcap")]) as source:
        assert "ground_truth" not in source.roles
    assert main(["info", "short_run"]) == 0
    assert "verdict      ok: arrived" in capsys.readouterr().out
    assert main(["replay", str(path)]) == 2  # the folder is there
    assert main(["view", "short_run", "--web"]) == 3  # and has no recording


def test_a_verdict_that_is_not_ok_is_exit_code_1(
    corridor: Callable[[Straight], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    path = corridor(Straight(60.0, steering_rps=0.05))
    assert main(["replay", str(path), "--json", "--quiet", "-o", "wall"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["error"]["kind"] == "shortfall"
    assert told["error"]["message"].startswith("not ok: contact: front_frame")
    assert not told["ok"]
    assert "Contacts" in Path("wall/report.html").read_text(encoding="utf-8")


def test_what_is_wrong_is_exit_code_2(corridor: Callable[[Straight], Path]) -> None:
    path = corridor(Straight(6.0))
    assert main(["replay", "rng_manual"]) == 2
    assert main(["replay", str(path), "--view", "--no-recording"]) == 2
    assert main(["replay", str(path), "--seed", "-3"]) == 2
    path.write_text("mine = 3\n", encoding="utf-8")
    assert main(["replay", str(path)]) == 2
    assert not Path("short_run").exists()


def test_curves_of_any_length_are_bounded_and_even() -> None:
    series = Series(2, most=100)
    for k in range(12_345):
        series.add((float(k), 2.0 * k))
    rows = series.rows()
    assert len(rows) <= 101
    assert rows[-1, 0] == 12_344.0
    assert len(np.unique(np.diff(rows[:-1, 0]))) == 1
    assert np.array_equal(rows[:, 1], 2.0 * rows[:, 0])
