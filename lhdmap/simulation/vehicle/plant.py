"""The numbers of a machine as the kernels take them, for the load that it has."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.machine import Machine
from lhdmap.machine_sections import Spread

GRAVITY_MPS2 = 9.81


class Plant(NamedTuple):
    """A machine with its load, SI units; names as in its file."""

    front_m: float
    rear_m: float
    half_track_m: float
    max_bend_rad: float
    max_bend_rate_rps: float
    steering_lag_s: float
    steering_gain: float
    steering_dead_zone_rps: float
    top_speed_mps: float
    mass_kg: float
    power_w: float
    max_force_n: float
    rolling: float
    slip_stiffness: float
    drive_lag_s: float
    acceleration_mps2: float
    deceleration_mps2: float
    brake_mps2: float
    brake_ramp_s: float
    boom_min_rad: float
    boom_max_rad: float
    bucket_min_rad: float
    bucket_max_rad: float
    lift_rate_rps: float
    tilt_rate_rps: float
    linkage_lag_s: float
    shared: float
    idle_share: float


class Errors(NamedTuple):
    """Factors by which this machine differs from its file: steering gain, lags of drive, steering, linkage."""

    steering_gain: float = 1.0
    drive_lag: float = 1.0
    steering_lag: float = 1.0
    linkage_lag: float = 1.0


def drawn_errors(spread: Spread, seed: int) -> Errors:
    """Return the errors of the machine of a seed, uniform within the spread."""
    share = np.random.Generator(np.random.Philox(key=seed)).uniform(-1.0, 1.0, 4)
    sizes = np.array([spread.steering_gain, spread.lags, spread.lags, spread.lags])
    return Errors(*(1.0 + sizes * share).tolist())


def plant_of(machine: Machine, load_kg: float, errors: Errors) -> Plant:
    """Return the numbers of `machine` with a load; what depends on it is linear up to the payload."""
    size, drive, steering, brakes, linkage = (
        machine.dimensions,
        machine.drive,
        machine.steering,
        machine.brakes,
        machine.linkage,
    )
    share = min(max(load_kg / drive.payload_kg, 0.0), 1.0)

    def between(empty: float, loaded: float) -> float:
        return empty + share * (loaded - empty)

    return Plant(
        front_m=size.joint_to_front_axle_m,
        rear_m=size.joint_to_rear_axle_m,
        half_track_m=0.5 * size.track_m,
        max_bend_rad=math.radians(size.max_articulation_deg),
        max_bend_rate_rps=math.radians(size.max_articulation_rate_dps),
        steering_lag_s=steering.lag_s * errors.steering_lag,
        steering_gain=steering.gain * errors.steering_gain,
        steering_dead_zone_rps=math.radians(steering.dead_zone_dps),
        top_speed_mps=size.max_speed_kmh / 3.6,
        mass_kg=drive.mass_kg + max(load_kg, 0.0),
        power_w=1e3 * drive.engine_power_kw,
        max_force_n=1e3 * drive.max_force_kn,
        rolling=drive.rolling_resistance,
        slip_stiffness=drive.slip_stiffness,
        drive_lag_s=between(drive.lag_s, drive.lag_loaded_s) * errors.drive_lag,
        acceleration_mps2=between(drive.acceleration_mps2, drive.acceleration_loaded_mps2),
        deceleration_mps2=between(drive.deceleration_mps2, drive.deceleration_loaded_mps2),
        brake_mps2=between(brakes.deceleration_mps2, brakes.deceleration_loaded_mps2),
        brake_ramp_s=brakes.ramp_s,
        boom_min_rad=linkage.boom_min_rad,
        boom_max_rad=linkage.boom_max_rad,
        bucket_min_rad=linkage.bucket_min_rad,
        bucket_max_rad=linkage.bucket_max_rad,
        lift_rate_rps=linkage.lift_rate_rps,
        tilt_rate_rps=linkage.tilt_rate_rps,
        linkage_lag_s=linkage.lag_s * errors.linkage_lag,
        shared=linkage.shared,
        idle_share=linkage.idle_share,
    )
