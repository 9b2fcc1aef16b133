"""What is refused, how: exit code, one or two lines that name the file and what was wanted, no traceback."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest
from lhdmap.cli.main import COMMANDS, main

from tests.cli.logs import write_room_log


class Refusal(NamedTuple):
    """A command line ({log}, {empty}, … stand for files), the exit code, and words that the error must hold."""

    words: str
    exit_code: int
    told: tuple[str, ...]


REFUSALS = [
    Refusal("build-map {missing}", 3, ("missing.mcap", "no such file")),
    Refusal("build-map {empty}", 3, ("empty.mcap", "empty")),
    Refusal("build-map {text}", 3, ("notes.txt",)),
    Refusal("build-map {folder}", 3, ("folder",)),
    Refusal("build-map {two}", 3, ("two.mcap", "/scan_a", "/scan_b", "--topic")),
    Refusal("build-map {log} --topic front=/no/such", 3, ("room.mcap", "/no/such", "/lidar/front/scan")),
    Refusal("build-map {log} --topic front", 2, ("role=/topic",)),
    Refusal("build-map {log} --set odometry.metod=range_flow", 2, ("odometry.metod", "did you mean 'method'")),
    Refusal("build-map {log} --set odometri.method=range_flow", 2, ("odometri", "did you mean 'odometry'")),
    Refusal("build-map {log} --set odometry.method=magic", 2, ("odometry.method", "anchored")),
    Refusal("build-map {log} --set odometry.step_m=far", 2, ("odometry.step_m", "float")),
    Refusal("build-map {log} --set odometry", 2, ("section.key=value",)),
    Refusal("build-map {log} --config {missing}", 2, ("missing.mcap",)),
    Refusal("build-map {log} --config {text}", 2, ("notes.txt", "TOML")),
    Refusal("build-map {log} --machine {missing}", 3, ("missing.mcap",)),
    Refusal("build-map {log} --speed 3", 2, ("--speed",)),
    Refusal("build-map", 2, ("LOG",)),
    Refusal("doctor {log} --topic front", 2, ("ROLE=TOPIC",)),
    Refusal("doctor", 2, ("LOG",)),
    Refusal("config --set integration.voxel=1", 2, ("integration.voxel",)),
    Refusal("config --config {missing}", 2, ("missing.mcap",)),
    Refusal("simulate moon", 2, ("moon", "drift")),
    Refusal("simulate {text}", 3, ("notes.txt",)),
    Refusal("simulate drift -o {log}", 2, ("room.mcap", "exists")),
    Refusal("simulate drift -o {folder}/a.bag", 2, (".mcap",)),
    Refusal("simulate drift --roughness very -o {folder}/a.mcap", 2, ("--roughness",)),
    Refusal("eval trajectory {missing} --truth {log}", 3, ("missing.mcap",)),
    Refusal("eval trajectory {text} --truth {log}", 3, ("notes.txt",)),
    Refusal("eval trajectory {tum} --truth {log}", 3, ("room.mcap", "ground truth")),
    Refusal("eval trajectory {tum}", 2, ("--truth",)),
    Refusal("eval trajectory {tum} --truth {tum} --max-end-pct -1", 1, ("fell short",)),
    Refusal("pile {missing}", 3, ("missing.mcap", "no such file")),
    Refusal("pile {empty}", 3, ("empty.mcap", "empty")),
    Refusal("pile {log} --topic front=/no/such", 3, ("room.mcap", "/no/such", "/lidar/front/scan")),
    Refusal("pile {log} --poses {missing}", 3, ("missing.mcap",)),
    Refusal("pile {log} --set pile.metod=surface", 2, ("pile.metod", "did you mean 'method'")),
    Refusal("pile {log} --up w", 2, ("--up",)),
    Refusal("pile {folder}/heap.ply --poses {tum} --set pile.method=off", 2, ("heap.ply", "--set, --poses", "--up")),
    Refusal("build-map {log} -o /", 2, ("-o /", "folder")),
    Refusal("build-map {log} -o ..", 2, ("-o ..", "folder")),
    Refusal("simulate pile --variant heap -o {folder}/a.mcap", 2, ("heap",)),
    Refusal("simulate pile --suite {missing} -o {folder}/suite", 3, ("missing.mcap",)),
    Refusal("eval pile --truth {missing}", 3, ("missing.mcap",)),
    Refusal("eval pile", 2, ("--truth",)),
    Refusal("eval loading {tum}", 2, ("loading",)),
    Refusal("view {missing} --web", 3, ("missing.mcap",)),
    Refusal("demo --set odometry.metod=1", 2, ("did you mean 'method'",)),
    Refusal("demo -o {log}/demo", 3, ("room.mcap",)),
    Refusal("biuld-map {log}", 2, ("biuld-map", "build-map")),
    Refusal("--no-such-option", 2, ()),
    Refusal("", 2, ()),
]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Files that the command lines name."""
    root = tmp_path_factory.mktemp("refusals")
    names = {"missing": "missing.mcap", "empty": "empty.mcap", "text": "notes.txt", "folder": "folder"}
    found = {key: root / name for key, name in names.items()}
    found["empty"].touch()
    found["text"].write_text("Nothing that lhdmap reads.\nNot at all = [\n", encoding="utf-8")
    found["folder"].mkdir()
    found["log"] = write_room_log(root / "room.mcap", 5)
    found["two"] = write_room_log(root / "two.mcap", 5, ("/scan_a", "/scan_b"))
    found["tum"] = root / "path.tum"
    found["tum"].write_text("".join(f"{i}.0 {i}.0 0 0 0 0 0 1\n" for i in range(9)), encoding="utf-8")
    return found


@pytest.mark.parametrize("case", REFUSALS, ids=lambda case: case.words or "nothing")
def test_is_refused_in_words(
    case: Refusal, files: dict[str, Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(files["folder"])
    before = sorted(path.name for path in files["folder"].parent.iterdir())
    assert main(case.words.format(**files).split()) == case.exit_code
    told = capsys.readouterr().err
    assert "Traceback" not in told
    assert "fault in lhdmap" not in told
    for word in case.told:
        assert word in told
    assert sorted(path.name for path in files["folder"].parent.iterdir()) == before, "a refused command left files"


@pytest.mark.parametrize("words", [r.words for r in REFUSALS if r.exit_code == 3 and "{missing}" not in r.words])
def test_says_it_in_few_lines(words: str, files: dict[str, Path], capsys: pytest.CaptureFixture[str]) -> None:
    main(words.format(**files).split())
    assert 1 <= len(capsys.readouterr().err.strip().splitlines()) <= 3


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_explains_itself(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "--help"]) == 0
    text = capsys.readouterr().out
    assert f"lhdmap {command}" in text
    assert "--json" in text


def test_a_cut_log_is_used_and_its_damage_told(
    tmp_path: Path, files: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    cut = tmp_path / "cut.mcap"
    whole = write_room_log(tmp_path / "whole.mcap", 500).read_bytes()
    cut.write_bytes(whole[: int(0.7 * len(whole))])
    assert main(["build-map", str(cut), "-o", str(tmp_path / "map")]) == 0
    assert "cut.mcap" in capsys.readouterr().err
    assert (tmp_path / "map" / "trajectory.tum").read_text(encoding="utf-8").count("\n") > 10


def test_a_fault_is_told_and_debug_shows_where(
    files: dict[str, Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("broken on purpose")

    monkeypatch.setattr("lhdmap.pipeline.build.build_map", broken)
    assert main(["build-map", str(files["log"])]) == 3
    told = capsys.readouterr().err
    assert "broken on purpose" in told
    assert "Traceback" not in told
    assert main(["build-map", str(files["log"]), "--debug"]) == 3
    assert "Traceback" in capsys.readouterr().err
