"""One drive as different tools write it: each way gives the same stamps, places and rotations, or an error that says why not."""

from __future__ import annotations

import codecs
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.errors import InputError, LhdmapWarning
from lhdmap.geometry.se3 import quaternions_from_rpy
from lhdmap.tables.stamps import stamp_ns
from lhdmap.trajectory import Trajectory, read_tum

START_NS = 1_700_000_000_123_456_789
STEP_NS = 40_000_001
Row = tuple[int, list[float]]


def rows(start_ns: int = START_NS, count: int = 40) -> list[Row]:
    """Return stamps and x y z qx qy qz qw, no two of them alike, rounded as in a file."""
    k = np.arange(count, dtype=np.float64)
    rotations = quaternions_from_rpy(0.02 + 0.001 * k, -0.03 + 0.0 * k, 1.0 + 0.01 * k)
    places = np.column_stack([0.1 * k - 3.0, 5.0 - 0.05 * k, 0.01 * k])
    poses = np.round(np.column_stack([places, rotations]), 9).tolist()
    return [(start_ns + STEP_NS * n, pose) for n, pose in zip(range(count), poses, strict=True)]


def seconds(ns: int) -> str:
    return f"{ns // 10**9}.{ns % 10**9:09d}"


def table(line: Callable[[int, int, list[float]], str], header: str = "", start_ns: int = START_NS) -> str:
    body = [line(k, ns, pose) for k, (ns, pose) in enumerate(rows(start_ns))]
    return "\n".join([header, *body] if header else body) + "\n"


def joined(stamp: str, pose: list[float], separator: str = " ") -> str:
    return separator.join([stamp, *(f"{value:.9f}" for value in pose)])


def w_first(pose: list[float]) -> list[float]:
    return [*pose[:3], pose[6], *pose[3:6]]


def read(tmp_path: Path, content: str | bytes) -> Trajectory:
    path = tmp_path / "poses.txt"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_tum(path)


def refused(tmp_path: Path, content: str, match: str) -> None:
    with pytest.raises(InputError, match=match):
        read(tmp_path, content)


def agrees(found: Trajectory, start_ns: int = START_NS, within_ns: int = 0) -> None:
    expected = rows(start_ns)
    assert np.abs(found.stamps_ns - [ns for ns, _ in expected]).max() <= within_ns
    np.testing.assert_allclose(found.positions_m, [pose[:3] for _, pose in expected], atol=1e-9)
    np.testing.assert_allclose(found.quaternions_xyzw, [pose[3:] for _, pose in expected], atol=1e-9)


TUM = table(lambda _, ns, pose: joined(seconds(ns), pose))
ROS = (
    "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.child_frame_id,"
    + ",".join(f"field.pose.pose.position.{axis}" for axis in "xyz")
    + ","
    + ",".join(f"field.pose.pose.orientation.{axis}" for axis in "xyzw")
    + ",field.pose.covariance0,field.twist.twist.linear.x,field.twist.twist.angular.z"
)
EUROC = (
    "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], "
    "v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], b_a_RS_S_x [m s^-2]"
)
READ_RIGHT = {
    "tum": TUM,
    "tabs": TUM.replace(" ", "\t"),
    "commas": TUM.replace(" ", ","),
    "commas and blanks": TUM.replace(" ", ", "),
    "semicolons": TUM.replace(" ", ";"),
    "line ends of DOS": TUM.replace("\n", "\r\n"),
    "line ends of old Macs": TUM.replace("\n", "\r"),
    "comments and blank lines": "# made by hand\n\n" + TUM.replace("\n", "\n\n# more\n"),
    "a comment that names them": "# timestamp tx ty tz qx qy qz qw\n" + TUM,
    "a comment in words": "# format: t x y z qx qy qz qw\n" + TUM,
    "a header in words": "timestamp tx ty tz qx qy qz qw\n" + TUM,
    "names once more": "t x y z qx qy qz qw\n" + TUM.replace("\n", "\nt x y z qx qy qz qw\n", 7),
    "decimal commas, semicolons": TUM.replace(" ", ";").replace(".", ","),
    "decimal commas, blanks": TUM.replace(".", ","),
    "decimal commas, tabs": TUM.replace(" ", "\t").replace(".", ","),
    "decimal commas with names": "t;x;y;z;qx;qy;qz;qw\n" + TUM.replace(" ", ";").replace(".", ","),
    "nanoseconds": table(lambda _, ns, pose: joined(str(ns), pose)),
    "nanoseconds with an exponent": table(lambda _, ns, pose: joined(f"{str(ns)[0]}.{str(ns)[1:]}e+18", pose)),
    "index": table(lambda k, ns, pose: f"{k} {joined(seconds(ns), pose)}"),
    "index from 1, commas": table(lambda k, ns, pose: f"{k + 1},{joined(seconds(ns), pose, ',')}"),
    "index with names": table(lambda k, ns, pose: f"{k},{joined(seconds(ns), pose, ',')}", "num,t,x,y,z,qx,qy,qz,qw"),
    "pandas": table(lambda k, ns, pose: f"{k},{joined(seconds(ns), pose, ',')}", ",t,x,y,z,qx,qy,qz,qw"),
    "index without a name": table(lambda k, ns, pose: f"{k} {joined(seconds(ns), pose)}", "# t x y z qx qy qz qw"),
    "w first": table(lambda _, ns, pose: joined(seconds(ns), w_first(pose), ","), "#t,x,y,z,qw,qx,qy,qz"),
    "any order": table(lambda _, ns, pose: joined(f"{pose[6]:.9f}", [*pose[3:6][::-1], *pose[:3]]) + " " + seconds(ns))
    .join(["qw qz qy qx x y z time_s\n", ""]),
    "euroc": table(lambda _, ns, pose: joined(str(ns), w_first(pose), ",") + ",0,0,0,0,0", EUROC),
    "euroc, carriage returns": table(lambda _, ns, pose: joined(str(ns), w_first(pose), ",") + ",0,0,0,0,0\r", EUROC + "\r"),
    "topic as csv": table(lambda k, ns, pose: f"{ns + 7},{k},{ns},map,base_link,{joined('', pose, ',')[1:]},0.01,1.5,0.2", ROS),
    "seconds and nanoseconds": table(
        lambda _, ns, pose: f"{ns // 10**9},{joined(str(ns % 10**9), pose, ',')}",
        "header.stamp.sec,header.stamp.nanosec," + ",".join(f"pose.position.{a}" for a in "xyz") + ","
        + ",".join(f"pose.orientation.{a}" for a in "xyzw"),
    ),
    "millimetres": table(
        lambda _, ns, pose: joined(seconds(ns), [*(1000.0 * value for value in pose[:3]), *pose[3:]], ","),
        "t [s],x [mm],y [mm],z [mm],qx,qy,qz,qw",
    ),
    "quotes": table(lambda _, ns, pose: '"' + joined(seconds(ns), pose, '","') + '"', '"t","x","y","z","qx","qy","qz","qw"'),
    "scaled quaternions": table(lambda _, ns, pose: joined(seconds(ns), [*pose[:3], *(1.01 * q for q in pose[3:])])),
    "empty cells": table(lambda _, ns, pose: joined(seconds(ns), pose, ";") + ";;", "t;x;y;z;qx;qy;qz;qw;note;more"),
}  # fmt: skip


@pytest.mark.parametrize("name", READ_RIGHT)
def test_each_way_of_writing_gives_the_same_drive(name: str, tmp_path: Path) -> None:
    agrees(read(tmp_path, READ_RIGHT[name]))


@pytest.mark.parametrize("unit", ["us", "ms"])
def test_microseconds_and_milliseconds_since_1970_show_by_their_size(unit: str, tmp_path: Path) -> None:
    ns = {"us": 1_000, "ms": 1_000_000}[unit]
    agrees(read(tmp_path, table(lambda _, at, pose: joined(str(at // ns), pose))), within_ns=ns)
    named = table(lambda _, at, pose: joined(str(at // ns), pose), f"# time[{unit}] x y z qx qy qz qw")
    agrees(read(tmp_path, named), within_ns=ns)


def test_stamps_that_begin_at_zero_are_seconds_or_the_unit_that_makes_sense(tmp_path: Path) -> None:
    agrees(read(tmp_path, table(lambda _, ns, pose: joined(seconds(ns), pose), start_ns=0)), start_ns=0)
    with pytest.warns(LhdmapWarning, match="taken to be nanoseconds"):
        found = read(tmp_path, table(lambda _, ns, pose: joined(str(ns), pose), start_ns=0))
    agrees(found, start_ns=0)
    named = table(lambda _, ns, pose: joined(str(ns), pose), "# stamp_ns x y z qx qy qz qw", start_ns=0)
    agrees(read(tmp_path, named), start_ns=0)


def test_a_unit_that_cannot_be_told_has_to_be_named(tmp_path: Path) -> None:
    two_ms = table(lambda k, _, pose: joined(str(2_000_000 * k), pose))  # 2 ms in ns, 2 s in us
    refused(tmp_path, two_ms, r"in which unit its stamps are .*name it in the first line")
    wrong = table(lambda _, ns, pose: joined(seconds(ns), pose), "# t[ns] x y z qx qy qz qw")
    refused(tmp_path, wrong, "header says nanoseconds, but the stamps are seconds since 1970")


ENCODINGS = {
    "utf-8 with mark": codecs.BOM_UTF8 + TUM.encode(),
    "utf-16 with mark": TUM.encode("utf-16"),
    "utf-16-le": TUM.encode("utf-16-le"),
    "utf-16-be": TUM.encode("utf-16-be"),
    "utf-16-be with mark": codecs.BOM_UTF16_BE + TUM.encode("utf-16-be"),
    "utf-32": TUM.encode("utf-32"),
    "mark before a comment": codecs.BOM_UTF8 + b"# exported\n" + TUM.encode(),
    "latin-1 in a comment": "# höhe\n".encode("latin-1") + TUM.encode(),
}


@pytest.mark.parametrize("name", ENCODINGS)
def test_encodings(name: str, tmp_path: Path) -> None:
    agrees(read(tmp_path, ENCODINGS[name]))


def test_lines_with_nan_or_without_rotation_are_left_out_and_told(tmp_path: Path) -> None:
    lines = TUM.splitlines()
    broken = [*lines[:3], lines[3].split()[0] + " nan" * 7, "NaN" + lines[4][20:], *lines[5:]]
    with pytest.warns(LhdmapWarning, match=r"2 of 40 lines hold NaN \(line 4 is the first\)"):
        assert len(read(tmp_path, "\n".join(broken)).stamps_ns) == 38
    lines[6] = " ".join([*lines[6].split()[:4], "0 0 0 0"])
    with pytest.warns(LhdmapWarning, match=r"1 of 40 lines hold the quaternion 0 0 0 0.*line 7 is"):
        assert len(read(tmp_path, "\n".join(lines)).stamps_ns) == 39
    refused(
        tmp_path,
        table(lambda _, ns, pose: joined(seconds(ns), [*pose[:3], 0.0, 0.0, 0.0, 0.0])),
        "no pose in it: 40 of",
    )


def test_quaternions_far_from_unit_length_are_normalised_and_told(tmp_path: Path) -> None:
    with pytest.warns(LhdmapWarning, match=r"not of unit length but around 3"):
        found = read(tmp_path, table(lambda _, ns, pose: joined(seconds(ns), [*pose[:3], *(3 * q for q in pose[3:])])))
    agrees(found)


REFUSED = {
    "": "no pose in it",
    "# only a comment\n": "no pose in it",
    "these are no numbers\n": "no pose in it",
    "1 0 0 5 0 1 0 6 0 0 1 7\n" * 3: r"line 1: 12 numbers a line and no time: KITTI",
    "1 0 0 5 0 1 0 6 0 0 1 7 0 0 0 1\n" * 3: r"line 1: 16 numbers a line and no time",
    "0 1 2 3\n": r"line 1: 4 numbers a line; lines of eight numbers",
    "0 1 2 3 0 0 0 1 9\n" * 3: r"line 1: 9 numbers a line",
    TUM.replace(" ", ",").replace(".", ","): r"line 1: 16 numbers a line, all whole: decimal commas",
    "t,x,y,z,qx,qy,qz,qw\n" + TUM.replace(" ", ",").replace(".", ","): r"line 2: 16 whole numbers under 8 names",
    TUM.replace(" ", ";").replace(".", ",", 9): "decimal",
    "1.000,5;1;2;3;0;0;0;1\n": "decimal",
    TUM + "1700000009.0 1 2\n": r"line 41: 3 numbers; 8 were wanted",
    TUM + "1700000009.0 1 2 x 0 0 0 1\n": r"line 41: z is 'x'; a number was wanted",
    TUM + "soon 1 2 3 0 0 0 1\n": r"line 41: the time is 'soon'",
    TUM + "1700000009.0 1e400 2 3 0 0 0 1\n": r"line 41: x is 1e400; at most 1e\+09",
    TUM + "1700000009.0 1 2 -inf 0 0 0 1\n": r"line 41: z is -inf; at most",
    TUM + "1e30 1 2 3 0 0 0 1\n": r"line 41: the time 1e30 is beyond what nanoseconds",
    TUM + "9" * 400 + " 1 2 3 0 0 0 1\n": r"line 41: the time 9+ is beyond what nanoseconds",
    TUM + "1e999999999 1 2 3 0 0 0 1\n": r"line 41: the time 1e999999999 is beyond",
    TUM + "-inf 1 2 3 0 0 0 1\n": r"line 41: the time -inf is beyond",
    "t,x,y,z,roll,pitch,yaw\n0,1,2,3,0,0,0\n": r"line 1: no column for qx, qy, qz, qw",
    "t,x,y,z,qx,qy,qz,qw,x\n0,1,2,3,0,0,0,1,5\n": r"line 1: 'x' is x once more",
    "t,x [ft],y [ft],z [ft],qx,qy,qz,qw\n0,1,2,3,0,0,0,1\n": r"line 1: x, y, z in 'ft'; m, cm or mm was wanted",
    "# position x y z, then qw qx qy qz\n" + TUM: "line 1: .*names like t x y z qx qy qz qw were wanted",
}


@pytest.mark.parametrize("content", REFUSED)
def test_what_is_not_clear_is_refused_with_line_and_reason(content: str, tmp_path: Path) -> None:
    refused(tmp_path, content, REFUSED[content])


def test_a_binary_file_is_no_text(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="it is no text"):
        read(tmp_path, b"\x89MCAP0\r\n\x01\x00\x00\x00profile 1 2 3 4 5 6 7 8\n")


@given(st.integers(-(2**63) + 1, 2**63 - 1), st.sampled_from([1, 1_000, 1_000_000, 10**9]))
def test_stamps_are_read_to_the_nanosecond(ns: int, unit_ns: int) -> None:
    digits = len(str(unit_ns)) - 1
    text = f"{'-' if ns < 0 else ''}{abs(ns) // unit_ns}" + (f".{abs(ns) % unit_ns:0{digits}d}" if digits else "")
    assert stamp_ns(text, unit_ns) == ns


@given(st.text(alphabet='0123456789.,;- \t\neE+#naixyzqwt"', max_size=200))
def test_any_text_is_read_or_refused(text: str) -> None:
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", LhdmapWarning)
        try:
            found = read(Path(folder), text)
        except InputError:
            return
    assert np.isfinite(found.positions_m).all()
