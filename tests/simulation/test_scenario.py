"""Scenario files and the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from lhdmap.cli.main import main
from lhdmap.errors import ConfigError, InputError
from lhdmap.resources import resource
from lhdmap.simulation.scenario import DriftScenario, load_scenario, scenario_toml

QUICK = ["--length", "2", "--mesh-size", "0.3", "--no-rear", "--quiet"]


def test_a_scenario_survives_its_file(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(scenario_toml(DriftScenario(seed=9, planar=True)), encoding="utf-8")
    assert load_scenario(path) == DriftScenario(seed=9, planar=True)


def test_the_shipped_scenario_is_a_drive_of_a_minute_at_most() -> None:
    demo = load_scenario(resource("datasets/demo_drift.toml"))
    assert 10.0 <= demo.drive.speed_kmh <= 12.0
    assert demo.drive.distance_m == pytest.approx(60.0)
    assert any(grade <= -5.0 for _, _, grade in demo.drift.pieces)
    assert demo.scanner.rear


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[drift]\nhalf_with_m = 2.0", "half_width_m"),
        ("[drive]\nspeed_kmh = 400.0", "40"),
        ("seed = 'one'", "int"),
        ("seed = -1", "positive"),
        ("scenario = 'shaft'", "drift"),
        ("[wheel]", "wheels"),
        ("[drift]\npieces = [[1.0, 2.0]]", "3"),
    ],
)
def test_a_wrong_scenario_says_what_is_wrong(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=words):
        load_scenario(path)


def test_a_scenario_that_is_no_toml_is_an_input_error(tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    path.write_bytes(b"\xff\x00")
    with pytest.raises(InputError, match=r"wrong\.toml"):
        load_scenario(path)


def test_the_command_writes_log_truth_scenario_and_mesh(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "drift", "--seed", "3", "--mesh", "m.ply", "--json", *QUICK]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["log"] == "drift_seed3.mcap"
    assert result["distance_m"] == pytest.approx(2.0, abs=0.01)
    for name in ("log", "truth", "scenario", "mesh"):
        assert (tmp_path / result[name]).stat().st_size > 0
    assert main(["simulate", "drift", "--seed", "3", "--json", *QUICK]) == 2
    assert "drift_seed3.mcap: exists already" in json.loads(capsys.readouterr().out)["error"]["message"]


def test_options_go_over_the_scenario_file(tmp_path: Path) -> None:
    file, log = tmp_path / "mine.toml", tmp_path / "log.mcap"
    file.write_text("seed = 5\n[scanner]\nbeams = 761\nnoise_m = 0.02\n[drive]\nspeed_kmh = 6.0", encoding="utf-8")
    options = ["--roughness", "smooth", "--noise-mm", "25", "--sweep", "--slip", "--dust", "--planar", "--no-truth"]
    assert main(["simulate", str(file), "-o", str(log), "--stop", "1,2", "--reverse", "1.5,0.5", *options, *QUICK]) == 0
    used = load_scenario(tmp_path / "log.scenario.toml")
    assert (used.seed, used.scanner.beams, used.drive.speed_kmh) == (5, 761, 6.0)
    assert (used.drift.roughness_m, used.scanner.noise_m) == (0.005, 0.025)
    assert used.scanner.sweep
    assert used.wheels.slip
    assert used.planar
    assert not used.inclinometer.enabled
    assert not used.truth
    assert not used.scanner.rear
    assert min(used.scanner.dust_share, used.scanner.mixed_pixel_share, used.scanner.drop_out_share) > 0
    assert (used.drive.stops, used.drive.reversals) == (((1.0, 2.0),), ((1.5, 0.5),))


@pytest.mark.parametrize(
    "words",
    [
        ["shaft"],
        ["pile", "--variant", "heap"],
        ["drift", "--suite", "suite.toml"],
        ["drift", "--variant", "stope"],
        ["drift", "--roughness", "hairy"],
        ["drift", "--stop", "1"],
        ["drift", "--beams", "2"],
        ["drift", "-o", "log.bag"],
        ["drift", "--seed", "-4"],
        ["drift", "--machine", "drift.toml", "--speed-kmh", "0"],
    ],
)
def test_wrong_use_is_exit_code_2_and_writes_nothing(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", *words, *QUICK]) == 2
    assert capsys.readouterr().err.startswith("lhdmap: ")
    assert list(tmp_path.iterdir()) == []


def test_faults_of_a_file_are_in_the_log_and_in_the_scenario_beside_it(tmp_path: Path) -> None:
    from lhdmap.logs.source import LogSource

    faults = tmp_path / "faults.toml"
    faults.write_text('[[fault]]\nat_s = 1.0\nkind = "dead"\ntarget = "/inclinometer"\nduration_s = 0.5\n')
    first, again = tmp_path / "faulty.mcap", tmp_path / "again.mcap"
    assert main(["simulate", "drift", *QUICK, "--faults", str(faults), "-o", str(first)]) == 0
    with LogSource(first) as source:
        stamps = np.array([message.stamp_ns for _, message in source.messages(["inclinometer"])])
    assert np.flatnonzero(np.diff(stamps) > 10_000_001).tolist() == [99]
    assert stamps[100] - stamps[99] == pytest.approx(510_000_000, abs=1)
    assert main(["simulate", str(tmp_path / "faulty.scenario.toml"), "--quiet", "-o", str(again)]) == 0
    assert again.read_bytes() == first.read_bytes()


def test_a_fault_of_a_sensor_that_is_not_there_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    faults = tmp_path / "faults.toml"
    faults.write_text('[[fault]]\nkind = "dead"\ntarget = "/lidar/rear/scan"\n')
    assert main(["simulate", "drift", *QUICK, "--faults", str(faults), "-o", str(tmp_path / "x.mcap")]) == 2
    assert "no sensor writes to target '/lidar/rear/scan'" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [faults]
