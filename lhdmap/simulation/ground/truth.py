"""What really is while a machine loads: for evaluation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.simulation.ground.draws import CELL_M
from lhdmap.simulation.ground.linkage import floor_angle
from lhdmap.simulation.ground.records import Record

_TOE_M = 0.1  # height from which on it is the pile


class Truth(NamedTuple):
    """The machine and its bucket; forces in newton, `rock_n` what the pile alone holds against the drive.

    `fill` is the content's weight over the payload. `toe_m` is the way of the lip to the toe. `slip` is the tyres' slip
    ratio, `slip_s` the time with more than 0.2, `rear_up_s` the time that the rear axle was in the air, of this attempt.
    """

    attempt: int
    fill: float
    content_m3: float
    lip_x_m: float
    lip_z_m: float
    floor_rad: float
    toe_m: float
    speed_mps: float
    wheel_mps: float
    slip: float
    embed_m: float
    rock_n: float
    up_n: float
    press_n: float
    traction_n: float
    front_n: float
    rear_n: float
    slip_s: float
    rear_up_s: float
    contact: bool


def toe_of(heights: FloatArray, origin_m: float) -> float:
    """Return where the pile begins, m; where there is none its far end."""
    high = np.flatnonzero(heights > _TOE_M)
    first = int(high[0]) if high.size else len(heights) - 1
    return origin_m + CELL_M * first


def truth_of(state: Record, rig: Record, rock: Record, heights: FloatArray, machine: Machine, attempt: int) -> Truth:
    """Return the truth of a state."""
    speed, wheel = float(state["speed_mps"]), float(state["wheel_mps"])
    return Truth(
        attempt=attempt,
        fill=float(state["content_m3"] * rock["density"] / rock["swell"]) / machine.drive.payload_kg,
        content_m3=float(state["content_m3"]),
        lip_x_m=float(state["lip_x_m"]),
        lip_z_m=float(state["lip_z_m"]),
        floor_rad=floor_angle(rig, float(state["boom_rad"]), float(state["bucket_rad"])),
        toe_m=toe_of(heights, float(rock["origin_m"])) - float(state["lip_x_m"]),
        speed_mps=speed,
        wheel_mps=wheel,
        slip=(wheel - speed) / max(abs(wheel), abs(speed), 0.2),
        embed_m=float(state["embed_m"]),
        rock_n=float(state["rock_n"]),
        up_n=float(state["up_n"]),
        press_n=float(state["press_n"]),
        traction_n=float(state["traction_n"]),
        front_n=float(state["front_n"]),
        rear_n=float(state["rear_n"]),
        slip_s=float(state["slip_s"]),
        rear_up_s=float(state["rear_up_s"]),
        contact=bool(state["rock_n"] > 0.0),
    )
