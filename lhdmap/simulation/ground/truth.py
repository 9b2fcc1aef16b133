"""What really is while a machine loads: for evaluation."""

from __future__ import annotations

from typing import NamedTuple

import numba as nb

from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.simulation.ground.draws import CELL_M
from lhdmap.simulation.ground.records import State

_TOE_M = 0.1  # height from which on it is the pile


class Truth(NamedTuple):
    """The machine and its bucket; forces in newton, `rock_n` what the pile alone holds against the drive.

    `fill` is the content's weight over the payload. `toe_m` is the way of the lip to the toe. `slip` is the tyres' slip
    ratio, `slip_s` the time with more than 0.5, `rear_up_s` the time that the rear axle was in the air, of this attempt.
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


@nb.njit(cache=True, nogil=True)
def toe_of(heights: FloatArray, origin_m: float) -> float:
    """Return where the pile begins, m; where there is none its far end."""
    for k in range(len(heights)):
        if heights[k] > _TOE_M:
            return origin_m + CELL_M * k
    return origin_m + CELL_M * (len(heights) - 1)


def truth_of(state: State, machine: Machine, kg_m3: float, toe_m: float, attempt: int) -> Truth:
    """Return the truth of a state; `kg_m3` is the density of loose ore, `toe_m` the place of the toe."""
    linkage, speed, wheel = machine.linkage, state.speed_mps, state.wheel_mps
    lifted = state.boom_rad - linkage.boom_min_rad
    return Truth(
        attempt=attempt,
        fill=state.content_m3 * kg_m3 / machine.drive.payload_kg,
        content_m3=state.content_m3,
        lip_x_m=state.lip_x_m,
        lip_z_m=state.lip_z_m,
        floor_rad=linkage.bucket_angle_rad
        + state.bucket_rad
        - linkage.bucket_max_rad
        + linkage.boom_to_bucket * lifted,
        toe_m=toe_m - state.lip_x_m,
        speed_mps=speed,
        wheel_mps=wheel,
        slip=(wheel - speed) / max(abs(wheel), abs(speed), 0.2),
        embed_m=state.embed_m,
        rock_n=state.rock_n,
        up_n=state.up_n,
        press_n=state.press_n,
        traction_n=state.traction_n,
        front_n=state.front_n,
        rear_n=state.rear_n,
        slip_s=state.slip_s,
        rear_up_s=state.rear_up_s,
        contact=state.rock_n > 0.0,
    )
