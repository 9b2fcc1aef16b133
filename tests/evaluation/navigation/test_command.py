"""`lhdmap eval navigation`: output, folder, exit codes, logs that lack something."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.cli.main import main
from lhdmap.logs.writer import LogWriter

from tests.evaluation.navigation.drives import BEAMS, messages, scan, write_log

FIGURES = {
    "mean_speed_kmh", "max_speed_kmh", "length_s", "navigation_s", "stop_s", "teleoperation_s", "td_net_m",
    "td_travelled_m", "tad_net_m", "tad_travelled_m", "acd", "mcd", "asd", "msd", "adlw_m", "mdlw_m", "adrw_m", "mdrw_m",
}  # fmt: skip


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """12 s at 2 m/s by hand, straight."""
    return write_log(tmp_path_factory.mktemp("drive") / "drive.mcap")


def _json(capsys: pytest.CaptureFixture[str]) -> tuple[dict[str, Any], str]:
    output = capsys.readouterr()
    return json.loads(output.out), output.err


def test_json(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["eval", "navigation", str(log), "--load", "L", "--json", "--quiet"]) == 0
    found, said = _json(capsys)
    row = found["rows"][0]
    assert row.keys() >= FIGURES
    assert (row["operation"], row["load"], row["heading"]) == ("manual", "L", "F")
    assert row["mean_speed_kmh"] == pytest.approx(7.2, abs=1e-3)
    assert row["adlw_m"] == pytest.approx(2.0 - 1.225, abs=0.01)
    assert row["adrw_m"] == pytest.approx(1.8 - 1.225, abs=0.01)
    assert (row["acd"], row["asd"]) == (0.0, pytest.approx(0.0, abs=1e-4))
    assert [(group["operation"], group["load"], group["n"]) for group in found["groups"]] == [
        ("manual", "L", 1),
        ("manual", "all", 1),
    ]
    assert found["convention"]["rate_hz"] == 10.0
    assert len(found["paper"]["rows"]) == 18
    assert "warning" not in said


def test_folder_and_table(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["eval", "navigation", str(log), str(log), "--load", "E,L", "-o", str(out)]) == 0
    text = capsys.readouterr().out
    assert "paper µ of 14" in text
    assert "10 Hz" in text
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("<figure>") == 8
    with (out / "rows.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["load"] for row in rows] == ["E", "L"]
    with (out / "groups.csv").open(encoding="utf-8") as file:
        assert {line["of"] for line in csv.DictReader(file)} == {"logs", "paper"}
    assert main(["info", str(out), "--json"]) == 0
    assert _json(capsys)[0]["kind"] == "navigation"
    assert main(["eval", "navigation", str(log), "-o", str(out)]) == 2


@pytest.mark.parametrize(
    ("topics", "null", "word"),
    [
        ("jcmfr", ("mean_speed_kmh", "td_net_m", "asd", "adlw_m"), "no tachometer"),
        ("tcmfr", ("asd", "mdlw_m"), "no joint angles"),
        ("tjmfr", ("acd", "mcd"), "no commands"),
        ("tjcfr", ("teleoperation_s", "tad_net_m"), "no mode"),
        ("tjcm", ("adlw_m", "mdrw_m"), "no front scanner"),
    ],
)
def test_what_a_log_lacks_is_null(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], topics: str, null: tuple[str, ...], word: str
) -> None:
    log = write_log(tmp_path / "drive.mcap", length_s=6.0, topics=topics)
    assert main(["eval", "navigation", str(log), "--json", "--quiet", "-o", str(tmp_path / "out")]) == 0
    found, said = _json(capsys)
    row = found["rows"][0]
    assert [row[name] for name in null] == [None] * len(null)
    assert word in said
    assert word in " ".join(row["warnings"])
    known = FIGURES - set(null) - {"tad_net_m", "tad_travelled_m"}
    assert word == "no tachometer" or sum(row[name] is not None for name in known) > 8


def test_a_log_that_is_cut_off(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = log.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: len(data) * 6 // 10])
    assert main(["eval", "navigation", str(cut), "--json", "--quiet"]) == 0
    found, said = _json(capsys)
    assert 2.0 < found["rows"][0]["length_s"] <= 12.1
    assert "cut.mcap" in said


def test_one_log_that_cannot_be_used_does_not_stop_the_others(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "no.mcap").write_bytes(b"nothing")
    assert main(["eval", "navigation", str(tmp_path / "no.mcap"), str(log), "--json", "--quiet"]) == 3
    found, _ = _json(capsys)
    assert found["error"]["exit_code"] == 3
    assert found["rows"][0]["problem"]
    assert found["rows"][1]["mean_speed_kmh"] == pytest.approx(7.2, abs=1e-3)
    assert found["groups"][0]["n"] == 1


@pytest.mark.parametrize(
    ("limit", "code"),
    [
        (("--min-mean-speed-kmh", "7.0"), 0), (("--min-mean-speed-kmh", "7.5"), 1), (("--max-acd", "0.001"), 0),
        (("--min-wall-m", "0.5"), 0), (("--min-wall-m", "0.6"), 1), (("--load", "X"), 2), (("--load", "E,L"), 2),
        (("--operation", "robot"), 2),
    ],
)  # fmt: skip
def test_limits_and_wrong_options(log: Path, limit: tuple[str, str], code: int) -> None:
    assert main(["eval", "navigation", str(log), "--quiet", *limit]) == code


def test_a_log_with_scans_alone_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = write_log(tmp_path / "scans.mcap", length_s=2.0, topics="fr")
    assert main(["eval", "navigation", str(log)]) == 3
    assert "no tachometer" in capsys.readouterr().err


def test_a_dead_scanner_costs_the_walls_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "dead.mcap"
    with LogWriter(log) as writer:
        for k, message in enumerate(messages(6.0, lambda t: 2.0 + 0.01 * t, lambda t: 0.01 * t)):
            writer.write(f"/machine/{('tachometer', 'joints', 'command')[k % 3]}", message)
            if k % 6 == 0:
                writer.write("/lidar/front/scan", scan("front", (k // 3) / 50.0, np.full(BEAMS, np.inf)))
    assert main(["eval", "navigation", str(log), "--json", "--quiet"]) == 0
    found, said = _json(capsys)
    assert found["rows"][0]["mean_speed_kmh"] == pytest.approx(7.3, abs=0.05)
    assert found["rows"][0]["adlw_m"] is None
    assert "/lidar/front/scan" in said
