"""The digging machine in one vertical plane: sub-steps of hydraulics, rock on the bucket, axle loads, tyres, motion."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb

from lhdmap.messages import FloatArray
from lhdmap.simulation.ground.earth import breaking, earth_force, penetration, plate_rake
from lhdmap.simulation.ground.face import cut, height_at, slide, spill
from lhdmap.simulation.ground.hydraulics import cylinders, engine, transmission
from lhdmap.simulation.ground.linkage import floor_angle, lip, lip_rates
from lhdmap.simulation.ground.records import Record

GRAVITY_MPS2 = 9.81
NOISE_STEP_M = 0.02
SLIPS = 0.5  # slip ratio from which on the wheels count as slipping
_STANDS_M = 1e-4  # a face steeper by less than this over a cell stands
_COVER_M = 0.8  # depth from which on the rock holds the lip with all its strength
_BACKWARDS = 0.15  # of the resistance, out of the pile
_RESTING = 0.8  # of the rock's reaction, on a bucket that is held
_RELAXING_S = 0.2  # how fast the reaction comes and goes
_SLOW_MPS = 0.2
_STANDS_MPS = 0.02
_AHEAD_M = 0.10  # where the depth over the lip is taken
_LOAD_BACK_M = 0.9  # the content's middle behind the lip


class World(NamedTuple):
    """What the bucket meets.

    Heights (N,) of the pile's cells, m; table (15, 3) of `earth.bearing_table`; noise (M,) of the resistance over the lip's way
    in rock, each 2 cm; strikes (K, 3) of boulders: way, length, force; bumps (J, 3) of the floor: x, length, force per press
    force.
    """

    heights: FloatArray
    table: FloatArray
    noise: FloatArray
    strikes: FloatArray
    bumps: FloatArray


@nb.njit(cache=True, nogil=True)
def advance(
    state: Record, rig: Record, rock: Record, world: World,
    pedals: FloatArray, steps: int, step_s: float,
) -> None:  # fmt: skip
    """Move a machine on by `steps` sub-steps; `state` and the heights in `world` are changed.

    `pedals`: propel, tilt, lift, full_rpm, brake.
    """
    one, machine, stone = state[0], rig[0], rock[0]
    for _ in range(steps):
        _sub_step(one, machine, stone, world, pedals, step_s)


@nb.njit(cache=True, nogil=True)
def _sub_step(
    state: Record, rig: Record, rock: Record, world: World,
    pedals: FloatArray, step_s: float,
) -> None:  # fmt: skip
    heights = world.heights
    engine(state, rig, pedals[0], pedals[3] > 0.5, step_s)
    cylinders(state, rig, pedals[1], pedals[2], step_s)
    moved, rise = _move_lip(state, rig)
    cover = _touch(state, rock, heights, moved, rise, step_s)
    _rock_forces(state, rig, rock, world, cover, pedals, step_s)
    _axles(state, rig, rock)
    drive = transmission(state, rig, step_s)
    _roll(state, rig, drive, pedals[4] > 0.5, step_s)
    before = state.lip_x_m
    state.x_m += state.speed_mps * step_s
    state.lip_x_m += state.speed_mps * step_s
    if state.lip_x_m > state.begun_m:
        cut(state, rig, rock, heights, max(before - moved, state.begun_m), state.lip_x_m)
        state.begun_m = state.lip_x_m
    in_pile = state.embed_m > 0.0 or height_at(heights, rock, state.lip_x_m + rock.step_m) > state.lip_z_m + 0.02
    spill(state, rig, rock, heights, step_s)
    if state.busy > 0.0:
        worst = slide(state, rig, rock, heights, -math.expm1(-step_s * rock.slide_per_s), in_pile)
        state.busy = 1.0 if worst > _STANDS_M or in_pile else 0.0
    if state.speed_mps < 0.0:
        state.begun_m = min(state.begun_m, state.lip_x_m)


@nb.njit(cache=True, nogil=True)
def _move_lip(state: Record, rig: Record) -> tuple[float, float]:
    """Put the lip where boom and bucket hold it; returns how far they moved it along x, and the speed at which it rises."""
    x, z = lip(rig, state.boom_rad, state.bucket_rad)
    _, rise = lip_rates(rig, state.boom_rad, state.bucket_rad, state.boom_rps, state.bucket_rps)
    moved = state.x_m + x - state.lip_x_m
    state.lip_x_m, state.lip_z_m = state.x_m + x, z
    return moved, rise


@nb.njit(cache=True, nogil=True)
def _touch(state: Record, rock: Record, heights: FloatArray, moved_m: float, rise_mps: float, step_s: float) -> float:
    """Move on how deep the lip sits in rock, and return how well it is covered, 0 to 1: a rising lip loosens the rock."""
    depth = height_at(heights, rock, state.lip_x_m + _AHEAD_M) - max(state.lip_z_m, 0.0)
    if depth <= 0.02:
        state.embed_m = 0.0
        return 0.0
    way = state.speed_mps * step_s + moved_m
    loosened = rock.loosening * state.embed_m * max(rise_mps, 0.0) * step_s
    state.embed_m = max(state.embed_m + way - loosened, 0.0)
    state.way_m += max(way, 0.0)
    return min(depth / _COVER_M, 1.0)


@nb.njit(cache=True, nogil=True)
def _rock_forces(
    state: Record, rig: Record, rock: Record,
    world: World, cover: float,
    pedals: FloatArray, step_s: float,
) -> None:  # fmt: skip
    """Set what rock and floor do to the bucket: along the drive, against a lip that rises, against one that is pressed down."""
    heights, noise, strikes, bumps = world.heights, world.noise, world.strikes, world.bumps
    psi = floor_angle(rig, state.boom_rad, state.bucket_rad)
    state.press_n = rig.floor_stiffness * max(-state.lip_z_m, 0.0)
    state.resist_n = 0.4 * state.press_n
    for k in range(len(bumps)):
        share = (state.lip_x_m - bumps[k, 0]) / bumps[k, 1]
        if 0.0 < share < 1.0:
            state.resist_n += bumps[k, 2] * state.press_n * math.sin(math.pi * share)
    state.up_n, state.rock_n = 0.0, 0.0
    if cover > 0.0:
        depth = height_at(heights, rock, state.lip_x_m + _AHEAD_M) - max(state.lip_z_m, 0.0)
        load = state.content_m3 * rock.density / rock.swell * GRAVITY_MPS2
        earth = earth_force(rock, rig, world.table, psi, max(depth, 0.0), load)
        i = min(int(state.way_m / NOISE_STEP_M), len(noise) - 1)
        state.rock_n = penetration(rock, rig, state.embed_m, psi, cover) * noise[i] + earth
        for k in range(len(strikes)):
            if 0.0 <= state.way_m - strikes[k, 0] < strikes[k, 1]:
                state.rock_n += strikes[k, 2]
        state.resist_n += state.rock_n
        upward = max(math.cos(plate_rake(psi) + rock.external_rad), 0.0)
        state.up_n = breaking(rock, rig, state.embed_m, cover) + upward * earth
    held = 1.0 if pedals[1] > 0.0 or pedals[2] > 0.0 else _RESTING
    state.down_n += (held * state.up_n - state.down_n) * step_s / (step_s + _RELAXING_S)
    state.tilting = (state.down_n - state.press_n) / rig.tilt_force_n
    state.lifting = (state.down_n - state.press_n) / rig.lift_force_n


@nb.njit(cache=True, nogil=True)
def _axles(state: Record, rig: Record, rock: Record) -> None:
    """Set the axle loads by statics: weight, content, and what the lip meets from above or below."""
    base, reach = rig.wheelbase_m, state.lip_x_m - state.x_m
    load = state.content_m3 * rock.density / rock.swell * GRAVITY_MPS2
    weight = rig.mass_kg * GRAVITY_MPS2
    vertical = min(max(state.tilting, -1.0), 1.0) * rig.tilt_force_n
    front = (
        weight * (base - rig.gravity_centre_m) + load * (base + reach - _LOAD_BACK_M) + vertical * (base + reach)
    ) / base
    rear = weight + load + vertical - front
    state.front_n, state.rear_n = max(front, 0.0), max(rear, 0.0)
    state.grip_n = rock.friction * (state.front_n + state.rear_n)


@nb.njit(cache=True, nogil=True)
def _roll(state: Record, rig: Record, drive_n: float, brake: bool, step_s: float) -> None:
    """Move speeds of ground and wheels on: tyres implicit in both, what resists a Coulomb force that can hold the machine."""
    weight = state.front_n + state.rear_n
    change = (1.0 if brake else 0.0) - state.brake
    most = step_s / rig.brake_ramp_s
    state.brake += min(max(change, -most), most)
    speed, wheel = state.speed_mps, state.wheel_mps
    ahead, fastest = wheel - speed, max(abs(wheel), abs(speed), _SLOW_MPS)
    fading = math.exp(-rig.slip_stiffness * abs(ahead) / fastest)
    force = math.copysign(state.grip_n * (1.0 - fading), ahead)
    slope = state.grip_n * rig.slip_stiffness * fading / fastest
    wheels = rig.inertia_kgm2 / rig.wheel_radius_m**2
    a, b = step_s / wheels, step_s / rig.mass_kg
    held = rig.loss_pa * rig.displacement_m3 / rig.wheel_radius_m + state.brake * rig.brake_n
    free = wheel + a * (drive_n - force)
    push = drive_n - math.copysign(min(held, abs(free) / a), free)
    rolling, pull = rig.rolling * weight, state.pull_n
    way = 1.0 if speed + b * (force + pull) > 0.0 else -1.0
    resist = rolling + (state.resist_n if way > 0.0 else _BACKWARDS * state.resist_n)
    total = (force + slope * (a * push + b * (way * resist - pull))) / (1.0 + slope * (a + b))
    total = min(max(total, -state.grip_n), state.grip_n)
    after = speed + b * (total + pull - way * resist)
    if after * way <= 0.0:
        total = (force + slope * (a * push + speed)) / (1.0 + slope * a)
        total = min(max(total, -state.grip_n), state.grip_n)
        after = 0.0
    turning = wheel + a * (push - total)
    if (
        state.brake > 0.99
        and abs(turning) < _STANDS_MPS
        and abs(after) < _STANDS_MPS
        and abs(pull) < 0.9 * state.grip_n
    ):
        after, turning, total = 0.0, 0.0, -pull  # locked tyres hold without creeping
    state.speed_mps, state.wheel_mps = after, turning
    state.traction_n = total
    if abs(state.wheel_mps - after) > SLIPS * max(abs(state.wheel_mps), abs(after), _SLOW_MPS):
        state.slip_s += step_s
    if state.rear_n <= 0.0:
        state.rear_up_s += step_s
