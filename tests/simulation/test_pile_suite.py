"""Suites of piles: logs, truth and table, by the command line."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.cli.main import main
from lhdmap.errors import ConfigError, InputError
from lhdmap.logs.formats import open_log
from lhdmap.messages import LaserScan
from lhdmap.resources import resource
from lhdmap.runfolder import RunFolder
from lhdmap.simulation.pile_sections import VARIANTS
from lhdmap.simulation.pile_suite import SuiteScene, load_suite
from lhdmap.trajectory import read_tum

ROOT = Path(__file__).resolve().parents[2]
SUITE = '[[scenes]]\nvariant = "wall"\nfirst_seed = 4\n\n[[scenes]]\nvariant = "post"\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    base = tmp_path_factory.mktemp("suite")
    (base / "two.toml").write_text(SUITE, encoding="utf-8")
    assert main(["simulate", "pile", "--suite", str(base / "two.toml"), "-o", str(base / "out"), "--quiet"]) == 0
    return base / "out"


def truth_of(folder: Path, name: str) -> dict[str, Any]:
    table: dict[str, Any] = json.loads((folder / f"{name}.pile.json").read_text(encoding="utf-8"))
    return table


def test_the_table_is_in_the_style_of_table_6(folder: Path) -> None:
    with (folder / "truth.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["attempt"] for row in rows] == ["wall_4", "post_0"]
    assert list(rows[0]) == ["attempt", "log", "gt_width_m", "gt_inclination_deg", "gt_status"]
    assert all((folder / row["log"]).is_file() for row in rows)
    assert [row["gt_status"] for row in rows] == ["wall", "none"]
    assert (rows[1]["gt_width_m"], rows[1]["gt_inclination_deg"]) == ("", "")
    truth = truth_of(folder, "wall_4")
    assert float(rows[0]["gt_width_m"]) == pytest.approx(truth["width_m"], abs=1e-4)
    assert float(rows[0]["gt_inclination_deg"]) == pytest.approx(truth["inclination_deg"], abs=1e-3)


def test_the_truth_has_a_distance_for_each_scan(folder: Path) -> None:
    truth, drive = truth_of(folder, "wall_4"), read_tum(folder / "wall_4.truth.tum")
    assert truth["stamps_ns"] == drive.stamps_ns.tolist()
    toe = np.array(truth["toe_m"])
    nearest = np.linalg.norm(drive.positions_m[-1, :2] - toe[:, :2], axis=1).min()
    assert truth["distance_to_toe_m"][-1] == pytest.approx(nearest, abs=1e-3)


def test_the_log_shows_the_wall_at_its_distance(folder: Path) -> None:
    """The middle beam of the last scan meets the wall where the truth says that it is."""
    with open_log(folder / "wall_4.mcap") as log:
        scans = [record.message for record in log.records() if record.topic == "/lidar/front/scan"]
    last = scans[-1]
    assert isinstance(last, LaserScan)
    middle = np.nanmedian(last.ranges_m[len(last.ranges_m) // 2 - 10 : len(last.ranges_m) // 2 + 10])
    assert middle + 0.8 == pytest.approx(truth_of(folder, "wall_4")["distance_to_toe_m"][-1], abs=0.6)


@pytest.mark.filterwarnings("default::lhdmap.errors.LhdmapWarning")
def test_a_suite_goes_on_where_it_was_interrupted(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["simulate", "pile", "--suite", str(folder.parent / "two.toml"), "-o", str(tmp_path / "out"), "--json"]

    def interrupted(one: SuiteScene, to: Path) -> str:
        if one.variant == "post":
            raise KeyboardInterrupt
        for file in folder.glob(f"{one.name}.*"):
            shutil.copy(file, to)
        return one.name

    with monkeypatch.context() as patch:
        patch.setattr("lhdmap.simulation.pile_suite._write", interrupted)
        assert main(words) == 4
    assert f"kept in {tmp_path / 'out.partial'}" in json.loads(capsys.readouterr().out)["error"]["message"]
    before = (tmp_path / "out.partial" / "wall_4.mcap").stat().st_ino
    assert main(words) == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["scenes"] == 2
    assert "is gone on with" in told.err
    assert (tmp_path / "out" / "wall_4.mcap").stat().st_ino == before
    assert (tmp_path / "out" / "truth.csv").read_bytes() == (folder / "truth.csv").read_bytes()


def test_the_folder_says_which_file_it_was_made_of(folder: Path) -> None:
    run = RunFolder.open(folder, ["suite"])
    assert [one["path"] for one in run.info["sources"]] == [str(folder.parent / "two.toml")]
    assert {"truth.csv", "wall_4.mcap", "wall_4.pile.json"} <= set(run.info["files"])
    assert (run.info["scenes"], run.changed_files()) == (["wall_4", "post_0"], [])


def test_a_suite_that_is_there_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "pile", "--suite", str(folder.parent / "two.toml"), "-o", str(folder)]) == 2
    assert "--force" in capsys.readouterr().err


def test_the_same_words_write_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    log = tmp_path / "again.mcap"
    assert main(["simulate", "pile", "--variant", "wall", "--seed", "4", "-o", str(log), "--quiet"]) == 0
    assert log.read_bytes() == (folder / "wall_4.mcap").read_bytes()
    assert (tmp_path / "again.pile.json").read_bytes() == (folder / "wall_4.pile.json").read_bytes()


def test_the_shipped_suites_have_all_variants_and_no_seed_in_common() -> None:
    development = load_suite(ROOT / "datasets" / "pile_dev.toml")
    evaluation = load_suite(ROOT / "evaluation" / "pile_suite.toml")
    for scenes in (development, evaluation):
        assert {one.variant for one in scenes} == set(VARIANTS)
    assert not set(development) & set(evaluation)
    assert sum(one.variant == "normal" and not one.flat_floor for one in evaluation) >= 40
    assert resource("datasets/pile_dev.toml").is_file()


@pytest.mark.parametrize(
    ("text", "error", "part"),
    [
        ("", ConfigError, "scenes"),
        ("[[scene]]\n", ConfigError, "did you mean 'scenes'"),
        ('[[scenes]]\nvariant = "stop"\n', ConfigError, "stope"),
        ("[[scenes]]\ncount = 0\n", ConfigError, "count"),
        ("[[scenes]]\n[[scenes]]\n", ConfigError, "twice"),
        ("[[scenes]", InputError, "readable"),
    ],
)
def test_wrong_suites_are_refused(text: str, error: type[Exception], part: str, tmp_path: Path) -> None:
    path = tmp_path / "suite.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(error, match=part):
        load_suite(path)
