"""What `doctor` knows, `build-map` acts on: sensors that say nothing, units, angles, scanners that share a topic."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from lhdmap.cli.main import main
from lhdmap.geometry import se3
from lhdmap.logs.doctor.health import LogVerdict, examine
from lhdmap.logs.source import LogSource
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import Inclination, Joints, LaserScan, Message, Mount, Tachometer, WheelPose
from lhdmap.pipeline.build import BuildRequest, build_map

from tests.logs import drives

Change = Callable[[int, LaserScan], LaserScan]


def _millimetres(scan: LaserScan, *, limits: bool) -> LaserScan:
    factor = 1000.0 if limits else 1.0
    return scan._replace(
        ranges_m=scan.ranges_m * np.float32(1000.0),
        range_min_m=scan.range_min_m * factor,
        range_max_m=scan.range_max_m * factor,
    )


def _degrees(scan: LaserScan) -> LaserScan:
    return scan._replace(
        angle_min_rad=math.degrees(scan.angle_min_rad), angle_increment_rad=math.degrees(scan.angle_increment_rad)
    )


MEANT: dict[str, tuple[Change, str]] = {
    "millimetres": (lambda _, scan: _millimetres(scan, limits=True), "millimetres, not metres"),
    "millimetres beside limits in metres": (lambda _, scan: _millimetres(scan, limits=False), "millimetres"),
    "degrees": (lambda _, scan: _degrees(scan), "degrees, not radians"),
    "start in degrees": (
        lambda _, scan: scan._replace(angle_min_rad=math.degrees(scan.angle_min_rad)),
        "the start angle is -",
    ),
    "least range that is no number": (
        lambda _, scan: scan._replace(range_min_m=math.nan),
        "limits that are no numbers",
    ),
    "limits of zero": (lambda _, scan: scan._replace(range_min_m=0.0, range_max_m=0.0), "both range limits are 0"),
}


@pytest.mark.parametrize("name", sorted(MEANT))
def test_scans_that_are_stated_wrongly_are_put_right_and_told(tmp_path: Path, name: str) -> None:
    change, told = MEANT[name]
    log = drives.write(tmp_path / "log.mcap", change)
    outcome = examine(log)
    assert outcome.verdict is LogVerdict.REMARKS
    assert any(told in finding.text for finding in outcome.findings), outcome.findings
    found = build_map(BuildRequest([log], tmp_path / "map"))
    assert drives.along_error_m(found.trajectory.positions_m) < 0.05


FATAL: dict[str, tuple[Change, str]] = {
    "all beams coincide": (lambda _, scan: scan._replace(angle_increment_rad=0.0), "increment is zero"),
    "beyond a full turn": (lambda _, scan: scan._replace(angle_increment_rad=30.0), "the field of view is"),
    "impossible limits": (lambda _, scan: scan._replace(range_min_m=5.0, range_max_m=1.0), "limits are impossible"),
    "no hit": (lambda _, scan: scan._replace(ranges_m=np.full_like(scan.ranges_m, np.inf)), "dead: only 0.0 %"),
}


@pytest.mark.parametrize("name", sorted(FATAL))
def test_what_is_fatal_is_so_for_both(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    change, told = FATAL[name]
    log = drives.write(tmp_path / "log.mcap", change, scans=40)
    assert main(["doctor", str(log), "--quiet"]) == 3
    assert told in " ".join(capsys.readouterr().out.split())
    assert main(["build-map", str(log), "-o", str(tmp_path / "map"), "--quiet"]) == 3
    assert told in capsys.readouterr().err
    assert not (tmp_path / "map").exists()


def _stuck_odometry(k: int) -> list[tuple[str, Message]]:
    return [("/odom", WheelPose(drives.START_NS + k * drives.PERIOD_NS, 0.0, 0.0, 0.0))]


def _stuck_tachometer(speed_mps: float) -> Callable[[int], list[tuple[str, Message]]]:
    return lambda k: [("/machine/tachometer", Tachometer(drives.START_NS + k * drives.PERIOD_NS, speed_mps))]


@pytest.mark.parametrize(
    ("others", "role"),
    [
        (_stuck_odometry, "wheel_odometry"),
        (_stuck_tachometer(0.0), "tachometer"),
        (_stuck_tachometer(7.5), "tachometer"),
    ],
    ids=["odometry", "tachometer at zero", "tachometer at 27 km/h"],
)
def test_wheels_that_say_the_same_for_ever_are_left_out(
    tmp_path: Path, others: Callable[[int], list[tuple[str, Message]]], role: str
) -> None:
    log = drives.write(tmp_path / "log.mcap", others=others)
    (finding,) = (finding for finding in examine(log).findings if "not used as" in finding.text)
    found = build_map(BuildRequest([log], tmp_path / "map"))
    assert drives.along_error_m(found.trajectory.positions_m) < 0.05
    assert sum(finding.text in text for text in found.warnings) == 1
    with LogSource(log) as source:
        assert role not in source.roles


def test_a_log_that_is_opened_again_is_not_looked_through_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = drives.write(tmp_path / "log.mcap", change=MEANT["millimetres"][0], others=_stuck_tachometer(0.0))
    with LogSource(log) as first:
        meant = list(first.messages())
    monkeypatch.setattr("lhdmap.logs.source.take_survey", lambda *_: pytest.fail("looked through again"))
    with LogSource(log, survey=first.survey) as again:
        assert again.roles == first.roles
        for (role, message), (other_role, other) in zip(again.messages(), meant, strict=True):
            assert role == other_role
            if isinstance(message, LaserScan) and isinstance(other, LaserScan):
                np.testing.assert_array_equal(message.ranges_m, other.ranges_m)


def test_a_sensor_that_is_frozen_askew_is_left_out_and_one_at_zero_is_not(tmp_path: Path) -> None:
    def tilted(roll_rad: float) -> Callable[[int], list[tuple[str, Message]]]:
        def at(k: int) -> list[tuple[str, Message]]:
            stamp = drives.START_NS + k * drives.PERIOD_NS
            return [
                ("/inclinometer", Inclination(stamp, "laser", roll_rad, 0.0, None, None)),
                ("/machine/joints", Joints(stamp, {"articulation": roll_rad}, {})),
            ]

        return at

    for roll_rad, used in ((0.0, True), (0.3, False)):
        log = drives.write(tmp_path / f"{roll_rad}.mcap", others=tilted(roll_rad), scans=40)
        with LogSource(log) as source:
            assert ("inclinometer" in source.roles) == used
            assert ("joints" in source.roles) == used


def _half(scan: LaserScan, side: int, frame: str) -> LaserScan:
    middle = len(scan.ranges_m) // 2
    start = 0 if side < 0 else middle
    return scan._replace(
        frame_id=frame,
        angle_min_rad=scan.angle_min_rad + start * scan.angle_increment_rad,
        ranges_m=scan.ranges_m[start : start + middle + (side > 0)],
    )


@pytest.mark.parametrize("frames", [("right", "left"), ("laser", "laser")], ids=["own frames", "one frame"])
def test_two_scanners_on_one_topic_are_not_mixed(tmp_path: Path, frames: tuple[str, str]) -> None:
    """Taken for one scanner they gave a jump of 3.9 m."""
    log = tmp_path / "log.mcap"
    mounts = [Mount(drives.START_NS, "base_link", frame, np.eye(4)) for frame in dict.fromkeys(frames)]
    with LogWriter(log) as writer:
        writer.write("/tf_static", mounts)
        for scan in drives.drive()[1]:
            writer.write("/scan", _half(scan, -1, frames[0]))
            writer.write("/scan", _half(scan._replace(stamp_ns=scan.stamp_ns + 10_000_000), 1, frames[1]))
    assert any("2 scanners share the topic" in finding.text for finding in examine(log).findings)
    found = build_map(BuildRequest([log], tmp_path / "map"))
    assert found.summary["scans"] == 150
    assert drives.along_error_m(found.trajectory.positions_m) < 0.1


def test_one_scanner_that_interlaces_or_was_set_anew_stays_one(tmp_path: Path) -> None:
    def quarter(k: int, scan: LaserScan) -> LaserScan:
        return scan._replace(angle_min_rad=scan.angle_min_rad + 0.25 * (k % 4) * scan.angle_increment_rad)

    def narrower(k: int, scan: LaserScan) -> LaserScan:
        return scan if k < 75 else scan._replace(ranges_m=scan.ranges_m[: len(scan.ranges_m) // 2])

    for name, change in (("interlaced", quarter), ("set anew", narrower)):
        log = drives.write(tmp_path / f"{name}.mcap", change)
        with LogSource(log) as source:
            assert sum(1 for _ in source.messages(["front"])) == 150


def test_two_topics_that_could_be_the_scanner_are_refused_by_both(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    with LogWriter(log) as writer:
        for scan in drives.drive()[1][:30]:
            writer.write("/a", scan)
            writer.write("/b", scan)
    assert main(["doctor", str(log), "--quiet"]) == 3
    assert main(["build-map", str(log), "-o", str(tmp_path / "map"), "--quiet"]) == 3
    assert main(["doctor", str(log), "--topic", "front=/a", "--quiet"]) == 0


def test_a_mount_that_comes_late_holds_from_the_start(tmp_path: Path) -> None:
    """The scanner hangs upside down; the log says so in its last second."""
    T = se3.from_rpy(math.pi, 0.0, 0.0, (0.0, 0.0, 1.5))
    log = drives.write(
        tmp_path / "log.mcap",
        lambda _, scan: scan._replace(ranges_m=scan.ranges_m[::-1].copy()),
        others=lambda k: [("/tf_static", Mount(drives.START_NS, "base_link", "laser", T))] if k == 140 else [],
    )
    assert not any("no mount" in finding.text for finding in examine(log).findings)
    found = build_map(BuildRequest([log], tmp_path / "map"))
    assert drives.along_error_m(found.trajectory.positions_m) < 0.05
    assert not any("mount" in text for text in found.warnings)
