"""Where a scanner sits on the machine, and the boxes that its two bodies fill: points inside are the machine itself."""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.geometry.articulated import T_base_rear, T_rear_base
from lhdmap.geometry.boxes import grown
from lhdmap.machine import Machine
from lhdmap.messages import BODY_FRAMES, FloatArray, Mount


class Rig(NamedTuple):
    """A sensor and the bodies around it as the kernels take them; boxes, shape (N, 6), already carry the margin.

    No point farther than `reach_m` from the sensor can lie in a box.
    """

    T_parent_sensor: FloatArray
    on_rear: bool
    L_f_m: float
    L_r_m: float
    front_boxes: FloatArray
    rear_boxes: FloatArray
    reach_m: float


def rig_of(mount: Mount, machine: Machine, margin_m: float) -> Rig:
    """Return the rig of one sensor, its boxes grown by `margin_m` on all sides.

    Raises:
        InputError: the sensor is mounted on neither body, or its pose is no rigid motion.
    """
    if mount.parent_frame not in BODY_FRAMES:
        raise InputError(
            f"mount of '{mount.child_frame}': its parent is '{mount.parent_frame}'; base_link or rear_link was wanted"
        )
    T = np.ascontiguousarray(mount.T_parent_child, dtype=np.float64)
    if T.shape != (4, 4) or not np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-3):
        raise InputError(f"mount of '{mount.child_frame}': a rigid 4 x 4 pose was wanted; check /tf_static")
    front, rear = (grown(machine.boxes(frame), margin_m) for frame in BODY_FRAMES)
    size = machine.dimensions
    L_f, L_r = size.joint_to_front_axle_m, size.joint_to_rear_axle_m
    # All distances go through the joint, so that the bound holds at any articulation.
    reach_m = float(np.linalg.norm(T[:3, 3])) + L_f + L_r + max(_radius(front) + L_f, _radius(rear) + L_r)
    return Rig(T, mount.parent_frame == "rear_link", L_f, L_r, front, rear, reach_m)


def _radius(boxes: FloatArray) -> float:
    """Return the largest distance of any box corner from the origin of the body."""
    if len(boxes) == 0:
        return 0.0
    return float(np.linalg.norm(np.maximum(np.abs(boxes[:, :3]), np.abs(boxes[:, 3:])), axis=1).max())


@nb.njit(cache=True, nogil=True)
def in_boxes(T_body_sensor: FloatArray, boxes: FloatArray, x: float, y: float, z: float) -> bool:
    """Return whether the point (x, y, z) of the sensor's frame lies in one of the body's boxes."""
    T = T_body_sensor
    for b in range(boxes.shape[0]):
        px = T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3]
        py = T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3]
        pz = T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3]
        inside = (
            boxes[b, 0] <= px <= boxes[b, 3] and boxes[b, 1] <= py <= boxes[b, 4] and boxes[b, 2] <= pz <= boxes[b, 5]
        )
        if inside:
            return True
    return False


def self_hits(rig: Rig, points_sensor: FloatArray, articulation_rad: float) -> npt.NDArray[np.bool_]:
    """Return which points, shape (N, 3) in the sensor's frame, lie on the machine; shape (N,)."""
    T_base_sensor, T_rear_sensor = body_poses(rig, articulation_rad)
    return np.array(
        [
            in_boxes(T_base_sensor, rig.front_boxes, x, y, z) or in_boxes(T_rear_sensor, rig.rear_boxes, x, y, z)
            for x, y, z in points_sensor
        ],
        dtype=bool,
    )


@nb.njit(cache=True, nogil=True)
def body_poses(rig: Rig, articulation_rad: float) -> tuple[FloatArray, FloatArray]:
    """Return (T_base_sensor, T_rear_sensor), each of shape (4, 4)."""
    if rig.on_rear:
        return T_base_rear(articulation_rad, rig.L_f_m, rig.L_r_m) @ rig.T_parent_sensor, rig.T_parent_sensor.copy()
    return rig.T_parent_sensor.copy(), T_rear_base(articulation_rad, rig.L_f_m, rig.L_r_m) @ rig.T_parent_sensor
