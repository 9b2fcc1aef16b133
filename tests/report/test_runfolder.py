"""The folder of a run of any kind: one writer and reader, hashes of all files, and folders of earlier versions."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap import __version__
from lhdmap.cli.main import main
from lhdmap.descriptions import described, kind_of
from lhdmap.errors import InputError
from lhdmap.mapfolder import MapFolder
from lhdmap.runfolder import RunFolder, RunFolderWriter, RunInfo

KINDS = ("pile", "plan", "workspace", "demo", "suite", "replay", "localization")
SOFTWARE = {"name": "lhdmap", "version": "0.0.9"}


def written(target: Path, kind: str = "replay", **more: Any) -> Path:
    source = target.parent / "scenario.toml"
    source.write_bytes(b"seed = 1\n")
    with RunFolderWriter(kind, target, inputs=[source]) as folder:
        folder.write_json("verdict.json", {"ok": True, "size_m": np.float64(2.5), "gap_m": float("nan")})
        folder.write_table("rows.parquet", {"stamp_ns": np.arange(4), "status": ["lost", "", "ü", "tracking"]})
        (folder.path / "inner").mkdir()
        (folder.path / "inner" / "part.txt").write_text("part", encoding="utf-8")
        return folder.complete(RunInfo([source], {"slip": {"k": 1}}, {"stops": 3}, ["late"], {"map": "grid"}, more))


@pytest.mark.parametrize("kind", KINDS)
def test_any_kind_reads_back(kind: str, tmp_path: Path) -> None:
    run = RunFolder.open(written(tmp_path / "run", kind, log="run.mcap"), [kind, "map"])
    assert (run.kind, kind_of(run.path)) == (kind, kind)
    assert run.json("verdict.json") == {"ok": True, "size_m": 2.5, "gap_m": None}
    rows = run.table("rows.parquet", ["status", "stamp_ns"])
    assert (rows["status"].tolist(), rows["stamp_ns"].tolist()) == (["lost", "", "ü", "tracking"], [0, 1, 2, 3])
    assert run.changed_files() == run.changed_files(by_size=True) == []
    with pytest.raises(InputError, match=rf"a map folder was wanted, this is a {kind} folder"):
        MapFolder.open(run.path)


def test_run_json_says_where_the_run_came_from(tmp_path: Path) -> None:
    info = json.loads((written(tmp_path / "run", log="run.mcap") / "run.json").read_text(encoding="utf-8"))
    digest = hashlib.sha256(b"seed = 1\n").hexdigest()
    assert info["software"] == {"name": "lhdmap", "version": __version__}
    assert info["sources"] == [{"path": str(tmp_path / "scenario.toml"), "sha256": digest, "bytes": 9}]
    assert (info["kind"], info["format_version"], info["log"]) == ("replay", 1, "run.mcap")
    assert (info["options"], info["counts"], info["warnings"]) == ({"slip": {"k": 1}}, {"stops": 3}, ["late"])
    assert sorted(info["files"]) == ["inner/part.txt", "rows.parquet", "verdict.json"]
    assert info["files"]["inner/part.txt"]["sha256"] == hashlib.sha256(b"part").hexdigest()


def test_a_run_within_a_run_is_known_by_its_description(tmp_path: Path) -> None:
    inner = written(tmp_path / "inner")
    with RunFolderWriter("demo", tmp_path / "outer") as folder:
        inner.rename(folder.path / "inner")
        outer = RunFolder.open(folder.complete(RunInfo(more={"map": "inner"})))
    assert list(outer.info["files"]) == ["inner/run.json"]
    (outer.path / "inner" / "run.json").write_text("{}", encoding="utf-8")
    assert outer.changed_files() == ["inner/run.json"]


def test_changed_files_are_found_by_hash_and_by_size(tmp_path: Path) -> None:
    run = RunFolder.open(written(tmp_path / "run"))
    (run.path / "inner" / "part.txt").write_text("PART", encoding="utf-8")
    (run.path / "rows.parquet").write_bytes(b"PAR1")
    assert run.changed_files() == ["inner/part.txt", "rows.parquet"]
    assert run.changed_files(by_size=True) == ["rows.parquet"]
    with pytest.raises(InputError, match=r"rows.parquet: not readable"):
        run.table("rows.parquet", ["stamp_ns"])
    with pytest.raises(InputError, match=r"the replay folder has no verdicts.json"):
        run.json("verdicts.json")


OLD = [
    ("pile", {"format_version": 1}, ["pile.json"]),
    ("plan", {"format_version": 1}, ["plan.json", "trajectory.csv"]),
    ("workspace", {"format_version": 1}, ["workspace.json"]),
    ("map", {"format_version": 1}, ["trajectory.tum", "pile.json"]),
]


@pytest.mark.parametrize(("kind", "info", "files"), OLD, ids=[kind for kind, *_ in OLD])
def test_folders_from_before_run_json_are_known(
    kind: str, info: dict[str, Any], files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "map.json").write_text(json.dumps(info | {"software": SOFTWARE, "files": {}}), encoding="utf-8")
    for name in files:
        (tmp_path / name).write_text("{}", encoding="utf-8")
    assert kind_of(tmp_path) == RunFolder.open(tmp_path).kind == kind
    assert main(["info", str(tmp_path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["kind"] == kind


def test_a_run_json_of_before_versions_were_written_is_known(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text(json.dumps({"software": SOFTWARE, "kind": "suite"}), encoding="utf-8")
    run = RunFolder.open(tmp_path)
    assert (run.kind, run.warnings, run.changed_files()) == ("suite", [], [])


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda path: None, "no such file or folder; a map or run folder of lhdmap was wanted"),
        (lambda path: path.touch(), "this is a file"),
        (lambda path: path.mkdir(), "it has no map.json or run.json"),
        (lambda path: (path.mkdir(), (path / "run.json").write_text("[]")), "not the description of a map or run"),
        (lambda path: (path.mkdir(), (path / "run.json").write_text('{"kind": "x"}')), "not written by lhdmap"),
        (lambda path: (path.mkdir(), (path / "run.json").write_text('{"format_version": 2}')), "format version 2"),
        (
            lambda path: (path.mkdir(), (path / "map.json").write_text('{"format_version": "1"}')),
            "format_version = '1'",
        ),
        (lambda path: (path.mkdir(), (path / "a.mcap").touch()), "is a log"),
    ],
)
def test_what_is_no_run_is_said(make: Any, told: str, tmp_path: Path) -> None:
    make(tmp_path / "run")
    assert described(tmp_path / "run") is None
    with pytest.raises(InputError, match=told):
        RunFolder.open(tmp_path / "run")


def test_open_map_names_the_map_within(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"this is a demo folder; .*the map in it: .*drive_map"):
        MapFolder.open(written(tmp_path / "run", "demo", map="drive_map"))
