"""Where boom and bucket hold the lip, in the vertical plane of the machine: x ahead of the front axle, z over the floor."""

from __future__ import annotations

import math

import numba as nb

from lhdmap.simulation.ground.records import Record


@nb.njit(cache=True, nogil=True)
def floor_angle(rig: Record, boom_rad: float, bucket_rad: float) -> float:
    """Return ψ, the angle of the bucket's floor; positive is lip up."""
    lifted = boom_rad - rig.boom_min_rad
    return rig.bucket_angle_rad + bucket_rad - rig.bucket_max_rad + rig.boom_to_bucket * lifted


@nb.njit(cache=True, nogil=True)
def lip(rig: Record, boom_rad: float, bucket_rad: float) -> tuple[float, float]:
    """Return x and z of the lip."""
    arm = rig.boom_angle_rad + boom_rad - rig.boom_min_rad
    psi = floor_angle(rig, boom_rad, bucket_rad)
    c, s = math.cos(psi), math.sin(psi)
    x = rig.pivot_x_m + rig.boom_m * math.cos(arm) + c * rig.lip_x_m - s * rig.lip_z_m
    z = rig.pivot_z_m + rig.boom_m * math.sin(arm) + s * rig.lip_x_m + c * rig.lip_z_m
    return x, z


@nb.njit(cache=True, nogil=True)
def lip_rates(
    rig: Record, boom_rad: float, bucket_rad: float, boom_rps: float, bucket_rps: float
) -> tuple[float, float]:
    """Return the speed of the lip along x and z by the cylinders alone, m/s."""
    arm = rig.boom_angle_rad + boom_rad - rig.boom_min_rad
    psi = floor_angle(rig, boom_rad, bucket_rad)
    turn = bucket_rps + rig.boom_to_bucket * boom_rps
    c, s = math.cos(psi), math.sin(psi)
    x = -rig.boom_m * math.sin(arm) * boom_rps + turn * (-s * rig.lip_x_m - c * rig.lip_z_m)
    z = rig.boom_m * math.cos(arm) * boom_rps + turn * (c * rig.lip_x_m - s * rig.lip_z_m)
    return x, z
