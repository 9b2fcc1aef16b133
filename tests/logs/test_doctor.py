"""`lhdmap doctor`: healthy logs, each kind of defect, and the traps of the real recordings."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.cli.main import main
from lhdmap.logs.doctor.finding import Severity
from lhdmap.logs.doctor.health import Examination, LogVerdict, examine
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import Inclination, LaserScan, Message, Mount, Tachometer

START, STEP = 1_700_000_000 * 10**9, 20_000_000
FRONT = "/lidar/front/scan"
Change = Callable[[int, LaserScan], LaserScan]


def _drive(count: int = 200) -> list[LaserScan]:
    """Scans of a machine that moves between walls: ranges change from scan to scan, some beams see nothing."""
    rng = np.random.default_rng(0)
    scans = []
    for i in range(count):
        ranges = (5.0 + np.sin(0.05 * i + np.linspace(0, 6, 181)) + rng.normal(0, 0.01, 181)).astype(np.float32)
        ranges[::20] = np.inf
        scans.append(LaserScan(START + i * STEP, "front", -np.pi / 2, np.pi / 180, 1e-5, 0.1, 80.0, ranges))
    return scans


def _write(path: Path, scans: Iterable[LaserScan], others: Iterable[tuple[str, Message]] = ()) -> Path:
    with LogWriter(path) as writer:
        writer.write("/tf_static", Mount(START, "base_link", "front", np.eye(4)))
        for topic, message in others:
            writer.write(topic, message)
        for i, scan in enumerate(scans):
            writer.write(FRONT, scan, START + i * STEP)
    return path


def _texts(outcome: Examination, *severities: Severity) -> str:
    return "\n".join(finding.text for finding in outcome.findings if not severities or finding.severity in severities)


def test_a_healthy_log(tmp_path: Path) -> None:
    others: list[tuple[str, Message]] = []
    for i in range(200):
        stamp = START + i * STEP
        others.append(("/inclinometer", Inclination(stamp, "front", 0.001 * i, 0.0, None, np.array([0, 0, 9.8]))))
        others.append(("/machine/tachometer", Tachometer(stamp, 0.01 * i)))
    outcome = examine(_write(tmp_path / "log.mcap", _drive(), others))
    assert outcome.verdict is LogVerdict.USABLE, outcome.findings
    assert outcome.inventory is not None
    assert outcome.inventory.topics[FRONT].rate_hz == pytest.approx(50.0)


def _own_body(_: int, scan: LaserScan) -> LaserScan:
    ranges = scan.ranges_m.copy()
    ranges[60:70] = 0.8
    return scan._replace(ranges_m=ranges)


def _ranged(scan: LaserScan, value: float) -> LaserScan:
    return scan._replace(ranges_m=np.full(181, value, np.float32))


def _saturated(_: int, scan: LaserScan) -> LaserScan:
    ranges = np.where(np.isinf(scan.ranges_m), np.float32(80.0), scan.ranges_m)
    return scan._replace(ranges_m=ranges)


DEFECTS: dict[str, tuple[Change, Severity, str]] = {
    "frozen": (lambda i, scan: _ranged(scan, 3.0), Severity.PROBLEM, "frozen: 200"),
    "dead": (lambda i, scan: _ranged(scan, np.inf), Severity.FATAL, "dead: only 0.0 %"),
    "saturated": (_saturated, Severity.PROBLEM, "saturated: 6 %"),
    "own body": (_own_body, Severity.REMARK, "10 beams never change (-30 to -21 deg, 0.80 m)"),
    "interlaced": (
        lambda i, scan: scan._replace(angle_min_rad=scan.angle_min_rad + (i % 4) * 0.00436),
        Severity.REMARK,
        "interlaced: 4 start angles",
    ),
    "backward": (
        lambda i, scan: scan._replace(stamp_ns=scan.stamp_ns - (10**9 if i == 100 else 0)),
        Severity.REMARK,
        "1 stamps run backwards, by up to 0.980 s",
    ),
    "unstamped": (lambda i, scan: scan._replace(stamp_ns=0), Severity.REMARK, "200 of 200 messages have no stamp"),
    "late": (
        lambda i, scan: scan._replace(stamp_ns=scan.stamp_ns - 5 * 10**9),
        Severity.REMARK,
        "log time minus header stamp is 5.000 to 5.000 s",
    ),
    "gap": (
        lambda i, scan: scan._replace(stamp_ns=scan.stamp_ns + (2 * 10**9 if i >= 100 else 0)),
        Severity.REMARK,
        "1 gap, the longest 2.02 s, 2.0 s after the start",
    ),
    "same stamps": (
        lambda i, scan: scan._replace(stamp_ns=START + (i // 2) * STEP),
        Severity.REMARK,
        "100 of 200 messages have the stamp of the one before",
    ),
    "zero increment": (lambda i, scan: scan._replace(angle_increment_rad=0.0), Severity.FATAL, "increment is zero"),
    "limits": (lambda i, scan: scan._replace(range_max_m=0.0), Severity.FATAL, "range limits are impossible"),
    "sweep": (lambda i, scan: scan._replace(time_increment_s=0.001), Severity.PROBLEM, "a sweep takes 0.181 s"),
    "mount": (lambda i, scan: scan._replace(frame_id="laser"), Severity.REMARK, "no mount of its frame 'laser'"),
}


@pytest.mark.parametrize("name", sorted(DEFECTS))
def test_each_defect_is_found(tmp_path: Path, name: str) -> None:
    change, severity, text = DEFECTS[name]
    outcome = examine(_write(tmp_path / "log.mcap", [change(i, scan) for i, scan in enumerate(_drive())]))
    assert text in _texts(outcome, severity), outcome.findings
    wanted = LogVerdict.UNUSABLE if severity is Severity.FATAL else LogVerdict.REMARKS
    assert outcome.verdict is wanted


def test_a_standing_machine_has_no_own_body_and_is_not_frozen(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    scans = [scan._replace(ranges_m=rng.normal(4, 0.005, 181).astype(np.float32)) for scan in _drive()]
    assert _texts(examine(_write(tmp_path / "log.mcap", scans)), Severity.REMARK, Severity.PROBLEM) == ""


def test_sensors_that_are_wrong(tmp_path: Path) -> None:
    others: list[tuple[str, Message]] = []
    for i in range(100):
        stamp = START + i * STEP
        others.append(("/inclinometer", Inclination(stamp, "front", 1.5, 0.0, None, np.array([0.0, 0, 1.0]))))
        others.append(("/machine/tachometer", Tachometer(stamp, 1.25)))
    text = _texts(examine(_write(tmp_path / "log.mcap", _drive(), others)))
    assert "roll or pitch reaches 86 deg" in text
    assert "the mean acceleration is 1.00 m/s2" in text
    assert "its value never changes (1.25)" in text


def test_doubt_about_the_scanner_is_said_with_its_cure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "log.mcap"
    with LogWriter(path) as writer:
        for scan in _drive(20):
            writer.write("/left/scan", scan)
            writer.write("/right/scan", scan)
    assert main(["doctor", str(path), "--quiet"]) == 3  # as build-map
    assert "name it: --topic front=/left/scan" in " ".join(capsys.readouterr().out.split())
    assert main(["doctor", str(path), "--quiet", "--topic", "front=/right/scan"]) == 0
    assert "name it" not in capsys.readouterr().out


def _json(paths: list[Path], capsys: pytest.CaptureFixture[str]) -> tuple[int, list[dict[str, Any]]]:
    code = main(["doctor", "--json", *map(str, paths)])
    logs: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["logs"]
    return code, logs


def test_json_and_exit_codes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good = _write(tmp_path / "log.mcap", _drive(50))
    code, (log,) = _json([good], capsys)
    assert code == 0
    assert log["format"] == "mcap"
    assert log["duration_s"] == pytest.approx(49 * 0.02)
    assert log["topics"][FRONT]["count"] == 50
    assert log["topics"][FRONT]["role"] == "front"
    code, (first, second) = _json([good, tmp_path / "absent.mcap"], capsys)
    assert code == 3
    assert second["verdict"] == "not usable"
    assert first["verdict"] == log["verdict"]
    assert "no such file" in second["findings"][0]["text"]


def test_bad_option(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good = _write(tmp_path / "log.mcap", _drive(5))
    assert main(["doctor", str(good), "--topic", "front"]) == 2
    assert "role=/topic was wanted" in capsys.readouterr().err


def test_cut_off_log_is_usable_with_remarks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = _write(tmp_path / "log.mcap", _drive(2000))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    code, (log,) = _json([path], capsys)
    assert (code, log["verdict"]) == (0, "usable with remarks")
    assert any("damaged" in finding["text"] for finding in log["findings"])
    assert 500 < log["topics"][FRONT]["count"] < 1900


TRAPS = {
    "01_carmen_intel/intel.clf.bz2": ["631 stamps run backwards, by up to 0.897 s (the log time does too)"],
    "01_carmen_intel/intel-lab.graph.log": ["180 beams of 1.000 deg end at 89.00 deg, 90.00 deg is stated"],
    "02_carmen_aces/aces.mcap": ["1 gap, the longest 3.03 s"],
    "02_carmen_aces/aces-corrected.log.gz": ["key scans only: 0.74 m between scans"],
    "03_carmen_csail/mit-csail.graph.log": ["361 beams of 0.500 deg end at 90.01 deg, 90.50 deg is stated"],
    "04_carmen_fr_clinic/fr-clinic_robotlaser.clf.bz2": ["interlaced: 4 start angles"],
    "05_ual_vehicle/ual_2014_05_23.mcap": ["no inclinometer"],
    "06_corrected_keyscans/orebro-corrected.log.gz": ["237 of 237 messages have no stamp, and the log has no times"],
    "07_bags/ccny_demo.bag": ["an index record states a wrong length", "no mount of its frame 'laser'"],
    "07_bags/scans_demo.bag": ["18.5 % of the ranges are NaN"],
    "15_breezyslam/exp2.dat": ["no mount of its frame 'laser'"],
}


@pytest.mark.parametrize("name", TRAPS)
def test_traps_of_the_real_recordings(shared_data: Path, name: str) -> None:
    outcome = examine(shared_data / name)
    assert outcome.verdict is LogVerdict.REMARKS
    for text in TRAPS[name]:
        assert text in _texts(outcome)


@pytest.mark.parametrize("name", ["11_rocks_otira/Otira_1cm_grains.ply", "10_piles/Bin_4.pcd"])
def test_clouds_are_no_logs(shared_data: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", str(shared_data / name)]) == 3
    assert "a point cloud is no log" in " ".join(capsys.readouterr().out.split())
