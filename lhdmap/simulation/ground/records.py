"""The numbers that the kernels take, as records with names: state of the digging machine, the machine, the rock. SI units."""

from __future__ import annotations

from typing import Any

import numpy as np

Record = Any
"""One record of the types below; numba knows its fields."""

_STATE = (
    "x_m speed_mps wheel_mps pressure_pa engine stroke boom_rad bucket_rad boom_rps bucket_rps "  # machine
    "content_m3 embed_m way_m lip_x_m lip_z_m "  # bucket: loose ore, effective depth, way that its lip made in rock
    "resist_n up_n press_n grip_n traction_n front_n rear_n "  # forces of the last step
    "lifting tilting brake rear_up_s slip_s rock rock_rate "  # shares of the cylinders' forces, axle in the air, rocking
    "begun_m lateral_m3 spilled_m3 rock_n"
).split()
STATE = np.dtype([(name, np.float64) for name in _STATE])
"""The machine in the vertical plane of its heading: x of the front axle on the floor."""

_RIG = (
    "mass_kg wheelbase_m gravity_centre_m rolling slip_stiffness wheel_radius_m inertia_kgm2 "
    "displacement_m3 bulk_pa leakage_m3 loss_pa relief_pa power_w gear_mps engine_lag_s pump_lag_s idle "
    "pivot_x_m pivot_z_m boom_m boom_angle_rad lip_x_m lip_z_m bucket_angle_rad boom_to_bucket "
    "boom_min_rad boom_max_rad bucket_min_rad bucket_max_rad lift_rps tilt_rps linkage_lag_s shared "
    "width_m nominal_m3 lift_force_n tilt_force_n floor_stiffness brake_n brake_ramp_s"
).split()
RIG = np.dtype([(name, np.float64) for name in _RIG])
"""A machine as the kernels take it."""

_ROCK = (
    "density hardness penetration rake_factor loosening fee_scale cohesion_pa external_rad tensile_pa "
    "friction swell entering heap level_share flow slope step_m origin_m lateral_share"
).split()
ROCK = np.dtype([(name, np.float64) for name in _ROCK])
"""The rock of one attempt; `slope` is the tangent of the face's."""


def record(kind: np.dtype[np.void], **values: float) -> Record:
    """Return an array of one record, shape (1,); what is not given is nought."""
    out = np.zeros(1, dtype=kind)
    for name, value in values.items():
        out[name] = value
    return out
