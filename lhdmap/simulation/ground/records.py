"""The numbers that the kernels take, as records with names: state of the digging machine, the machine, the rock. SI units."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lhdmap.messages import FloatArray

Record = Any
"""One record of the types below; numba knows its fields."""


class State(NamedTuple):
    """The machine in the vertical plane of its heading; x of the front axle, z over the floor.

    `engine`, `stroke` and `brake` are shares; `content_m3` is loose ore; `embed_m` is how deep the lip sits as the rock
    resists it, `way_m` its way in rock. `rock_n` is what the pile holds against the drive, `resist_n` this and the floor,
    `up_n` what a rising lip meets at most, `down_n` what it meets, `press_n` the floor's force on a pressed lip. `tilting`,
    `lifting`: shares of the cylinders' largest forces, positive against lifting. `pull_n`: gravity along x on a slope.
    `busy`: the face may slide. `at_stop`: command with which the tilt cylinder presses against its stop. `begun_m`: up to
    there the lip has cut.
    """

    x_m: float = 0.0
    speed_mps: float = 0.0
    wheel_mps: float = 0.0
    pressure_pa: float = 0.0
    engine: float = 0.0
    stroke: float = 0.0
    boom_rad: float = 0.0
    bucket_rad: float = 0.0
    boom_rps: float = 0.0
    bucket_rps: float = 0.0
    content_m3: float = 0.0
    embed_m: float = 0.0
    way_m: float = 0.0
    lip_x_m: float = 0.0
    lip_z_m: float = 0.0
    resist_n: float = 0.0
    up_n: float = 0.0
    press_n: float = 0.0
    grip_n: float = 0.0
    traction_n: float = 0.0
    front_n: float = 0.0
    rear_n: float = 0.0
    lifting: float = 0.0
    tilting: float = 0.0
    brake: float = 0.0
    rear_up_s: float = 0.0
    slip_s: float = 0.0
    begun_m: float = 0.0
    lateral_m3: float = 0.0
    spilled_m3: float = 0.0
    rock_n: float = 0.0
    busy: float = 0.0
    at_stop: float = 0.0
    down_n: float = 0.0
    pull_n: float = 0.0


class Rig(NamedTuple):
    """A machine as the kernels take it."""

    mass_kg: float
    wheelbase_m: float
    gravity_centre_m: float
    rolling: float
    slip_stiffness: float
    wheel_radius_m: float
    inertia_kgm2: float
    displacement_m3: float
    bulk_pa: float
    leakage_m3: float
    loss_pa: float
    relief_pa: float
    power_w: float
    gear_mps: float
    engine_lag_s: float
    pump_lag_s: float
    idle: float
    pivot_x_m: float
    pivot_z_m: float
    boom_m: float
    boom_angle_rad: float
    lip_x_m: float
    lip_z_m: float
    bucket_angle_rad: float
    boom_to_bucket: float
    boom_min_rad: float
    boom_max_rad: float
    bucket_min_rad: float
    bucket_max_rad: float
    lift_rps: float
    tilt_rps: float
    linkage_lag_s: float
    shared: float
    idle_share: float
    width_m: float
    nominal_m3: float
    lift_force_n: float
    tilt_force_n: float
    floor_stiffness: float
    brake_n: float
    brake_ramp_s: float


class Rock(NamedTuple):
    """The rock of one attempt; `slope` is the tangent of the face's."""

    density: float
    hardness: float
    penetration: float
    rake_factor: float
    loosening: float
    fee_scale: float
    cohesion_pa: float
    external_rad: float
    tensile_pa: float
    friction: float
    swell: float
    entering: float
    heap: float
    level_share: float
    slide_per_s: float
    slope: float
    step_m: float
    origin_m: float
    lateral_share: float


STATE, RIG, ROCK = (np.dtype([(name, np.float64) for name in kind._fields]) for kind in (State, Rig, Rock))


def record(values: State | Rig | Rock) -> Record:
    """Return an array of one record, shape (1,)."""
    kind = STATE if isinstance(values, State) else RIG if isinstance(values, Rig) else ROCK
    return np.array([values], dtype=kind)


def state_of(one: Record) -> State:
    """Return the state in an array of one record."""
    row: FloatArray = one.view(np.float64)
    return State._make(row.tolist())
