"""Decoding against messages that rosbags serialised: ROS 2 CDR of either byte order, and the ROS 1 encoding."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.errors import InputError
from lhdmap.geometry import se3
from lhdmap.logs.cursor import Cursor
from lhdmap.logs.decoders import DECODERS, ground_truth
from lhdmap.logs.ros_messages import MACHINE_COMMAND, serialized
from lhdmap.messages import (
    Command,
    GroundTruth,
    Inclination,
    Joints,
    LaserScan,
    Message,
    Mount,
    PointCloud,
    Pressure,
    Tachometer,
    Text,
    WheelPose,
)
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ROS2, ROS1 = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
for store in (ROS1, ROS2):
    store.register(get_types_from_msg(MACHINE_COMMAND, "lhd_msgs/msg/MachineCommand"))
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", "tf2_msgs/msg/TFMessage"))
STAMP = 1_712_345_678_123_456_789  # 19 digits

MESSAGES: list[Message] = [
    LaserScan(STAMP, "front", -1.5, 0.25, 1e-4, 0.125, 80.0, np.array([1, np.inf, np.nan, 4.5], np.float32)),
    LaserScan(STAMP, "", 2.0, -0.5, 0.0, 0.0, 30.0, np.empty(0, np.float32)),
    PointCloud(STAMP, "top", np.ones((4, 3), np.float32), np.linspace(0.0, 0.03, 4, dtype=np.float32)),
    Inclination(STAMP, "imu_link", 0.1, -0.2, np.array([1.0, 2, 3]), None),
    Joints(STAMP, {"articulation": 0.3, "boom_lift": -0.1}, {"articulation": 0.01, "boom_lift": 0.0}),
    Joints(STAMP, {"articulation": 0.3}, {}),
    Tachometer(STAMP, -2.5),
    WheelPose(STAMP, 1.0, 2.0, 3.0),
    Pressure(STAMP, 1.5e7),
    Command(STAMP, 0.5, -0.1, 0.25, -1.0, True, False),
    Text(0, "teleoperated"),
    Mount(STAMP, "base_link", "front", se3.from_rpy(0.1, -0.2, 3.0, (1.0, -2.0, 0.5))),
]


def _same(left: Any, right: Any) -> bool:
    if isinstance(left, np.ndarray):
        return np.allclose(left, right, atol=1e-6, equal_nan=True)
    if isinstance(left, float):
        return math.isclose(left, right, rel_tol=1e-6, abs_tol=1e-9)
    return bool(left == right)


def _assert_same(left: Message, right: Message) -> None:
    assert type(left) is type(right)
    for name, one, other in zip(left._fields, left, right, strict=True):
        assert _same(one, other), (name, one, other)


def _as_ros1(value: Any) -> Any:
    """Return a ROS 2 message as the ROS 1 message of the same name (headers have a sequence number there)."""
    if isinstance(value, list):
        return [_as_ros1(item) for item in value]
    if not dataclasses.is_dataclass(value):
        return value
    kind: str = getattr(value, "__msgtype__")  # noqa: B009  # dataclasses have no such attribute for a type checker
    fields = {f.name: _as_ros1(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if kind == "std_msgs/msg/Header":
        fields["seq"] = 7
    return ROS1.types[kind](**fields)


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: type(message).__name__)
@pytest.mark.parametrize("form", ["little", "big", "ros1"])
def test_each_type_in_each_encoding(message: Message, form: str) -> None:
    kind, cdr = serialized(message)
    foreign = ROS2.deserialize_cdr(cdr, kind)
    if form == "ros1":
        data = bytes(ROS1.serialize_ros1(_as_ros1(foreign), kind))
    else:
        data = bytes(ROS2.serialize_cdr(foreign, kind, little_endian=form == "little"))
    (got,) = DECODERS[kind](Cursor(data, "ros1" if form == "ros1" else "cdr"))
    _assert_same(got, message)


def test_ground_truth_keeps_its_three_dimensions() -> None:
    truth = GroundTruth(STAMP, np.array([1.0, 2, 3]), np.array([0.0, 0.6, 0, 0.8]))
    (got,) = ground_truth(Cursor(serialized(truth)[1], "cdr"))
    _assert_same(got, truth)


@settings(max_examples=60, deadline=None)
@given(
    stamp=st.integers(0, 2**31 * 10**9 - 1),
    frame=st.text(st.characters(codec="utf-8", exclude_characters="\0/"), max_size=12),
    ranges=st.lists(st.floats(width=32), max_size=40),
)
def test_any_scan_survives(stamp: int, frame: str, ranges: list[float]) -> None:
    scan = LaserScan(stamp, frame, -1.0, 0.5, 0.0, 0.0, 10.0, np.array(ranges, np.float32))
    (got,) = DECODERS["sensor_msgs/msg/LaserScan"](Cursor(serialized(scan)[1], "cdr"))
    _assert_same(got, scan)


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: type(message).__name__)
def test_every_shortened_payload_is_refused(message: Message) -> None:
    kind, data = serialized(message)
    for size in range(len(data)):
        try:
            DECODERS[kind](Cursor(data[:size], "cdr"))
        except InputError:
            continue
        # only what a type has behind the fields that are used may be missing
        assert kind in ("nav_msgs/msg/Odometry", "sensor_msgs/msg/JointState", "sensor_msgs/msg/FluidPressure") or (
            kind in ("geometry_msgs/msg/TwistStamped", "sensor_msgs/msg/PointCloud2")
        ), (kind, size)


def test_a_false_array_length_allocates_nothing() -> None:
    _, data = serialized(MESSAGES[0])
    at = data.rfind(np.float32(1).tobytes()) - 4
    broken = data[:at] + b"\xff\xff\xff\x7f" + data[at + 4 :]
    with pytest.raises(InputError, match="bytes wanted"):
        DECODERS["sensor_msgs/msg/LaserScan"](Cursor(broken, "cdr"))


def test_imu_without_orientation_is_no_inclinometer() -> None:
    kind, data = serialized(Inclination(STAMP, "imu", 0.1, 0.2, None, None))
    imu: Any = ROS2.deserialize_cdr(data, kind)
    imu = dataclasses.replace(imu, orientation_covariance=np.array([-1.0] + 8 * [0.0]))
    with pytest.raises(InputError, match="no orientation"):
        DECODERS[kind](Cursor(bytes(ROS2.serialize_cdr(imu, kind)), "cdr"))


def _cloud(fields: list[tuple[str, str]], table: np.ndarray[Any, Any], *, stamp: int = STAMP) -> PointCloud:
    """Return the cloud decoded from a PointCloud2 of two rows, with padding behind each row."""
    kinds = {"u4": 6, "f4": 7, "f8": 8, "u2": 4}
    types = ROS2.types
    field = types["sensor_msgs/msg/PointField"]
    offsets = [table.dtype.fields[name][1] for name, _ in fields]
    rows = table.reshape(2, -1)
    padded = b"".join(row.tobytes() + b"pad!" for row in rows)
    header = types["std_msgs/msg/Header"](
        stamp=types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="top"
    )
    message = types["sensor_msgs/msg/PointCloud2"](
        header=header,
        height=2,
        width=rows.shape[1],
        fields=[
            field(name=name, offset=offset, datatype=kinds[kind], count=1)
            for (name, kind), offset in zip(fields, offsets, strict=True)
        ],
        is_bigendian=False,
        point_step=table.dtype.itemsize,
        row_step=len(padded) // 2,
        data=np.frombuffer(padded, np.uint8),
        is_dense=False,
    )
    kind = "sensor_msgs/msg/PointCloud2"
    (got,) = DECODERS[kind](Cursor(bytes(ROS2.serialize_cdr(message, kind)), "cdr"))
    assert isinstance(got, PointCloud)
    return got


@pytest.mark.parametrize(
    ("name", "kind", "values"),
    [
        ("t", "u4", [0, 10_000_000, 20_000_000, 30_000_000]),  # nanoseconds after the stamp
        ("time", "f4", [0, 0.01, 0.02, 0.03]),  # seconds after the stamp
        ("timestamp", "f8", [STAMP / 1e9 + 0.01 * i for i in range(4)]),  # absolute seconds
    ],
)
def test_point_times_of_the_usual_drivers(name: str, kind: str, values: list[float]) -> None:
    fields = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("ring", "u2"), (name, kind)]
    table = np.zeros(4, dtype=np.dtype(fields, align=True))
    table["x"], table[name] = [1, 2, np.nan, 4], values
    cloud = _cloud(fields, table)
    assert cloud.points_m[:, 0].tolist() == [1, 2, 4]  # the point that is not finite is dropped, with its time
    assert np.allclose(cloud.time_offsets_s, [0.0, 0.01, 0.03], atol=1e-6)
