"""`localize` and `eval localization` on a second drive through a small mine, in the map of a first one, from the logs alone."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow.parquet as pq
import pytest
from lhdmap.cli.main import main
from lhdmap.config import settings_from
from lhdmap.errors import InputError, UsageError
from lhdmap.localization.rows import TRACKING, UNKNOWN, LocalizationRow
from lhdmap.logs.source import LogSource
from lhdmap.logs.writer import LogWriter
from lhdmap.machine import Machine
from lhdmap.messages import Tachometer
from lhdmap.pipeline.build import BuildRequest, build_map
from lhdmap.pipeline.inputs import ROLES_READ
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.pipeline.localize import Localizer
from lhdmap.pipeline.localize_run import LocalizeRequest, LocalizeResult, localize
from lhdmap.runfolder import RunFolder
from lhdmap.simulation.mine_drive import MineDriveSettings, SimulatedMineDrive, simulate_mine
from lhdmap.simulation.sensing.sections import ScannerSettings, SensorSettings
from lhdmap.trajectory import read_tum

from tests.exports.folders import map_folder
from tests.mine.plans import lines, network_of

SETTINGS = settings_from({"pile.method": "off", "recording.scan_interval_s": 5.0})
PLAN = lines(("A", [[0, 0, 0], [50, 0, 0]]), ("B", [[28, 0, 0], [28, 22, 0]]))
PARK = {"drift": "A", "at_m": 5.0, "kind": "park", "name": "Park"}


class Mine(NamedTuple):
    """Two drives in one mine, and the map of the first."""

    teaching: SimulatedMineDrive
    second: SimulatedMineDrive
    map: Path


@pytest.fixture(scope="module")
def mine(tmp_path_factory: pytest.TempPathFactory) -> Mine:
    folder = tmp_path_factory.mktemp("mine")
    network = network_of(PLAN, place=[PARK], seed=4)
    sensors = SensorSettings(scanner=ScannerSettings(rate_hz=10.0))
    drives = [
        simulate_mine(
            network, Machine(), MineDriveSettings(seed=seed, names=True, sensors=sensors), folder / f"{seed}.mcap"
        )
        for seed in (1, 2)
    ]
    return Mine(drives[0], drives[1], build_map(BuildRequest([drives[0].log], folder / "map", SETTINGS)).folder)


@pytest.fixture(scope="module")
def found(mine: Mine) -> LocalizeResult:
    """The second drive, of whose start nothing is told."""
    return localize(LocalizeRequest([mine.second.log], mine.map, mine.map.with_name("run"), SETTINGS))


def test_a_start_that_is_not_told_is_found(found: LocalizeResult) -> None:
    statuses = [row.status for row in found.rows]
    assert statuses[0] == UNKNOWN
    assert statuses[-1] == TRACKING
    assert found.summary["tracking_share"] > 0.7
    assert 5.0 < found.summary["first_fix_m"] < 40.0
    assert found.summary["lost_stretches"] == 0


def test_it_is_right_against_the_truth(found: LocalizeResult, mine: Mine, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--truth", str(mine.second.truth_file), "--map-truth", str(mine.teaching.truth_file)]
    words += ["--nodes", str(mine.second.nodes_file)]
    capsys.readouterr()
    assert main(["eval", "localization", str(found.folder), *words]) == 0
    assert f"first fix    after {found.summary['first_fix_s']:.1f} s and " in capsys.readouterr().out
    assert main(["eval", "localization", str(found.folder), *words, "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["scans"] == len(found.rows)
    assert figures["false_fixes"] == 0
    assert figures["along_m"]["max"] < 0.05
    assert figures["across_m"]["max"] < 0.05
    assert figures["heading_deg"]["max"] < 0.5
    assert figures["node_accuracy"] > 0.95
    assert figures["first_fix_m"] == pytest.approx(found.summary["first_fix_m"], abs=1.0)


def test_the_folder_is_whole(found: LocalizeResult, capsys: pytest.CaptureFixture[str]) -> None:
    folder = RunFolder.open(found.folder, ["localization"])
    assert {one.name for one in found.folder.iterdir()} >= {"localization.parquet", "localization.tum", "report.html"}
    table = pq.read_table(found.folder / "localization.parquet")
    assert table.column_names == list(LocalizationRow._fields)
    assert table["stamp_ns"].to_pylist() == [row.stamp_ns for row in found.rows]
    tracked = [row for row in found.rows if row.status == TRACKING]
    path = read_tum(found.folder / "localization.tum")
    assert path.stamps_ns.tolist() == [row.stamp_ns for row in tracked]
    assert path.positions_m[:, 0] == pytest.approx([row.x_m for row in tracked], abs=1e-6)
    assert folder.info["options"]["request"]["map"]
    capsys.readouterr()
    assert main(["info", str(found.folder)]) == 0
    told = capsys.readouterr().out
    assert told.startswith("localization")
    assert f"tracked      {100 * found.summary['tracking_share']:.1f} %" in told


def test_live_it_says_the_same(found: LocalizeResult, mine: Mine) -> None:
    """Message by message, with a question after each scan: a question changes nothing."""
    last = 0
    with LogSource([mine.second.log]) as source:
        machine = Machine()
        with Localizer(KnownMap.read(mine.map), SETTINGS, machine) as localizer:
            for role, message in source.messages([role for role in ROLES_READ if role in source.roles]):
                localizer.update(role, message)
                if role == "front":
                    localizer.pose_at(message.stamp_ns)
                    assert len(localizer.rows) >= last
                    last = len(localizer.rows)
            localizer.finish()
    assert last > 0.9 * len(found.rows)  # rows come while messages do, not at the end
    live = [row._replace(latency_ms=0.0) for row in localizer.rows]
    assert [repr(row) for row in live] == [repr(row._replace(latency_ms=0.0)) for row in found.rows]


def test_a_start_that_is_told_is_tracked_from_the_first_scan(
    mine: Mine, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["localize", str(mine.second.log), "--map", str(mine.map), "-o", str(tmp_path / "run"), "--start", "0,0,0"]
    capsys.readouterr()
    assert main([*words, "--set", "pile.method=off", "--json"]) == 0
    table = json.loads(capsys.readouterr().out)
    assert set(table) >= {"scans", "tracking_share", "first_fix_s", "first_fix_m", "lost_stretches", "false_fix_guard"}
    assert table["tracking_share"] > 0.99
    assert table["first_fix_s"] == 0.0


def test_a_start_that_is_not_on_the_map_is_told_with_the_nearest(
    mine: Mine, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["localize", str(mine.second.log), "--map", str(mine.map), "-o", str(tmp_path / "run")]
    assert main([*words, "--start", "Parc"]) == 2
    assert "Park" in capsys.readouterr().err
    assert main([*words, "--start", "1,2,north"]) == 2
    assert "three numbers" in capsys.readouterr().err


def test_a_map_without_landmarks_says_what_to_do(mine: Mine, tmp_path: Path) -> None:
    folder = map_folder(tmp_path / "old")
    with pytest.raises(InputError, match=r"landmarks\.npz.*lhdmap build-map"):
        localize(LocalizeRequest([mine.second.log], folder, tmp_path / "run", SETTINGS))
    plain = map_folder(tmp_path / "plain", plain=True)
    with pytest.raises(InputError, match="lhdmap build-map"):
        localize(LocalizeRequest([mine.second.log], plain, tmp_path / "run", SETTINGS))
    assert not (tmp_path / "run").exists()


def test_a_log_without_scans_is_refused(mine: Mine, tmp_path: Path) -> None:
    log = tmp_path / "wheels.mcap"
    with LogWriter(log) as writer:
        for k in range(50):
            writer.write("/tachometer", Tachometer(1_700_000_000_000_000_000 + k * 20_000_000, 1.0))
    with pytest.raises(InputError, match="scan"):
        localize(LocalizeRequest([log], mine.map, tmp_path / "run", SETTINGS))
    assert not (tmp_path / "run").exists()


def test_what_is_there_is_not_replaced(found: LocalizeResult, mine: Mine) -> None:
    with pytest.raises(UsageError):
        localize(LocalizeRequest([mine.second.log], mine.map, found.folder, SETTINGS))
    with pytest.raises(UsageError):
        localize(LocalizeRequest([mine.second.log], mine.map, mine.map, SETTINGS, force=True))


def test_truth_of_another_drive_is_refused(found: LocalizeResult, mine: Mine, tmp_path: Path) -> None:
    other = tmp_path / "other.tum"
    other.write_text("".join(f"{k}.0 {k}.0 0 0 0 0 0 1\n" for k in range(9)))
    words = ["eval", "localization", str(found.folder)]
    truth, teaching = str(mine.second.truth_file), str(mine.teaching.truth_file)
    assert main([*words, "--truth", str(other), "--map-truth", teaching]) == 3
    assert main([*words, "--truth", truth, "--map-truth", str(other)]) == 3
    assert main([*words, "--truth", truth, "--map-truth", teaching, "--map", str(tmp_path)]) == 3


def test_headings_of_the_path_are_those_of_the_rows(found: LocalizeResult) -> None:
    tracked = [row for row in found.rows if row.status == TRACKING]
    x, y, z, w = read_tum(found.folder / "localization.tum").quaternions_xyzw.T
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    assert yaw == pytest.approx([row.yaw_rad for row in tracked], abs=1e-6)
