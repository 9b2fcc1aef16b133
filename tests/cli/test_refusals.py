"""What is refused, how: exit code, one or two lines that name the file and what was wanted, no traceback."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import pytest
from lhdmap.cli.main import COMMANDS, main
from lhdmap.mapfolder import MapFolderWriter
from lhdmap.runfolder import RunInfo

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
    Refusal("build-map {log} --speed 3", 2, ("--speed", "usage: lhdmap build-map")),
    Refusal("build-map {log} --outptu x", 2, ("--outptu", "did you mean '--output'", "usage: lhdmap build-map")),
    Refusal("build-map --conifg x", 2, ("--conifg", "did you mean '--config'")),
    Refusal("build-map {log} --set odometry.step=1", 2, ("one of step_m, step_s, step_deg?",)),
    Refusal("build-map {log} --set step_m=1", 2, ("odometry.step_m=1",)),
    Refusal("build-map {log} --set odometry.voxel_size_m=1", 2, ("integration.voxel_size_m",)),
    Refusal("build-map {log} --set odometry.step_m=-1", 2, ("odometry.step_m = -1", "0 m or more")),
    Refusal("build-map {log} --config {settings}", 2, ("mine.toml", "odometry.metod", "did you mean 'method'")),
    Refusal("build-map {log} --topic frnt=/scan", 2, ("frnt", "did you mean 'front'")),
    Refusal("build-map {map}", 3, ("map", "is a map folder of lhdmap", "lhdmap info", "drive.mcap")),
    Refusal("build-map {log} -o {map}", 2, ("map", "is there already", "-o OTHER", "--force")),
    Refusal("build-map {log} -o {foreign} --force", 2, ("foreign", "not made by lhdmap", "-o OTHER")),
    Refusal("build-map {log} -o {log} --force", 2, ("room.mcap", "is a file")),
    Refusal("build-map {log} -o {log}/map", 3, ("room.mcap", "cannot be made")),
    Refusal("build-map {map}/inner.mcap -o {map} --force", 2, ("inner.mcap is in it",)),
    Refusal("pile {map}", 3, ("is a map folder of lhdmap", "lhdmap info")),
    Refusal("pile {log} -o {map}", 2, ("is there already", "--force")),
    Refusal("pile {log} -o {log}/pile", 3, ("room.mcap", "cannot be made")),
    Refusal("info {log}", 3, ("room.mcap", "is a log", "lhdmap doctor", "lhdmap build-map")),
    Refusal("info {folder}", 3, ("folder", "map.json")),
    Refusal("info {missing}", 3, ("missing.mcap", "no such file")),
    Refusal("eval trajectory {log} --truth {tum}", 3, ("room.mcap", "is a log", "lhdmap build-map")),
    Refusal("eval trajectory {tum} --truht {tum}", 2, ("--truht", "did you mean '--truth'", "usage: lhdmap eval traj")),
    Refusal("eval trajectroy {tum}", 2, ("trajectroy", "did you mean 'trajectory'", "usage: lhdmap eval")),
    Refusal("eval trajectory {tum} --truth {tum} --plot {text}", 2, ("notes.txt", "exists already", "--force")),
    Refusal("rockbreaker paln", 2, ("paln", "did you mean 'plan'", "usage: lhdmap rockbreaker")),
    Refusal("rockbreaker plan --to 6,0,-1 -o {map}", 2, ("is there already", "--force")),
    Refusal("rockbreaker plan --to 6,0,-1 -o {log}/plan", 3, ("room.mcap", "cannot be made")),
    Refusal("rockbreaker workspace -o {foreign} --force", 2, ("not made by lhdmap",)),
    Refusal("config pil", 2, ("pil", "did you mean 'pile'")),
    Refusal("completion tcsh", 2, ("tcsh", "bash, zsh, fish", "usage: lhdmap completion")),
    Refusal("simulate grizly", 2, ("grizly", "did you mean 'grizzly'")),
    Refusal("simulate drift --length 2 -o {log}/a.mcap", 3, ("room.mcap", "cannot be made")),
    Refusal("view {log} --screenshot {text}", 2, ("notes.txt", "exists already", "--force")),
    Refusal("view {log} --web -o {text}", 2, ("notes.txt", "exists already", "--force")),
    Refusal("view {log} --web -o {log} --force", 2, ("room.mcap", "input itself")),
    Refusal("view {log} --web -o /dev/full --force", 2, ("/dev/full", "no ordinary file")),
    Refusal("build-map", 2, ("LOG",)),
    Refusal("doctor {log} --topic front", 2, ("role=/topic",)),
    Refusal("doctor", 2, ("LOG",)),
    Refusal("config --set integration.voxel=1", 2, ("integration.voxel",)),
    Refusal("config --config {missing}", 2, ("missing.mcap",)),
    Refusal("simulate moon", 2, ("moon", "drift")),
    Refusal("simulate {text}", 3, ("notes.txt",)),
    Refusal("simulate drift -o {log}", 2, ("room.mcap", "exists", "--force")),
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
    Refusal("eval loading {tum}", 3, ("path.tum",)),
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
    found["settings"] = root / "mine.toml"
    found["settings"].write_text("[odometry]\nmetod = 'anchored'\n", encoding="utf-8")
    found["foreign"] = root / "foreign"
    found["foreign"].mkdir()
    (found["foreign"] / "map.json").write_text('{"software": {"name": "another"}}', encoding="utf-8")
    found["map"] = root / "map"
    with MapFolderWriter(found["map"]) as folder:
        (folder.path / "inner.mcap").write_bytes(found["log"].read_bytes())
        (folder.path / "trajectory.tum").touch()
        folder.complete(RunInfo([Path("drive.mcap")]), {Path("drive.mcap"): {"path": "drive.mcap"}})
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
    text = capsys.readouterr().err
    assert "Traceback" not in text
    assert "fault in lhdmap" not in text
    for word in case.told:
        assert word in text
    assert main([*case.words.format(**files).split(), "--json"]) == case.exit_code
    told = capsys.readouterr()
    error = json.loads(told.out)["error"]
    assert error["exit_code"] == case.exit_code
    assert error["message"].splitlines()[0] in told.err or case.words.startswith("doctor")
    assert error["kind"] in ("usage", "settings", "input", "system", "shortfall")
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

    monkeypatch.setattr("lhdmap.pipeline.join.build_drives", broken)
    assert main(["build-map", str(files["log"])]) == 3
    told = capsys.readouterr().err
    assert "broken on purpose" in told
    assert "Traceback" not in told
    assert main(["build-map", str(files["log"]), "--debug"]) == 3
    assert "Traceback" in capsys.readouterr().err
