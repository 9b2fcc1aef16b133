"""The machine: dimensions, bodies and sensor mounts as typed settings, read from `pipelines/machines/*.toml`.

Frames as in the contract: `base_link` is the middle of the FRONT axle on the floor (x forward, y left, z up),
`rear_link` the middle of the rear axle on the floor. The defaults are the 11-t machine of the papers (GHH LF11H).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lhdmap.geometry import se3
from lhdmap.machine_sections import Brakes, Digging, Drive, Linkage, Spread, Steering
from lhdmap.messages import FloatArray
from lhdmap.settings import REQUIRED, check_corners, setting
from lhdmap.settings_tree import load_tree, part, tree_toml

PAPER = "topological_navigation, section 3.1"
ASSUMED = "assumed, typical of 10 to 11-t loaders"


@dataclass(frozen=True, slots=True)
class Dimensions:
    """Lengths and limits of the articulated machine."""

    joint_to_front_axle_m: float = setting(
        1.7,
        unit="m",
        source=ASSUMED,
        minimum=0.1,
        maximum=10.0,
        doc="L_f of Eq. (1): articulation joint to front axle.",
    )
    joint_to_rear_axle_m: float = setting(
        1.7, unit="m", source=ASSUMED, minimum=0.1, maximum=10.0, doc="L_r of Eq. (1): articulation joint to rear axle."
    )
    max_articulation_deg: float = setting(
        40.0, unit="deg", source=ASSUMED, minimum=1.0, maximum=80.0, doc="Largest articulation angle to either side."
    )
    max_articulation_rate_dps: float = setting(
        15.0, unit="deg/s", source=ASSUMED, minimum=0.1, maximum=90.0, doc="Largest rate of the articulation angle."
    )
    length_m: float = setting(9.71, unit="m", source=PAPER, minimum=1.0, doc="Length over bucket and rear frame.")
    width_m: float = setting(2.45, unit="m", source=PAPER, minimum=0.5, doc="Width over the tyres and bodies.")
    height_m: float = setting(2.45, unit="m", source=PAPER, minimum=0.5, doc="Height over the cabin.")
    track_m: float = setting(
        1.9, unit="m", source=ASSUMED, minimum=0.2, doc="Distance of the left and right tyre's middle."
    )
    wheel_radius_m: float = setting(
        0.8, unit="m", source=ASSUMED, minimum=0.1, doc="Radius of a loaded tyre (18.00 R 25)."
    )
    max_speed_kmh: float = setting(24.0, unit="km/h", source=ASSUMED, minimum=1.0, doc="Top speed on the level.")

    @property
    def wheelbase_m(self) -> float:
        """Distance of the axles when the machine is straight, metres."""
        return self.joint_to_front_axle_m + self.joint_to_rear_axle_m


@dataclass(frozen=True, slots=True)
class BodyBox:
    """A box around a part of the machine, axis-aligned in the frame of the body that it belongs to."""

    frame: str = setting(
        "base_link", source="frames of the log", choices=("base_link", "rear_link"), doc="Body that carries the part."
    )
    min_m: tuple[float, float, float] = setting(
        REQUIRED, unit="m", source=ASSUMED, doc="Lower corner (x, y, z) in that frame."
    )
    max_m: tuple[float, float, float] = setting(
        REQUIRED, unit="m", source=ASSUMED, doc="Upper corner (x, y, z) in that frame."
    )

    def __post_init__(self) -> None:
        """Raise ConfigError where it has no inside."""
        check_corners(self.min_m, self.max_m)


@dataclass(frozen=True, slots=True)
class SensorMount:
    """Pose of a sensor frame on the front or the rear body; angles in REP 103 order, Rz(yaw) Ry(pitch) Rx(roll)."""

    parent: str = setting(
        "base_link", source="frames of the log", choices=("base_link", "rear_link"), doc="Body that carries the sensor."
    )
    position_m: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0), unit="m", source=ASSUMED, doc="Position (x, y, z) in the parent."
    )
    roll_deg: float = setting(0.0, unit="deg", source=ASSUMED, doc="Roll of the sensor frame.")
    pitch_deg: float = setting(0.0, unit="deg", source=ASSUMED, doc="Pitch of the sensor frame; positive looks down.")
    yaw_deg: float = setting(0.0, unit="deg", source=ASSUMED, doc="Yaw of the sensor frame; 180 looks backwards.")

    @property
    def T_parent_sensor(self) -> FloatArray:  # noqa: N802  # frames in the name
        """Pose of the sensor in its parent frame, shape (4, 4)."""
        roll, pitch, yaw = (math.radians(angle) for angle in (self.roll_deg, self.pitch_deg, self.yaw_deg))
        return se3.from_rpy(roll, pitch, yaw, self.position_m)


def _default_bodies() -> dict[str, BodyBox]:
    return {
        "front_frame": BodyBox("base_link", (-1.5, -1.225, 0.0), (1.0, 1.225, 1.7)),
        "boom_and_bucket": BodyBox("base_link", (1.0, -1.225, 0.0), (3.2, 1.225, 1.5)),
        "rear_frame": BodyBox("rear_link", (-3.11, -1.225, 0.0), (1.5, 1.225, 1.7)),
        "cabin": BodyBox("rear_link", (0.0, 0.3, 1.7), (1.4, 1.225, 2.45)),
    }


def _default_mounts() -> dict[str, SensorMount]:
    return {
        "lidar_front": SensorMount("base_link", (0.8, 0.0, 1.8), pitch_deg=2.5),
        "lidar_rear": SensorMount("rear_link", (-3.0, 0.0, 1.8), pitch_deg=2.5, yaw_deg=180.0),
        "inclinometer": SensorMount("base_link", (-0.5, 0.0, 1.0)),
    }


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine: dimensions, what moves it, the boxes of its bodies and the mounts of its sensors, both by name."""

    name: str = setting("lhd_11t", doc="Name of the machine.")
    dimensions: Dimensions = part(Dimensions)
    drive: Drive = part(Drive)
    steering: Steering = part(Steering)
    brakes: Brakes = part(Brakes)
    linkage: Linkage = part(Linkage)
    digging: Digging = part(Digging)
    spread: Spread = part(Spread)
    bodies: dict[str, BodyBox] = part(_default_bodies, key="body")
    mounts: dict[str, SensorMount] = part(_default_mounts, key="mount")

    def boxes(self, frame: str) -> FloatArray:
        """Return the boxes on `frame` (`base_link` or `rear_link`) as lower and upper corners, shape (N, 2, 3), m."""
        chosen = [(body.min_m, body.max_m) for body in self.bodies.values() if body.frame == frame]
        return np.array(chosen, dtype=float).reshape(-1, 2, 3)


def load_machine(path: Path | None = None) -> Machine:
    """Return the machine that a TOML file describes, or the default 11-t loader where `path` is None.

    A file has `name`, one `[dimensions]`, `[drive]`, `[steering]`, `[brakes]`, `[linkage]`, `[digging]`, `[spread]`, and a
    `[body.NAME]` and `[mount.NAME]` for each box and sensor; a part that is left out keeps the default's values, bodies
    and mounts are replaced as a whole.

    Raises:
        InputError: the file cannot be read or is not TOML.
        ConfigError: a key or a value in it is wrong.
    """
    if path is None:
        return Machine()
    machine = load_tree(Machine, path, "machine file", Machine(path.stem))
    return replace(machine, bodies=machine.bodies or _default_bodies(), mounts=machine.mounts or _default_mounts())


def machine_toml(machine: Machine) -> str:
    """Print `machine` as a TOML file that `load_machine` reads back, each value with meaning, unit and source."""
    return tree_toml(machine)
