"""Drive and brakes in one sub-step: speed of the ground, of the wheels, and the force between them."""

from __future__ import annotations

import math

import numba as nb

from lhdmap.simulation.vehicle.plant import Plant
from lhdmap.simulation.vehicle.tyres import SLOW_MPS, carried_speed, slip_for, tyre_force, wheel_for

_STANDING_MPS = 0.005  # wheels slower than this stand where they are wanted to
_SHIFT_MPS = 0.05  # slower than this the other gear can be engaged

Speeds = tuple[float, float, float]
"""Ground and wheel speed, m/s, and the wheels' force along x, N."""


@nb.njit(cache=True, nogil=True)
def braked(
    plant: Plant, speed_mps: float, brake: float, grip_n: float, weight_n: float, pull_n: float, step_s: float
) -> Speeds:
    """Return what a sub-step with the brake on does: the drive is in neutral.

    Brake and rolling resistance hold back together, as much as the floor takes. `weight_n` is what presses on the floor,
    `pull_n` gravity along x. A standing machine is let go by the drive only when the brake is on.
    """
    rolling = plant.rolling * weight_n
    wanted = brake * plant.brake_mps2 * plant.mass_kg + rolling
    hold = min(wanted, grip_n)
    if speed_mps == 0.0 and abs(pull_n) <= min(grip_n, max(wanted, plant.max_force_n if brake < 1.0 else 0.0)):
        return 0.0, 0.0, -pull_n
    way = math.copysign(1.0, speed_mps if speed_mps != 0.0 else pull_n)
    after = speed_mps + step_s * (pull_n - way * hold) / plant.mass_kg
    if after * way <= 0.0:
        after = 0.0  # whether it stays there the next sub-step says
    slip = slip_for(hold, grip_n, plant.slip_stiffness)
    return after, after * (1.0 - slip), -way * max(hold - rolling, 0.0)


@nb.njit(cache=True, nogil=True)
def driven(
    plant: Plant,
    speeds: tuple[float, float],
    propel: float,
    brake: float,
    grip_n: float,
    weight_n: float,
    pull_n: float,
    step_s: float,
) -> Speeds:
    """Return what a sub-step of the hydrostatic drive does: wheels run to the wanted speed, the floor carries the machine.

    `speeds`: of the ground and of the wheels. A brake that is going off loads the drive.
    """
    speed, wheel = speeds
    drag, rolling = brake * plant.brake_mps2 * plant.mass_kg, plant.rolling * weight_n
    after = _wanted_wheel(plant, wheel, propel, step_s)
    if after == 0.0 and abs(speed) <= SLOW_MPS and abs(pull_n) <= min(0.99 * grip_n, plant.max_force_n + drag):
        return 0.0, 0.0, -pull_n
    per_n = step_s / plant.mass_kg
    carried = carried_speed(after, speed, grip_n, plant.slip_stiffness, per_n, pull_n, rolling)
    force = tyre_force(after, carried, grip_n, plant.slip_stiffness)
    low, high = _drive_limits(plant, wheel, after, drag)
    if low <= force <= high:
        return carried, after, force
    force = min(max(force, low), high)
    if abs(speed) <= SLOW_MPS and abs(force + pull_n) <= rolling:
        return 0.0, 0.0, force  # stalled
    resisting = math.copysign(rolling, speed if speed != 0.0 else force + pull_n)
    carried = speed + per_n * (force + pull_n - resisting)
    return carried, wheel_for(force, carried, grip_n, plant.slip_stiffness), force


@nb.njit(cache=True, nogil=True)
def _wanted_wheel(plant: Plant, wheel: float, propel: float, step_s: float) -> float:
    """Return the wheels' speed after a sub-step if nothing held them: first order, within the limits."""
    target = propel * plant.top_speed_mps
    if target * wheel < 0.0 and abs(wheel) > _SHIFT_MPS:
        target = 0.0  # the other gear only through standstill
    change = (target - wheel) * -math.expm1(-step_s / plant.drive_lag_s)
    limit = step_s * (plant.acceleration_mps2 if change * wheel >= 0.0 else plant.deceleration_mps2)
    after = wheel + min(max(change, -limit), limit)
    return 0.0 if target == 0.0 and abs(after) < _STANDING_MPS else after


@nb.njit(cache=True, nogil=True)
def _drive_limits(plant: Plant, wheel: float, after: float, drag_n: float) -> tuple[float, float]:
    """Return the least and the largest force at the tyres: power drives, the relief valve limits driving and holding back."""
    most = plant.max_force_n
    driving = min(most, plant.power_w / max(abs(wheel), 1e-3))
    way = 0.0 if after == 0.0 else math.copysign(1.0, after)
    low = -most if after >= 0.0 else -driving
    high = driving if after >= 0.0 else most
    return low - way * drag_n, high - way * drag_n
