"""Our messages as ROS 2 messages: type, definition and CDR bytes, through rosbags' type store."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lhdmap.geometry import se3
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
from lhdmap.roles import COMMAND, TYPE_OF

MACHINE_COMMAND = """std_msgs/Header header
float64 propel
float64 steering_rate
float64 tilt
float64 lift
bool full_rpm
bool brake
"""
_STORE = get_typestore(Stores.ROS2_HUMBLE)
_STORE.register(get_types_from_msg(MACHINE_COMMAND, COMMAND))
_T = _STORE.types
_SECOND_NS = 1_000_000_000
_FLOAT32 = 7  # sensor_msgs/PointField
_UNKNOWN = np.array([-1.0] + [0.0] * 8)  # sensor_msgs/Imu: a first covariance of -1 means "not measured"
_NO_COVARIANCE_3 = np.zeros(9)
_NO_COVARIANCE_6 = np.zeros(36)


def definition(type_name: str) -> str:
    """Return the message definition of a type, with all that it depends on (`ros2msg`)."""
    text, _ = _STORE.generate_msgdef(type_name, ros_version=2)
    return str(text)


def field_definitions(type_name: str) -> Sequence[tuple[str, Any]]:
    """Return the fields of a type, each a name and what rosbags' type store says of it."""
    return tuple(_STORE.fielddefs[type_name][1])


def serialized(message: Message | Sequence[Mount]) -> tuple[str, bytes]:
    """Return the ROS 2 type name and the CDR bytes of a message; several mounts make one TFMessage.

    Raises:
        KeyError: it is no message of `lhdmap.messages`.
    """
    kind = Mount if isinstance(message, list) else type(message)
    type_name = TYPE_OF[kind]
    return type_name, bytes(_STORE.serialize_cdr(_BUILDERS[kind](message), type_name))


def _header(stamp_ns: int, frame: str) -> Any:
    seconds, nanoseconds = divmod(stamp_ns, _SECOND_NS)
    stamp = _T["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
    return _T["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def _vector(values: Sequence[float] | np.ndarray[Any, Any]) -> Any:
    return _T["geometry_msgs/msg/Vector3"](x=float(values[0]), y=float(values[1]), z=float(values[2]))


def _quaternion(xyzw: Sequence[float] | np.ndarray[Any, Any]) -> Any:
    x, y, z, w = (float(value) for value in xyzw)
    return _T["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w)


def _laser_scan(scan: LaserScan) -> Any:
    ranges = np.asarray(scan.ranges_m, dtype=np.float32)
    return _T["sensor_msgs/msg/LaserScan"](
        header=_header(scan.stamp_ns, scan.frame_id),
        angle_min=scan.angle_min_rad,
        angle_max=scan.angle_min_rad + max(len(ranges) - 1, 0) * scan.angle_increment_rad,
        angle_increment=scan.angle_increment_rad,
        time_increment=scan.time_increment_s,
        scan_time=len(ranges) * scan.time_increment_s,
        range_min=scan.range_min_m,
        range_max=scan.range_max_m,
        ranges=ranges,
        intensities=np.empty(0, np.float32),
    )


def _point_cloud(cloud: PointCloud) -> Any:
    field = _T["sensor_msgs/msg/PointField"]
    columns = [np.asarray(cloud.points_m, np.float32)]
    if len(cloud.time_offsets_s):
        columns.append(np.asarray(cloud.time_offsets_s, np.float32)[:, None])
    table = np.ascontiguousarray(np.hstack(columns))
    names = ("x", "y", "z", "time")[: table.shape[1]]
    step = 4 * len(names)
    return _T["sensor_msgs/msg/PointCloud2"](
        header=_header(cloud.stamp_ns, cloud.frame_id),
        height=1,
        width=len(table),
        fields=[field(name=name, offset=4 * i, datatype=_FLOAT32, count=1) for i, name in enumerate(names)],
        is_bigendian=False,
        point_step=step,
        row_step=step * len(table),
        data=table.view(np.uint8).reshape(-1),
        is_dense=True,
    )


def _imu(inclination: Inclination) -> Any:
    rate, acceleration = inclination.angular_velocity_rps, inclination.acceleration_mps2
    return _T["sensor_msgs/msg/Imu"](
        header=_header(inclination.stamp_ns, inclination.frame_id),
        orientation=_quaternion(se3.quaternion_from_rpy(inclination.roll_rad, inclination.pitch_rad, 0.0)),
        orientation_covariance=_NO_COVARIANCE_3,
        angular_velocity=_vector(np.zeros(3) if rate is None else rate),
        angular_velocity_covariance=_UNKNOWN if rate is None else _NO_COVARIANCE_3,
        linear_acceleration=_vector(np.zeros(3) if acceleration is None else acceleration),
        linear_acceleration_covariance=_UNKNOWN if acceleration is None else _NO_COVARIANCE_3,
    )


def _joints(joints: Joints) -> Any:
    names = list(joints.positions_rad)
    complete = bool(names) and joints.velocities_rps.keys() >= joints.positions_rad.keys()
    return _T["sensor_msgs/msg/JointState"](
        header=_header(joints.stamp_ns, ""),
        name=names,
        position=np.array(list(joints.positions_rad.values()), dtype=float),
        velocity=np.array([joints.velocities_rps[name] for name in names] if complete else [], dtype=float),
        effort=np.empty(0),
    )


def _tachometer(tachometer: Tachometer) -> Any:
    linear, angular = _vector((tachometer.speed_mps, 0.0, 0.0)), _vector((0.0, 0.0, 0.0))
    twist = _T["geometry_msgs/msg/Twist"](linear=linear, angular=angular)
    return _T["geometry_msgs/msg/TwistStamped"](header=_header(tachometer.stamp_ns, "base_link"), twist=twist)


def _odometry(stamp_ns: int, parent: str, position: Any, quaternion: Any) -> Any:
    x, y, z = (float(value) for value in position)
    pose = _T["geometry_msgs/msg/Pose"](
        position=_T["geometry_msgs/msg/Point"](x=x, y=y, z=z), orientation=_quaternion(quaternion)
    )
    still = _T["geometry_msgs/msg/Twist"](linear=_vector((0.0, 0.0, 0.0)), angular=_vector((0.0, 0.0, 0.0)))
    return _T["nav_msgs/msg/Odometry"](
        header=_header(stamp_ns, parent),
        child_frame_id="base_link",
        pose=_T["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=_NO_COVARIANCE_6),
        twist=_T["geometry_msgs/msg/TwistWithCovariance"](twist=still, covariance=_NO_COVARIANCE_6),
    )


def _wheel_pose(pose: WheelPose) -> Any:
    half = 0.5 * pose.heading_rad
    return _odometry(pose.stamp_ns, "odom", (pose.x_m, pose.y_m, 0.0), (0.0, 0.0, np.sin(half), np.cos(half)))


def _ground_truth(truth: GroundTruth) -> Any:
    return _odometry(truth.stamp_ns, "map", truth.position_m, truth.quaternion_xyzw)


def _pressure(pressure: Pressure) -> Any:
    header = _header(pressure.stamp_ns, "")
    return _T["sensor_msgs/msg/FluidPressure"](header=header, fluid_pressure=pressure.pressure_pa, variance=0.0)


def _command(command: Command) -> Any:
    return _T[COMMAND](
        header=_header(command.stamp_ns, "base_link"),
        propel=command.propel,
        steering_rate=command.steering_rate_rps,
        tilt=command.tilt,
        lift=command.lift,
        full_rpm=command.full_rpm,
        brake=command.brake,
    )


def _text(text: Text) -> Any:
    return _T["std_msgs/msg/String"](data=text.text)


def _transforms(mounts: Mount | list[Mount]) -> Any:
    listed = mounts if isinstance(mounts, list) else [mounts]
    return _T["tf2_msgs/msg/TFMessage"](transforms=[_transform(mount) for mount in listed])


def _transform(mount: Mount) -> Any:
    pose = _T["geometry_msgs/msg/Transform"](
        translation=_vector(mount.T_parent_child[:3, 3]),
        rotation=_quaternion(se3.quaternion_from_rpy(*se3.to_rpy(mount.T_parent_child))),
    )
    header = _header(mount.stamp_ns, mount.parent_frame)
    return _T["geometry_msgs/msg/TransformStamped"](header=header, child_frame_id=mount.child_frame, transform=pose)


_BUILDERS: dict[type[Any], Callable[[Any], Any]] = {
    LaserScan: _laser_scan,
    PointCloud: _point_cloud,
    Inclination: _imu,
    Joints: _joints,
    Tachometer: _tachometer,
    WheelPose: _wheel_pose,
    GroundTruth: _ground_truth,
    Pressure: _pressure,
    Command: _command,
    Text: _text,
    Mount: _transforms,
}
