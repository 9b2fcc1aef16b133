"""`lhdmap pile` as a user types it, on a simulated drive: against the truth of the scene's mesh, and on damaged input."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from lhdmap.cli.main import main
from lhdmap.simulation.drive import SimulatedDrive, simulate_drift
from lhdmap.simulation.pile_scenes import scene

from tests.cli.logs import write_room_log


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> SimulatedDrive:
    return simulate_drift(scene("normal", 3001), tmp_path_factory.mktemp("pile") / "drive.mcap")


def found(words: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[dict[str, Any], str]:
    """Run the command and return its JSON and what it said beside it."""
    assert main([*words, "--json", "--quiet"]) == 0
    told = capsys.readouterr()
    return json.loads(told.out), told.err


def test_the_log_alone_gives_the_pile(
    drive: SimulatedDrive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Within the 90th percentiles that are wanted of drives from the log alone."""
    values, _ = found(["pile", str(drive.log), "-o", str(tmp_path / "out")], capsys)
    truth = drive.pile
    assert truth is not None
    assert values["status"] == truth.status == "loadable"
    assert values["width_m"] == pytest.approx(truth.width_m, abs=0.30)
    assert values["inclination_deg"] == pytest.approx(truth.inclination_deg, abs=4.0)
    assert values["identified"]
    assert 0.0 < values["distance_at_decision_m"] < 45.0
    folder = Path(values["folder"])
    assert {path.name for path in folder.iterdir()} == {"run.json", "pile.json", "pile.rrd", "report.html"}
    written = json.loads((folder / "pile.json").read_text(encoding="utf-8"))
    assert written == {key: value for key, value in values.items() if key != "folder"}


def test_ground_truth_is_no_input_unless_asked_for(
    drive: SimulatedDrive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["pile", str(drive.log), "-o", str(tmp_path / "out"), "--poses", "ground-truth"]
    values, _ = found(words, capsys)
    assert drive.pile is not None
    assert values["width_m"] == pytest.approx(drive.pile.width_m, abs=0.25)
    assert values["inclination_deg"] == pytest.approx(drive.pile.inclination_deg, abs=1.8)


def test_a_cut_off_log_is_used_and_the_damage_told(
    drive: SimulatedDrive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "cut.mcap"
    log.write_bytes(drive.log.read_bytes()[: drive.log.stat().st_size * 9 // 10])
    values, told = found(["pile", str(log), "-o", str(tmp_path / "out")], capsys)
    assert values["status"] == "loadable"
    assert any("cut.mcap" in text for text in values["warnings"])
    assert "cut.mcap: the record at byte" in told


def test_without_an_inclinometer_it_says_that_none_was_looked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = write_room_log(tmp_path / "room.mcap")
    values, told = found(["pile", str(log), "-o", str(tmp_path / "out")], capsys)
    assert not values["identified"]
    assert "no inclinometer" in told
    assert values["status"] is None
    assert values["probabilities"] is None
    assert "no inclinometer" in values["reason"]
    assert json.loads((tmp_path / "out" / "pile.json").read_text(encoding="utf-8"))["status"] is None
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "No pile was looked for" in page
    assert "100 %" not in page
    assert main(["pile", str(log), "-o", str(tmp_path / "again")]) == 0
    text = capsys.readouterr().out
    assert "unknown: no pile was looked for" in text
    assert "100 %" not in text
    assert "none" not in text
    assert main(["info", str(tmp_path / "again")]) == 0
    assert "pile         unknown: no pile was looked for" in capsys.readouterr().out


def test_a_pile_that_is_not_to_be_looked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = write_room_log(tmp_path / "room.mcap")
    assert main(["pile", str(log), "-o", str(tmp_path / "out"), "--set", 'pile.method="off"']) == 2
    assert "pile.method" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_drift_that_goes_on_is_none_and_nothing_else(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "drift.mcap"
    assert main(["simulate", "drift", "--length", "40", "--roughness", "moderate", "-o", str(log), "--quiet"]) == 0
    capsys.readouterr()
    assert main(["pile", str(log), "-o", str(tmp_path / "out"), "--quiet"]) == 0
    text = capsys.readouterr().out
    assert "none: nothing closes the drift (" in text
    assert "decided" not in text
    assert "width" not in text


def test_the_cloud_of_a_grizzly_gets_no_status(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cloud = str(tmp_path / "g.ply")
    assert main(["simulate", "grizzly", "--seed", "3", "-o", cloud, "--quiet"]) == 0
    capsys.readouterr()
    values, _ = found(["pile", cloud, "-o", str(tmp_path / "out")], capsys)
    assert values["status"] is None
    assert values["probabilities"] is None
    assert "no drift is seen around it" in values["reason"]
    assert all(values[name] is None for name in ("width_m", "inclination_deg", "volume_m3", "center_m"))
    written = json.loads((tmp_path / "out" / "pile.json").read_text(encoding="utf-8"))
    assert written["status"] is None
    assert main(["pile", cloud, "--quiet"]) == 0
    told = capsys.readouterr()
    assert "unknown: the largest face stands at 8" in told.out
    assert "%" not in told.out
    assert "nan" not in told.out
    assert "volume" not in told.out
    assert told.err == ""
