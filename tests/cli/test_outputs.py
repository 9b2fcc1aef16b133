"""Where results go: what is there is refused before the work, replaced with --force at the end, and whole until then."""

from __future__ import annotations

import fcntl
import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from lhdmap.cli.main import main
from lhdmap.errors import InputError, LhdmapWarning, UsageError, kept_with
from lhdmap.interrupts import put_in_order
from lhdmap.mapfolder import MapFolderWriter
from lhdmap.outputs import OutputFiles, OutputFolder
from lhdmap.provenance import sha256_of
from lhdmap.runfolder import RunFolder, RunFolderWriter, RunInfo

from tests.cli.logs import write_room_log


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_room_log(tmp_path_factory.mktemp("outputs") / "room.mcap", 60)


def old_run(target: Path) -> Path:
    """Make a complete folder with one file in it."""
    with RunFolderWriter("demo", target) as folder:
        (folder.path / "old.txt").write_text("old", encoding="utf-8")
        return folder.complete(RunInfo())


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_force_replaces_at_the_end_and_not_before(tmp_path: Path) -> None:
    old_run(tmp_path / "run")
    with RunFolderWriter("demo", tmp_path / "run", force=True) as folder:
        (folder.path / "new.txt").touch()
        assert names(tmp_path / "run") == ["old.txt", "run.json"]
        assert folder.complete(RunInfo()) == tmp_path / "run"
    assert names(tmp_path / "run") == ["new.txt", "run.json"]
    assert names(tmp_path) == ["run"]


@pytest.mark.parametrize("finished", [[], ["new.txt"]])
def test_a_run_that_ends_early_leaves_the_old_one_whole(tmp_path: Path, finished: list[str]) -> None:
    old_run(tmp_path / "run")

    def ended() -> None:
        with OutputFolder(tmp_path / "run", force=True) as folder:
            (folder.path / "new.txt").touch()
            folder.finished += finished
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught:
        ended()
    assert names(tmp_path / "run") == ["old.txt", "run.json"]
    assert names(tmp_path) == (["run", "run.partial"] if finished else ["run"])
    assert kept_with(caught.value) == ([tmp_path / "run.partial"] if finished else [])


def test_what_ctrl_c_finds_is_removed_or_named(tmp_path: Path) -> None:
    with OutputFolder(tmp_path / "one") as one, OutputFolder(tmp_path / "two") as two:
        one.finished.append("something")
        with OutputFiles(tmp_path / "a.mcap") as files:
            files.at(tmp_path / "a.mcap").touch()
            assert put_in_order() == [one.path]
            assert not two.path.exists()
            assert names(tmp_path) == ["one.partial"]
            files.at(tmp_path / "a.mcap").touch()
        two.path.mkdir()


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda path: (path / "mine").mkdir(parents=True), "was not made by lhdmap"),
        (lambda path: (path.mkdir(), (path / "map.json").write_text('{"tiles": []}')), "was not made by lhdmap"),
        (lambda path: (path.mkdir(), (path / "run.json").write_text("{")), "was not made by lhdmap"),
        (lambda path: path.touch(), "is a file"),
        (lambda path: path.symlink_to(old_run(path.parent / "behind")), "is a link"),
        (lambda path: path.symlink_to(path.parent / "nowhere"), "is a link"),
        (
            lambda path: path.with_name("run.partial").mkdir() or (path.parent / "run.partial" / "x").touch(),
            "in the way",
        ),
    ],
)
def test_force_spares_what_is_no_run(tmp_path: Path, make: object, told: str) -> None:
    assert callable(make)
    make(tmp_path / "run")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(UsageError, match=told):
        OutputFolder(tmp_path / "run", force=True)
    assert sorted(tmp_path.rglob("*")) == before


def test_an_empty_folder_is_refused_and_replaced(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    with pytest.raises(UsageError, match="-o OTHER"):
        OutputFolder(tmp_path / "run")
    with OutputFolder(tmp_path / "run", force=True) as folder:
        folder.complete()


def test_an_input_inside_is_spared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = old_run(tmp_path / "run")
    with pytest.raises(UsageError, match=r"old\.txt is in it"):
        OutputFolder(run, force=True, inputs=[run / "old.txt"])
    monkeypatch.chdir(run)
    with pytest.raises(UsageError, match="is in it"):
        OutputFolder(run, force=True)


def test_two_runs_at_once_do_not_meet(tmp_path: Path) -> None:
    with OutputFolder(tmp_path / "run") as first:
        first.finished.append("x")
        with pytest.raises(UsageError, match="another run is writing it"):
            OutputFolder(tmp_path / "run")
        assert first.path.is_dir()
    with pytest.warns(LhdmapWarning, match="left over"):
        third = OutputFolder(tmp_path / "run")
    with third:
        third.complete()
    assert names(tmp_path) == ["run"]


def test_a_name_that_is_taken_meanwhile_is_left_alone(tmp_path: Path) -> None:
    def late() -> None:
        with OutputFolder(tmp_path / "run") as folder:
            (folder.path / "mine.txt").touch()
            (tmp_path / "run").mkdir()
            folder.complete()

    with pytest.raises(UsageError, match="is there already") as caught:
        late()
    assert names(tmp_path / "run") == []
    assert kept_with(caught.value) == [tmp_path / "run.partial"]


def test_files_get_their_names_together(tmp_path: Path) -> None:
    paths = [tmp_path / "new" / name for name in ("a.txt", "a.mcap")]
    with OutputFiles(*paths) as files:
        for path in paths:
            files.at(path).write_text("new", encoding="utf-8")
        assert not any(path.exists() for path in paths)
    assert names(tmp_path / "new") == ["a.mcap", "a.txt"]
    with pytest.raises(UsageError, match="--force"):
        OutputFiles(*paths)

    def failed() -> None:
        with OutputFiles(*paths, force=True) as files:
            files.at(paths[0]).write_text("newer", encoding="utf-8")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        failed()
    assert [path.read_text(encoding="utf-8") for path in paths] == ["new", "new"]
    assert names(tmp_path / "new") == ["a.mcap", "a.txt"]


@pytest.mark.parametrize(
    "words",
    [
        ["build-map", "{log}", "-o", "{out}"],
        ["build-map", "{log}"],
        ["pile", "{log}", "-o", "{out}"],
        ["pile", "{log}"],
        ["rockbreaker", "plan", "--to", "6.27,-2.15,-1", "--no-pictures", "-o", "{out}"],
        ["rockbreaker", "workspace", "-o", "{out}"],
        ["simulate", "drift", "--length", "2", "--mesh-size", "0.3", "-o", "{out}.mcap"],
        ["simulate", "drift", "--length", "2", "--mesh-size", "0.3"],
        ["simulate", "grizzly", "-o", "{out}.ply"],
    ],
    ids=" ".join,
)
def test_a_second_run_is_refused_and_replaces_with_force(
    words: list[str], log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    here = tmp_path / "in" / "room.mcap"
    here.parent.mkdir()
    here.write_bytes(log.read_bytes())
    words = [word.format(log=here, out=tmp_path / "out") for word in words]
    assert main([*words, "--quiet"]) == 0
    before = {path: path.stat().st_ino for path in tmp_path.rglob("*") if path.is_file()}
    capsys.readouterr()
    assert main([*words, "--quiet"]) == 2
    told = capsys.readouterr().err
    assert len(told.splitlines()) == 1
    assert "--force" in told
    assert str(next(path for path in before if path != here).name.split(".")[0]) in told or str(tmp_path) in told
    assert {path: path.stat().st_ino for path in tmp_path.rglob("*") if path.is_file()} == before
    assert main([*words, "--quiet", "--force"]) == 0
    after = {path: path.stat().st_ino for path in tmp_path.rglob("*") if path.is_file()}
    assert after.keys() == before.keys()
    assert [path for path in after if after[path] == before[path]] == [here]


def limited(words: list[str], limit_bytes: int) -> subprocess.CompletedProcess[str]:
    """Run a command that can write no file larger than this."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes))

    command = [sys.executable, "-m", "lhdmap", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, preexec_fn=limit)


@pytest.mark.parametrize("limit_bytes", [2_000, 8_000, 20_000])
def test_a_disk_that_is_full_is_told_in_one_line(limit_bytes: int, tmp_path: Path) -> None:
    target = tmp_path / "a.mcap"
    done = limited(
        ["simulate", "drift", "--length", "2", "--mesh-size", "0.3", "-o", str(target), "--quiet", "--json"],
        limit_bytes,
    )
    assert done.returncode == 3
    assert len(done.stderr.strip().splitlines()) == 1
    assert "a.mcap: File too large" in done.stderr
    assert json.loads(done.stdout)["error"]["kind"] == "system"
    assert names(tmp_path) == []


@pytest.mark.parametrize("writer", ["write_odometry", "write_diagnostics", "write_trajectory", "complete"])
def test_no_space_at_any_writer_of_the_map(
    writer: str, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(MapFolderWriter, writer, full)
    assert main(["build-map", str(log), "-o", str(tmp_path / "map")]) == 3
    told = capsys.readouterr().err.strip().splitlines()[-1]
    assert f"{tmp_path / 'map.partial'}: No space left on device; make room" in told
    assert ("kept in" in told) == (tmp_path / "map.partial").exists() == (writer != "write_odometry")


@pytest.mark.parametrize("number", [13, 30])
def test_no_right_to_write_is_told(
    number: int, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(path: Path, *_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number), str(path))

    monkeypatch.setattr(Path, "mkdir", refused)
    for words in (
        ["build-map", str(log), "-o"],
        ["pile", str(log), "-o"],
        ["rockbreaker", "plan", "--to", "6,0,-1", "-o"],
    ):
        assert main([*words, str(tmp_path / "out")]) == 3
        told = capsys.readouterr().err.strip().splitlines()
        assert [line for line in told if not line.startswith("warning")] == [
            f"lhdmap: {tmp_path / 'out.partial'}: the output folder cannot be made: {os.strerror(number)}"
        ]


def test_standard_output_that_is_full_is_told() -> None:
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "lhdmap", "config", "pile"]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (3, "lhdmap: standard output: No space left on device\n")


def test_the_lock_goes_with_its_process(tmp_path: Path) -> None:
    (tmp_path / "run.partial").mkdir()
    with (tmp_path / "run.partial" / ".lhdmap").open("w") as mark:
        fcntl.flock(mark, fcntl.LOCK_EX)
        with pytest.raises(UsageError, match="another run"):
            OutputFolder(tmp_path / "run")
    with pytest.warns(LhdmapWarning, match="replaced"):
        folder = OutputFolder(tmp_path / "run")
    with folder:
        folder.complete()


def test_a_place_below_a_file_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be made"):
        OutputFolder(tmp_path / "file" / "run")
    with pytest.raises(InputError, match="cannot be made"), OutputFiles(tmp_path / "file" / "a.png"):
        pass


@pytest.mark.parametrize(
    ("kind", "words", "sources"),
    [
        ("map", ["build-map", "{log}", "--one-process"], ["{log}"]),
        ("pile", ["pile", "{log}", "--set", "pile.reach_m=40.0"], ["{log}"]),
        ("plan", ["rockbreaker", "plan", "--to", "6.27,-2.15,-1", "--no-pictures"], []),
        ("workspace", ["rockbreaker", "workspace"], []),
    ],
)
def test_each_command_says_what_it_made_and_of_what(
    kind: str, words: list[str], sources: list[str], log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*(word.format(log=log) for word in words), "-o", str(tmp_path / "out"), "--quiet"]) == 0
    run = RunFolder.open(tmp_path / "out", [kind])
    assert run.changed_files() == []
    listed = {path.relative_to(run.path).as_posix() for path in run.path.rglob("*") if path.is_file()}
    assert listed - set(run.info["files"]) == {"map.json" if kind == "map" else "run.json"}
    wanted = [Path(source.format(log=log)) for source in sources]
    assert [one["path"] for one in run.info["sources"]] == [str(path) for path in wanted]
    assert [one["sha256"] for one in run.info["sources"]] == [sha256_of(path) for path in wanted]
    capsys.readouterr()
    assert main(["info", str(run.path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["kind"], found["changed"]) == (kind, [])
    assert found["settings"] == ({"pile.reach_m": 40.0} if kind == "pile" else {})
