"""The machine file's numbers as the kernels take them, and the pressures that its sensors have."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.machine import Machine
from lhdmap.simulation.ground.records import Record, Rig, record

_BAR_PA = 1e5
_WEIGHED_RAD = 0.2  # boom at which Table 2 holds
GRAVITY_MPS2 = 9.81


def rig_of(machine: Machine, tilt_factor: float = 1.0) -> Record:
    """Return the record of a machine; `tilt_factor` is its tilt rate over the file's."""
    size, drive, linkage, digging = machine.dimensions, machine.drive, machine.linkage, machine.digging
    displacement = 1e-3 * digging.displacement_l
    leak_mps = digging.leakage * digging.first_gear_mps
    return record(
        Rig(
            mass_kg=drive.mass_kg,
            wheelbase_m=size.wheelbase_m,
            gravity_centre_m=digging.gravity_centre_m,
            rolling=drive.rolling_resistance,
            slip_stiffness=drive.slip_stiffness,
            wheel_radius_m=size.wheel_radius_m,
            inertia_kgm2=digging.wheel_inertia_kgm2,
            displacement_m3=displacement,
            bulk_pa=1e9 * digging.stiffness_gpa_m3,
            leakage_m3=leak_mps * displacement / size.wheel_radius_m / (300.0 * _BAR_PA),
            loss_pa=_BAR_PA * digging.loss_bar,
            relief_pa=_BAR_PA * digging.relief_bar,
            power_w=1e3 * drive.engine_power_kw,
            gear_mps=digging.first_gear_mps,
            engine_lag_s=digging.engine_lag_s,
            pump_lag_s=digging.pump_lag_s,
            idle=digging.idle,
            pivot_x_m=linkage.pivot_m[0],
            pivot_z_m=linkage.pivot_m[1],
            boom_m=linkage.boom_m,
            boom_angle_rad=linkage.boom_angle_rad,
            lip_x_m=linkage.lip_m[0],
            lip_z_m=linkage.lip_m[1],
            bucket_angle_rad=linkage.bucket_angle_rad,
            boom_to_bucket=linkage.boom_to_bucket,
            boom_min_rad=linkage.boom_min_rad,
            boom_max_rad=linkage.boom_max_rad,
            bucket_min_rad=linkage.bucket_min_rad,
            bucket_max_rad=linkage.bucket_max_rad,
            lift_rps=linkage.lift_rate_rps,
            tilt_rps=linkage.tilt_rate_rps * tilt_factor,
            linkage_lag_s=linkage.lag_s,
            shared=linkage.shared,
            idle_share=linkage.idle_share,
            width_m=digging.bucket_width_m,
            nominal_m3=digging.bucket_volume_m3,
            lift_force_n=1e3 * digging.lift_force_kn,
            tilt_force_n=1e3 * digging.tilt_force_kn,
            floor_stiffness=1e3 * digging.floor_stiffness_kn_m,
            brake_n=machine.brakes.deceleration_mps2 * drive.mass_kg,
            brake_ramp_s=machine.brakes.ramp_s,
        )
    )


def tilt_bar(machine: Machine, share: float) -> float:
    """Return the tilt cylinder's pressure where it meets a share of its largest force, to either side."""
    free, most = machine.digging.tilt_free_bar, machine.digging.tilt_relief_bar
    return free + min(abs(share), 1.0) * (most - free)


def press_force_n(machine: Machine, pressure_bar: float) -> float:
    """Return the force of the lip on the floor at a tilt pressure, N."""
    free, most = machine.digging.tilt_free_bar, machine.digging.tilt_relief_bar
    return 1e3 * machine.digging.tilt_force_kn * max(pressure_bar - free, 0.0) / (most - free)


def load_arm_m(machine: Machine, boom_rad: float) -> float:
    """Return how far ahead of the boom's pivot the content is, racked, m."""
    linkage = machine.linkage
    return linkage.boom_m * math.cos(linkage.boom_angle_rad + boom_rad - linkage.boom_min_rad) + 0.4 * linkage.lip_m[0]


def lift_bar(machine: Machine, boom_rad: float, load_kg: float, vertical_n: float = 0.0) -> float:
    """Return the lift cylinder's pressure: torques of boom, bucket, content and the lip's force about the pivot.

    Affine in the load as Eq. (9) of autonomous_loading, and its Table 2 at boom 0.2.
    """
    digging, level = machine.digging, load_arm_m(machine, _WEIGHED_RAD)
    share = load_arm_m(machine, boom_rad) / level
    per_kg = (digging.lift_full_bar - digging.lift_empty_bar) / machine.drive.payload_kg
    lip = load_arm_m(machine, boom_rad) + 0.6 * machine.linkage.lip_m[0]
    pressed = vertical_n / GRAVITY_MPS2 * per_kg * lip / level
    return max(share * (digging.lift_empty_bar + per_kg * load_kg) + pressed, 0.0)


def bucket_for(machine: Machine, lip_z_m: float) -> float:
    """Return the bucket's angle at which the lip is at a height over the floor, boom at its lower stop."""
    linkage = machine.linkage
    pin = linkage.pivot_m[1] + linkage.boom_m * math.sin(linkage.boom_angle_rad)
    reach = math.hypot(*linkage.lip_m)
    psi = math.asin(float(np.clip((lip_z_m - pin) / reach, -1.0, 1.0))) - math.atan2(linkage.lip_m[1], linkage.lip_m[0])
    return psi - linkage.bucket_angle_rad + linkage.bucket_max_rad
