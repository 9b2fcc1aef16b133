"""Messages of a log, decoded: what readers yield and what stages take. SI units, radians, integer nanoseconds.

`stamp_ns` is the time of the measurement (the header stamp; where that is zero or runs backwards, the log time: the
readers decide that in one place, `lhdmap.logs.stamps`). All are immutable; arrays in them must not be written to.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]

BODY_FRAMES = ("base_link", "rear_link")
"""The bodies that sensors are mounted on."""


class LaserScan(NamedTuple):
    """One sweep of a 2D scanner (`sensor_msgs/LaserScan`).

    Beam `i` points at `angle_min_rad + i * angle_increment_rad` (either sign, any offset) and was measured at
    `stamp_ns + i * time_increment_s`. `ranges_m`: shape (N,), float32; no return is inf, NaN or out of
    [`range_min_m`, `range_max_m`].
    """

    stamp_ns: int
    frame_id: str
    angle_min_rad: float
    angle_increment_rad: float
    time_increment_s: float
    range_min_m: float
    range_max_m: float
    ranges_m: Float32Array


class PointCloud(NamedTuple):
    """One cloud of a 3D scanner (`sensor_msgs/PointCloud2`) in its own frame.

    `points_m`: shape (N, 3), float32, finite. `time_offsets_s`: shape (N,), each point's time after `stamp_ns`, or empty
    where the log has none.
    """

    stamp_ns: int
    frame_id: str
    points_m: Float32Array
    time_offsets_s: Float32Array


class Inclination(NamedTuple):
    """Roll and pitch of the front body from `sensor_msgs/Imu` (orientation; its yaw is ignored), radians.

    Sign by REP 103: positive pitch points the nose down. `angular_velocity_rps` and `acceleration_mps2`: shape (3,) or None.
    `angular_velocity_std_rps`: of its noise, where the message tells it.
    """

    stamp_ns: int
    frame_id: str
    roll_rad: float
    pitch_rad: float
    angular_velocity_rps: FloatArray | None
    acceleration_mps2: FloatArray | None
    angular_velocity_std_rps: float | None = None


class Joints(NamedTuple):
    """Joint angles by name (`sensor_msgs/JointState`): `articulation`, `boom_lift`, `bucket_tilt` (rad, rad/s)."""

    stamp_ns: int
    positions_rad: dict[str, float]
    velocities_rps: dict[str, float]


class Tachometer(NamedTuple):
    """Signed drive-line speed (`geometry_msgs/TwistStamped`, linear.x), m/s; slips with the wheels."""

    stamp_ns: int
    speed_mps: float


class WheelPose(NamedTuple):
    """Planar pose by the machine's own dead reckoning (`nav_msgs/Odometry` that is not ground truth, CARMEN ODOM), m and rad."""

    stamp_ns: int
    x_m: float
    y_m: float
    heading_rad: float


class GroundTruth(NamedTuple):
    """Pose of `base_link` in `map` (`nav_msgs/Odometry` on the ground-truth topic); quaternion x y z w. Never an input."""

    stamp_ns: int
    position_m: FloatArray
    quaternion_xyzw: FloatArray


class Pressure(NamedTuple):
    """A hydraulic pressure (`sensor_msgs/FluidPressure`), Pa."""

    stamp_ns: int
    pressure_pa: float


class Command(NamedTuple):
    """Driving and bucket commands (`lhd_msgs/MachineCommand`); units as in the contract."""

    stamp_ns: int
    propel: float
    steering_rate_rps: float
    tilt: float
    lift: float
    full_rpm: bool
    brake: bool


class Text(NamedTuple):
    """A `std_msgs/String`: operation mode or node."""

    stamp_ns: int
    text: str


class Mount(NamedTuple):
    """A static transform (`/tf_static`): pose of `child_frame` in `parent_frame`, shape (4, 4)."""

    stamp_ns: int
    parent_frame: str
    child_frame: str
    T_parent_child: FloatArray


Message = (
    LaserScan
    | PointCloud
    | Inclination
    | Joints
    | Tachometer
    | WheelPose
    | GroundTruth
    | Pressure
    | Command
    | Text
    | Mount
)


class Record(NamedTuple):
    """One message of a log as a reader yields it: topic, log (receive) time and the decoded message."""

    topic: str
    log_time_ns: int
    message: Message
