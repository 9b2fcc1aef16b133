"""CARMEN and BreezySLAM logs: facts of the real ones, and lines made by hand."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.logs import LogSource, open_log
from lhdmap.logs.doctor.health import examine
from lhdmap.logs.text.carmen_lines import flaser, robotlaser, stamp_of
from lhdmap.logs.text.carmen_survey import no_return_limit
from lhdmap.messages import GroundTruth, LaserScan, Mount, WheelPose


def _flaser(count: int, laser: str = "0 0 0", robot: str = "0 0 0") -> bytes:
    return f"FLASER {count} {'2.5 ' * count}{laser} {robot} 976052857.337530 host 0.25".encode()


@pytest.mark.parametrize(
    ("count", "first_deg", "step_deg", "last_deg"),
    [
        (180, -90.0, 1.0, 89.0),
        (181, -90.0, 1.0, 90.0),
        (360, -90.0, 0.5, 89.5),
        (361, -90.0, 0.5, 90.0),
        (400, -50.0, 0.25, 49.75),  # an LMS in its finest setting
        (401, -50.0, 0.25, 50.0),
    ],
)
def test_angles_of_flaser(count: int, first_deg: float, step_deg: float, last_deg: float) -> None:
    line = flaser(_flaser(count).split())
    assert math.degrees(line.angle_min_rad) == pytest.approx(first_deg)
    assert math.degrees(line.angle_increment_rad) == pytest.approx(step_deg)
    assert math.degrees(line.angle_min_rad + (count - 1) * line.angle_increment_rad) == pytest.approx(last_deg)


@pytest.mark.parametrize("keyword", [b"FLASER", b"RLASER"])
@pytest.mark.parametrize(
    ("count", "said"),
    [
        (181, ""),
        (180, "180 beams for 180 deg: the last beam is taken at +89 deg"),
        (400, "400 beams for 100 deg: the last beam is taken at +49.75 deg"),
        (401, ""),
        (
            541,
            "its field of view is a guess: 541 beams are no scanner that CARMEN knows, 180 deg in steps of 0.333 are assumed",
        ),
        (682, "its field of view is a guess"),
        (91, "its field of view is a guess"),
    ],
)
def test_what_is_said_of_the_field_of_view(tmp_path: Path, keyword: bytes, count: int, said: str) -> None:
    path = tmp_path / "log.clf"
    path.write_bytes(b"\n".join(_flaser(count).replace(b"FLASER", keyword) for _ in range(3)))
    with open_log(path) as reader:
        assert len(list(reader.records())) > 3
        told = [line for line in reader.remarks if "beams" in line]
    assert [said in line and line.startswith(keyword.decode()) for line in told] == [True] * bool(said)
    assert any(said in finding.text for finding in examine(path).findings)


def test_robotlaser_with_remissions() -> None:
    head = b"ROBOTLASER1 0 -1.566433 3.141593 0.017453 81.9 0.01 0 3 1.0 2.0 81.91 2 7 8"
    line = robotlaser((head + b" 5.2 0 0 5 0 0 0 0 0 0 0 12.5 host 1").split())
    assert line.ranges_m.tolist() == [1.0, 2.0, np.float32(81.91)]
    assert (line.angle_min_rad, line.angle_increment_rad, line.stamp_ns) == (-1.566433, 0.017453, 12_500_000_000)
    assert (line.laser_pose, line.robot_pose) == ((5.2, 0, 0), (5.0, 0, 0))


@pytest.mark.parametrize(
    ("word", "stamp_ns"),
    [
        (b"976052857.337530", 976052857337530000),
        (b"1134864629.895182001", 1134864629895182001),
        (b"0", 0),
        (b"1.01893e+09", 1018930000000000000),
        (b"-482.466", -482466000000),
    ],
)
def test_stamps_are_exact(word: bytes, stamp_ns: int) -> None:
    assert stamp_of(word) == stamp_ns


@pytest.mark.parametrize("word", [b"nan", b"inf", b"1e300", b"", b"noon"])
def test_words_that_are_no_time(word: bytes) -> None:
    with pytest.raises(InputError):
        stamp_of(word)


@pytest.mark.parametrize(
    "line", [b"FLASER", b"FLASER 3 1 2", b"FLASER -3 1", b"FLASER 99999999999 1", _flaser(3).replace(b"2.5", b"x")]
)
def test_broken_lines_are_refused(line: bytes) -> None:
    with pytest.raises(InputError):
        flaser(line.split())


def test_no_return_value_is_found_among_ranges() -> None:
    rng = np.random.default_rng(0)
    ranges = rng.uniform(1, 25, 5000).astype(np.float32)
    assert no_return_limit(ranges) is None
    codes = np.array([81.83, 81.91] * 40, np.float32)
    assert no_return_limit(np.concatenate([ranges, codes])) == pytest.approx(81.825, abs=1e-3)


def test_offset_of_the_laser_is_a_mount(tmp_path: Path) -> None:
    path = tmp_path / "drive.log"
    path.write_bytes(_flaser(5, laser="1.0 2.3 1.5707963", robot="1.0 2.0 1.5707963") + b"\n")
    with open_log(path) as reader:
        (mount,) = [record.message for record in reader.records({"/tf_static"})]
    assert isinstance(mount, Mount)
    assert (mount.parent_frame, mount.child_frame) == ("base_link", "front_laser")
    assert np.allclose(mount.T_parent_child[:3, 3], [0.3, 0, 0], atol=1e-6)


def test_text_that_is_no_log(tmp_path: Path) -> None:
    path = tmp_path / "notes.log"
    path.write_text("started\nstopped\n")
    with pytest.raises(InputError, match="no line of a CARMEN log"), open_log(path):
        pass


def test_intel(shared_data: Path) -> None:
    with LogSource(shared_data / "01_carmen_intel" / "intel.clf.bz2") as source:
        assert source.roles == {"front": "FLASER", "wheel_odometry": "FLASER/odom", "tf_static": "/tf_static"}
        counts: Counter[str] = Counter()
        stamps, limits = [], set()
        for role, message in source.messages():
            counts[role] += 1
            if isinstance(message, LaserScan):
                stamps.append(message.stamp_ns)
                limits.add(message.range_max_m)
        assert counts == {"front": 13631, "wheel_odometry": 13631, "tf_static": 1}
        assert int(np.count_nonzero(np.diff(stamps) < 0)) == 631  # the order of the file is kept
        assert limits == {81.825}  # 81.83 m stands for no return
        assert any("631 stamps run backwards" in line for line in source.warnings)
        assert source.damage == []


def test_interlaced_start_angles(shared_data: Path) -> None:
    path = shared_data / "04_carmen_fr_clinic" / "fr-clinic_robotlaser.clf.bz2"
    with open_log(path) as reader:
        starts: Counter[tuple[float, int]] = Counter()
        for record in reader.records({"ROBOTLASER1"}):
            assert isinstance(record.message, LaserScan)
            degrees = round(math.degrees(record.message.angle_min_rad), 2)
            starts[degrees, len(record.message.ranges_m)] += 1
    assert starts == {(-90.0, 181): 1748, (-89.75, 180): 1709, (-89.5, 180): 1725, (-89.25, 180): 1735}


def test_corrected_poses_are_truth_and_no_odometry(shared_data: Path) -> None:
    with LogSource(shared_data / "03_carmen_csail" / "mit-csail.graph.log") as source:
        assert "wheel_odometry" not in source.roles
        kinds = Counter(type(message) for _, message in source.messages())
    assert kinds == {LaserScan: 1051, GroundTruth: 1051, Mount: 1}


def test_odometry_of_scan_lines_where_there_is_no_other(shared_data: Path) -> None:
    with LogSource(shared_data / "03_carmen_csail" / "mit-csail.clf.bz2") as source:
        poses = [message for role, message in source.messages({"wheel_odometry"}) if isinstance(message, WheelPose)]
    assert len(poses) == 1988
    path_m = sum(math.hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in itertools.pairwise(poses))
    assert path_m == pytest.approx(374, abs=2)  # stated in the description of the recording


def test_breezyslam(shared_data: Path) -> None:
    with LogSource(shared_data / "15_breezyslam" / "exp2.dat") as source:
        messages = list(source.messages())
        duration_s = source.duration_s
    scans = [message for _, message in messages if isinstance(message, LaserScan)]
    assert len(scans) == 641
    assert duration_s == pytest.approx(63.2, abs=0.1)
    ranges = np.concatenate([scan.ranges_m for scan in scans])
    assert np.isinf(ranges).mean() == pytest.approx(0.55, abs=0.01)
    assert ranges[np.isfinite(ranges)].max() == pytest.approx(5.58, abs=0.01)
    assert math.degrees(scans[0].angle_increment_rad) * 681 == pytest.approx(240)
