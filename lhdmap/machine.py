"""The machine: dimensions, bodies and sensor mounts as typed settings, read from `pipelines/machines/*.toml`.

Frames as in the contract: `base_link` is the middle of the FRONT axle on the floor (x forward, y left, z up),
`rear_link` the middle of the rear axle on the floor. The defaults are the 11-t machine of the papers (GHH LF11H).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.errors import ConfigError
from lhdmap.geometry import se3
from lhdmap.messages import FloatArray
from lhdmap.settings import load_section, nearest, read_toml, section_toml, setting

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
        (0.0, 0.0, 0.0), unit="m", source=ASSUMED, doc="Lower corner (x, y, z) in that frame."
    )
    max_m: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0), unit="m", source=ASSUMED, doc="Upper corner (x, y, z) in that frame."
    )


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
    """A machine: its dimensions, the boxes of its bodies and the mounts of its sensors, both by name."""

    name: str = "lhd_11t"
    dimensions: Dimensions = field(default_factory=Dimensions)
    bodies: dict[str, BodyBox] = field(default_factory=_default_bodies)
    mounts: dict[str, SensorMount] = field(default_factory=_default_mounts)

    def boxes(self, frame: str) -> FloatArray:
        """Return the boxes on `frame` (`base_link` or `rear_link`) as lower and upper corners, shape (N, 2, 3), m."""
        chosen = [(body.min_m, body.max_m) for body in self.bodies.values() if body.frame == frame]
        return np.array(chosen, dtype=float).reshape(-1, 2, 3)


def load_machine(path: Path | None = None) -> Machine:
    """Return the machine that a TOML file describes, or the default 11-t loader where `path` is None.

    A file has `name`, one `[dimensions]`, and a `[body.NAME]` and `[mount.NAME]` for each box and sensor; a part that
    is left out keeps the default's values, bodies and mounts are replaced as a whole.

    Raises:
        InputError: the file cannot be read or is not TOML.
        ConfigError: a key or a value in it is wrong.
    """
    if path is None:
        return Machine()
    table = read_toml(path, "machine file")
    try:
        return _machine(table, default_name=path.stem)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error


def _machine(table: Mapping[str, Any], *, default_name: str) -> Machine:
    known = ("name", "dimensions", "body", "mount")
    for key in table:
        if key not in known:
            raise ConfigError(f"unknown section '{key}'{nearest(key, known)}")
    bodies = {name: load_section(BodyBox, f"body.{name}", part) for name, part in table.get("body", {}).items()}
    mounts = {name: load_section(SensorMount, f"mount.{name}", part) for name, part in table.get("mount", {}).items()}
    for name, box in bodies.items():
        if any(low >= high for low, high in zip(box.min_m, box.max_m, strict=True)):
            raise ConfigError(f"body.{name}: each value of min_m must be below that of max_m")
    return Machine(
        name=str(table.get("name", default_name)),
        dimensions=load_section(Dimensions, "dimensions", table.get("dimensions", {})),
        bodies=bodies or _default_bodies(),
        mounts=mounts or _default_mounts(),
    )


def machine_toml(machine: Machine) -> str:
    """Print `machine` as a TOML file that `load_machine` reads back, each value with meaning, unit and source."""
    parts = [f'name = "{machine.name}"\n', section_toml("dimensions", machine.dimensions)]
    parts += [section_toml(f"body.{name}", body) for name, body in machine.bodies.items()]
    parts += [section_toml(f"mount.{name}", mount) for name, mount in machine.mounts.items()]
    return "\n".join(parts)
