"""The table of roles: what the contract says of each, and messages of any role for a stage that asks for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError, UsageError
from lhdmap.logs import LogSource
from lhdmap.logs.base import TopicInfo
from lhdmap.logs.cursor import Cursor
from lhdmap.logs.decoders import DECODERS
from lhdmap.logs.ros_messages import definition, serialized
from lhdmap.logs.topics import assign_topics
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import Command, LaserScan, Message, Pressure, Tachometer, Text
from lhdmap.roles import PRESSURE, ROLES, SCAN, TEXT, TYPE_OF, read_by, recorded

from tests.logs.small_logs import sample_messages

# docs: the contract's table of topics
CONTRACT = {
    "/lidar/front/scan": "sensor_msgs/msg/LaserScan",
    "/lidar/rear/scan": "sensor_msgs/msg/LaserScan",
    "/lidar/points": "sensor_msgs/msg/PointCloud2",
    "/inclinometer": "sensor_msgs/msg/Imu",
    "/machine/joints": "sensor_msgs/msg/JointState",
    "/machine/tachometer": "geometry_msgs/msg/TwistStamped",
    "/machine/pressure/transmission": "sensor_msgs/msg/FluidPressure",
    "/machine/pressure/lift": "sensor_msgs/msg/FluidPressure",
    "/machine/pressure/tilt": "sensor_msgs/msg/FluidPressure",
    "/machine/command": "lhd_msgs/msg/MachineCommand",
    "/operation/mode": "std_msgs/msg/String",
    "/operation/node": "std_msgs/msg/String",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/ground_truth/odometry": "nav_msgs/msg/Odometry",
}
START, PERIOD = 1_700_000_000_000_000_000, 40_000_000
ASKED = ["command", "mode", "node", "lift_pressure", "tilt_pressure", "transmission_pressure"]


def test_the_table_is_that_of_the_contract() -> None:
    found = {role.topic: role.type_name for role in ROLES.values()}
    assert {topic: kind for topic, kind in found.items() if topic != "/odom"} == CONTRACT


def test_every_message_has_a_type_a_decoder_and_a_definition() -> None:
    for _, message, _ in sample_messages(3):
        kind, data = serialized(message)
        assert kind == TYPE_OF[type(message)]
        assert definition(kind)
        assert len(DECODERS[kind](Cursor(data, "cdr"))) == 1
    assert set(TYPE_OF) == {role.message for role in ROLES.values()}


def test_no_command_reads_the_truth_or_what_it_has_no_use_for() -> None:
    for command in ("build-map", "pile", "build-map --poses"):
        assert not {"ground_truth", "mode", "command"} & set(read_by(command))
        assert {"front", "rear", "points", "joints", "tf_static"} <= set(read_by(command))


def test_a_record_goes_to_its_role_alone() -> None:
    assert recorded("mode", 7, Text(5, "manual")) == ("/operation/mode", 7, Text(5, "manual"))
    with pytest.raises(TypeError, match="a Pressure was wanted, not a Text"):
        recorded("lift_pressure", 7, Text(5, "manual"))


def written(path: Path, names: dict[str, str], offset_ns: int = 0) -> tuple[Path, dict[str, list[Message]]]:
    """Write a drive of 40 scans with messages of all roles that are asked for; return them as they were written."""
    sent: dict[str, list[Message]] = {role: [] for role in ASKED}
    with LogWriter(path) as writer:
        for k in range(40):
            stamp = START + k * PERIOD
            ranges = np.full(180, 3.0 + 0.01 * k, np.float32)
            writer.write("/scan", LaserScan(stamp, "laser", -1.5, 0.0167, 0.0, 0.1, 80.0, ranges), stamp + offset_ns)
            pressures = {role: Pressure(stamp + 2, 1e6 * (n + 1) + k) for n, role in enumerate(ASKED[3:])}
            command = Command(stamp + 1, -0.5, 0.01 * k, 0.25, 1.0, k % 2 == 0, k % 3 == 0)
            texts = {"mode": Text(stamp + 3, "manual" if k < 20 else "autonomous"), "node": Text(stamp + 4, f"T{k}")}
            for role, message in ({"command": command} | pressures | texts).items():
                sent[role].append(message)
                writer.write(names.get(role, ROLES[role].topic), message, message.stamp_ns + offset_ns)
    return path, sent


@pytest.mark.parametrize(
    "names",
    [
        {},
        {"command": "/hmi/cmd", "lift_pressure": "/hyd/lift_cylinder", "tilt_pressure": "/hyd/Bucket"},
        {"transmission_pressure": "/converter/p"},
    ],
    ids=["contract", "other names", "one other"],
)
@pytest.mark.parametrize("offset_ns", [0, 3600 * 10**9], ids=["one clock", "another log clock"])
def test_a_stage_gets_the_roles_that_it_asks_for(names: dict[str, str], offset_ns: int, tmp_path: Path) -> None:
    path, sent = written(tmp_path / "log.mcap", names, offset_ns)
    with LogSource(path) as source:
        got: dict[str, list[Message]] = {role: [] for role in ASKED}
        for role, message in source.messages(ASKED):
            got[role].append(message)
        within = [message.stamp_ns for _, message in source.messages(["front", "mode"])]
    for role in ASKED:
        if role in ("mode", "node"):  # a String has no stamp: the log time, on the clock of the stamps
            assert [one.text for one in got[role]] == [one.text for one in sent[role]]  # type: ignore[union-attr]
            assert max(abs(a.stamp_ns - b.stamp_ns) for a, b in zip(got[role], sent[role], strict=True)) < PERIOD
        else:
            assert got[role] == sent[role]
    assert np.diff(within).min() >= 0


def test_one_role_alone_and_none(tmp_path: Path) -> None:
    path, sent = written(tmp_path / "log.mcap", {})
    with LogSource(path) as source:
        assert [message for _, message in source.messages(["lift_pressure"])] == sent["lift_pressure"]
        assert list(source.messages(["tachometer"])) == list(source.messages([])) == []
        with pytest.raises(UsageError, match="unknown role 'comand'; did you mean 'command'"):
            list(source.messages(["command", "comand"]))


def test_names_of_pressures_that_leave_a_doubt_give_none() -> None:
    log = {name: TopicInfo(name, PRESSURE, 9) for name in ("/lift/left", "/lift/right", "/tilt/rod", "/ambient")}
    log["/scan"] = TopicInfo("/scan", SCAN, 9)
    assert assign_topics(log) == {"front": "/scan", "tilt_pressure": "/tilt/rod"}
    assert assign_topics(log, {"lift_pressure": "/lift/right"})["lift_pressure"] == "/lift/right"


def test_a_text_topic_takes_no_role_by_its_type() -> None:
    log = {"/scan": TopicInfo("/scan", SCAN, 9), "/camera/mode": TopicInfo("/camera/mode", TEXT, 9)}
    assert assign_topics(log) == {"front": "/scan"}
    assert assign_topics(log, {"mode": "/camera/mode"})["mode"] == "/camera/mode"


def test_an_option_cannot_make_one_sensor_another(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with LogWriter(path) as writer:
        writer.write("/scan", LaserScan(START, "laser", -1.5, 0.0167, 0.0, 0.1, 80.0, np.full(9, 3.0, np.float32)))
        writer.write("/speed", Tachometer(START, 1.0))
    with pytest.raises(InputError, match=r"lift_pressure=/speed: sensor_msgs/msg/FluidPressure was wanted"):
        LogSource(path, {"lift_pressure": "/speed"}).__enter__()
