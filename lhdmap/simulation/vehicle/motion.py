"""The equations of motion of a stepped machine, as a kernel on flat arrays.

Eq. (1), (2) of the loading paper and (10), (11) of the navigation paper, with actuators before them:

    steering   γ̈ = (ω_wanted − γ̇) / τ                   limits of rate and angle
    drive      f = limited((v_wanted − v_wheel) / τ) + resistance, no more than power and friction give
    ground     v̇ = f − g sin(slope) − c_rr g cos(slope) sign(v) − brake · b sign(v)
    tyre       |f| = μ g cos(slope) (1 − exp(−k s)),  s the slip

All forces are by mass. Steps are divided into parts of a millisecond, each by the midpoint of its angles.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.machine import Machine
from lhdmap.messages import FloatArray

PART_S = 0.001
_G_MPS2 = 9.80665
_REST_MPS = 1e-3  # slower is at rest where brake or drive hold it
_MOST_SHARE = 0.98  # of what friction gives: more is spinning

# Indices of the state that the kernel steps, and of its parameters.
X, Y, YAW, BEND, BEND_RATE, SPEED, WHEEL, TRACTION, BRAKE, BOOM, BOOM_RATE, BUCKET, BUCKET_RATE = range(13)
STATES = 13
(
    FRONT_M, REAR_M, BEND_MAX, BEND_RATE_MAX, STEER_TAU, STEER_GAIN, STEER_DEAD, TOP, TAU, ACCELERATION, SLOWING, POWER, C_RR,
    SLIP_SLOPE, BRAKE_FORCE, BRAKE_RAMP, LIFT_RATE, TILT_RATE, BOTH, IDLE, ARM_TAU, LIFT_LOW, LIFT_HIGH, TILT_LOW, TILT_HIGH,
) = range(25)  # fmt: skip
PROPEL, STEER, TILT, LIFT, RPM, STOP = range(6)


def parameters(machine: Machine, load_kg: float) -> FloatArray:
    """Return the parameters of the kernel, shape (25,), for a load."""
    size, drive, brakes, steering, arm = (
        machine.dimensions,
        machine.drive,
        machine.brakes,
        machine.steering,
        machine.linkage,
    )
    full = min(max(load_kg / drive.payload_kg, 0.0), 1.0) if drive.payload_kg > 0.0 else 0.0

    def between(empty: float, loaded: float) -> float:
        return empty + full * (loaded - empty)

    return np.array(
        [
            size.joint_to_front_axle_m, size.joint_to_rear_axle_m, math.radians(size.max_articulation_deg),
            math.radians(size.max_articulation_rate_dps), steering.time_constant_s, steering.gain,
            math.radians(steering.dead_zone_dps), size.max_speed_kmh / 3.6,
            between(drive.time_constant_s, drive.loaded_time_constant_s),
            between(drive.acceleration_mps2, drive.loaded_acceleration_mps2),
            between(drive.slowing_mps2, drive.loaded_slowing_mps2), drive.power_w / (drive.mass_kg + load_kg),
            drive.rolling_resistance, drive.slip_slope,
            between(brakes.deceleration_mps2, brakes.loaded_deceleration_mps2), brakes.ramp_s,
            arm.lift_rate_rps, arm.tilt_rate_rps, arm.both_share, arm.idle_share, arm.time_constant_s,
            *arm.lift_limits_rad, *arm.tilt_limits_rad,
        ]
    )  # fmt: skip


@nb.njit(cache=True, nogil=True)
def advance(state: FloatArray, command: FloatArray, p: FloatArray, ground: FloatArray, span_s: float) -> None:
    """Step `state` (13,) over a time; `command` (6,), parameters `p`, `ground` (2,): slope (rad, up positive), friction."""
    parts = max(int(math.ceil(span_s / PART_S - 1e-9)), 1)
    dt = span_s / parts
    for _ in range(parts):
        _arm(state, command, p, dt)
        _drive(state, command, p, ground, dt)
        _turn(state, command, p, math.cos(ground[0]), dt)


@nb.njit(cache=True, nogil=True)
def _turn(state: FloatArray, command: FloatArray, p: FloatArray, level: float, dt: float) -> None:
    """Turn the joint, and move both bodies: Eq. (1), (2); `level` is the cosine of the slope."""
    wanted = command[STEER] if abs(command[STEER]) > p[STEER_DEAD] else 0.0
    wanted = min(max(wanted * p[STEER_GAIN], -p[BEND_RATE_MAX]), p[BEND_RATE_MAX])
    keep = math.exp(-dt / p[STEER_TAU])
    before = state[BEND_RATE]
    rate = wanted + (before - wanted) * keep
    bend = state[BEND] + wanted * dt + (before - wanted) * p[STEER_TAU] * (1.0 - keep)  # exact for a command that stays
    if abs(bend) >= p[BEND_MAX] and bend * (wanted if wanted != 0.0 else rate) > 0.0:
        bend, rate = math.copysign(p[BEND_MAX], bend), 0.0
    omega = (bend - state[BEND]) / dt
    middle = 0.5 * (bend + state[BEND])
    speed = state[SPEED]
    heading_rate = (speed * math.sin(middle) + p[REAR_M] * omega) / (p[FRONT_M] * math.cos(middle) + p[REAR_M])
    yaw = state[YAW] + 0.5 * dt * heading_rate
    state[X] += dt * speed * level * math.cos(yaw)
    state[Y] += dt * speed * level * math.sin(yaw)
    state[YAW] += dt * heading_rate
    state[BEND], state[BEND_RATE] = bend, rate


@nb.njit(cache=True, nogil=True)
def _drive(state: FloatArray, command: FloatArray, p: FloatArray, ground: FloatArray, dt: float) -> None:
    """Change the speed by drive, brakes, slope and rolling resistance."""
    speed, grip = state[SPEED], ground[1] * _G_MPS2 * math.cos(ground[0])
    pull = -_G_MPS2 * math.sin(ground[0])
    rolling = p[C_RR] * _G_MPS2 * math.cos(ground[0])
    step = dt / p[BRAKE_RAMP] if p[BRAKE_RAMP] > dt else 1.0
    state[BRAKE] = min(state[BRAKE] + step, 1.0) if command[STOP] > 0.5 else max(state[BRAKE] - step, 0.0)
    braking = state[BRAKE] * p[BRAKE_FORCE]
    force = 0.0 if command[STOP] > 0.5 else _asked(state, command, p, rolling, pull)
    pushed = min(max(force, -grip), grip)
    resisting = rolling + min(braking, max(grip - abs(pushed), 0.0))
    if abs(speed) < _REST_MPS and abs(pushed + pull) <= resisting:
        state[SPEED] = state[WHEEL] = 0.0
        state[TRACTION] = pushed
        return
    sign = speed if abs(speed) >= _REST_MPS else pushed + pull
    after = speed + dt * (pushed + pull - math.copysign(resisting, sign))
    if speed * after < 0.0 and abs(pushed + pull) <= resisting:
        after = 0.0  # friction stops it, and does not turn it round
    state[SPEED] = after
    state[TRACTION] = pushed - math.copysign(resisting - rolling, sign)
    state[WHEEL] = _wheel(state, command, p, force, grip, dt)


@nb.njit(cache=True, nogil=True)
def _asked(state: FloatArray, command: FloatArray, p: FloatArray, rolling: float, pull: float) -> float:
    """Return the force that the drive asks of the wheels: what brings it to the wanted speed, and makes good for resistance."""
    speed = state[SPEED]
    wanted = min(max(command[PROPEL], -1.0), 1.0) * p[TOP]
    if wanted * speed < 0.0 and abs(speed) > 0.05:
        wanted = 0.0  # the gear changes at rest alone
    rate = (wanted - speed) / p[TAU]
    faster = abs(wanted) > abs(speed)
    most = p[ACCELERATION] if faster else p[SLOWING]
    rate = min(max(rate, -most), most)
    sign = speed if abs(speed) >= _REST_MPS else wanted
    force = rate - pull + (math.copysign(rolling, sign) if sign != 0.0 else 0.0)
    if force * speed > 0.0:
        most = p[POWER] / max(abs(speed), 0.3)
        force = min(max(force, -most), most)
    return force


@nb.njit(cache=True, nogil=True)
def _wheel(state: FloatArray, command: FloatArray, p: FloatArray, force: float, grip: float, dt: float) -> float:
    """Return the speed of the drive line: the ground's with the slip that the force needs; beyond what friction gives it runs away."""
    speed, traction = state[SPEED], state[TRACTION]
    if abs(force) > grip and command[STOP] < 0.5:
        wanted = min(max(command[PROPEL], -1.0), 1.0) * p[TOP]
        return state[WHEEL] + (wanted - state[WHEEL]) * dt / p[TAU]
    share = min(abs(traction) / max(grip, 1e-6), _MOST_SHARE)
    slip = -math.log(1.0 - share * (1.0 - math.exp(-p[SLIP_SLOPE]))) / p[SLIP_SLOPE]
    if traction * speed > 0.0:
        return speed / (1.0 - min(slip, 0.95))
    return speed * (1.0 - min(slip, 0.95))


@nb.njit(cache=True, nogil=True)
def _arm(state: FloatArray, command: FloatArray, p: FloatArray, dt: float) -> None:
    """Move boom and bucket."""
    share = p[BOTH] if command[LIFT] != 0.0 and command[TILT] != 0.0 else 1.0
    share *= 1.0 if command[RPM] > 0.5 else p[IDLE]
    for angle, rate, asked, most, low, high in (
        (BOOM, BOOM_RATE, command[LIFT], p[LIFT_RATE], p[LIFT_LOW], p[LIFT_HIGH]),
        (BUCKET, BUCKET_RATE, command[TILT], p[TILT_RATE], p[TILT_LOW], p[TILT_HIGH]),
    ):
        wanted = min(max(asked, -1.0), 1.0) * most * share
        state[rate] += (wanted - state[rate]) * min(dt / p[ARM_TAU], 1.0)
        moved = state[angle] + dt * state[rate]
        if moved < low or moved > high:
            moved, state[rate] = min(max(moved, low), high), 0.0
        state[angle] = moved
