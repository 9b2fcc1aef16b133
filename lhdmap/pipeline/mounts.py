"""Where the sensors sit: mounts of the log (`/tf_static`), else of the machine file, else level at `base_link`."""

from __future__ import annotations

import numpy as np

from lhdmap.geometry import se3
from lhdmap.logs.frames import FrameTree
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, Joints, Mount

_BY_ROLE = {"front": "lidar_front", "rear": "lidar_rear", "inclinometer": "inclinometer", "points": "lidar_points"}


class SensorMounts:
    """Mounts by sensor frame, found out once per frame; what had to be assumed is said in `warnings`."""

    def __init__(self, machine: Machine | None) -> None:
        self._machine = machine
        self._tree = FrameTree()
        self._found: dict[str, Mount] = {}
        self._roles: dict[str, str] = {}
        self.warnings: list[str] = []

    def update(self, mount: Mount) -> None:
        """Take one static transform of the log."""
        self._tree.add(mount)

    def of(self, frame: str, role: str) -> Mount:
        """Return the mount of a sensor frame on `base_link` or `rear_link`."""
        self._roles[role] = frame
        if frame not in self._found:
            self._found[frame] = self._tree.mount(frame) or self._assumed(frame, role)
        return self._found[frame]

    def on_rear_body(self, role: str) -> bool:
        """Return whether the sensor that was asked for in this role sits on the rear body."""
        frame = self._roles.get(role)
        return frame is not None and self._found[frame].parent_frame == "rear_link"

    def known(self, frame: str) -> bool:
        """Return whether the log itself says where this frame sits."""
        return self._tree.mount(frame) is not None

    def _assumed(self, frame: str, role: str) -> Mount:
        if self._machine is not None and (found := self._machine.mounts.get(_BY_ROLE.get(role, role))):
            self.warnings.append(
                f"no mount of '{frame}' in the log: that of the machine file '{self._machine.name}' is taken"
            )
            return Mount(0, found.parent, frame, found.T_parent_sensor)
        if role == "rear":
            self.warnings.append(
                f"no mount of '{frame}' in the log: a level scanner at base_link that looks back is assumed"
            )
            return Mount(0, "base_link", frame, se3.from_rpy(0.0, 0.0, np.pi))
        self.warnings.append(f"no mount of '{frame}' in the log: a level sensor at base_link is assumed")
        return Mount(0, "base_link", frame, np.eye(4))


def machine_of(source: LogSource, given: Machine | None) -> Machine | None:
    """Return the machine given, else the default loader where the log is one's (it has the joint of an LHD), else none."""
    if given is not None:
        return given
    if ("rear" in source.roles and "tf_static" in source.roles) or _bends(source):
        return Machine()
    return None


def _bends(source: LogSource) -> bool:
    """Return whether the log's joints are those of an articulated machine: wheels of a robot are joints, too."""
    first = source.first("joints")
    return isinstance(first, Joints) and "articulation" in first.positions_rad


def level_sensor(mount: Mount, roll_rad: float, pitch_rad: float) -> FloatArray:
    """Return the pose (4, 4) of a sensor of the front body in the machine's level frame: attitude applied, heading kept."""
    return se3.from_rpy(roll_rad, pitch_rad, 0.0) @ mount.T_parent_child
