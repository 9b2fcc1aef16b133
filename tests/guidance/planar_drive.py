"""A planar drive in closed loop: walls as points, a machine with lags and dead time, guidance each 50 ms. No sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from lhdmap.driving.bodies import bodies_of
from lhdmap.driving.kernel import stepped
from lhdmap.driving.lead import lead_of
from lhdmap.driving.model import drive_model
from lhdmap.driving.motion import Motion, Setpoint, Setpoints
from lhdmap.guidance.directive import Directive, path_of
from lhdmap.guidance.planner import GaussNewton, Guidance, Method, Plan
from lhdmap.guidance.settings import GuidanceSettings
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.simulation.noise_field import Scales, noise_field

MACHINE = Machine()
MODEL, BODIES = drive_model(MACHINE), bodies_of(MACHINE)
PERIOD_NS, STEP_NS = 50_000_000, 10_000_000
EYES_M = {1: 0.8, -1: 3.0}


def bend_line(radius_m: float, turn_deg: float, before_m: float = 22.0, after_m: float = 25.0) -> FloatArray:
    """A centre line (N, 2): straight, arc, straight, each 0.1 m."""
    arc = math.radians(abs(turn_deg)) * radius_m
    s = np.arange(0.0, before_m + arc + after_m, 0.1)
    curvature = math.copysign(1.0 / radius_m, turn_deg) * ((s >= before_m) & (s < before_m + arc))
    ramp = np.convolve(np.pad(curvature, 20, mode="edge"), np.ones(41) / 41.0, mode="valid")  # 4 m of clothoid
    heading = np.concatenate([[0.0], np.cumsum(0.1 * ramp[:-1])])
    return np.column_stack([np.cumsum(0.1 * np.cos(heading)), np.cumsum(0.1 * np.sin(heading))])


def walls_of(line: FloatArray, half_left: FloatArray, half_right: FloatArray) -> FloatArray:
    """Points (M, 2) of both walls and of both closed ends."""
    way = np.gradient(line, axis=0)
    way /= np.linalg.norm(way, axis=1)[:, None]
    normal = np.column_stack([-way[:, 1], way[:, 0]])
    return np.vstack([line + half_left[:, None] * normal, line - half_right[:, None] * normal])


def swept_half_widths(line: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How far (N,) the bodies reach to the left and right of a line that the front axle follows."""
    lead = lead_of(1, MODEL, BODIES)
    heading = np.unwrap(np.arctan2(np.gradient(line[:, 1]), np.gradient(line[:, 0])))
    bend = np.zeros(len(line))
    for k in range(len(line) - 1):
        curvature = (heading[k + 1] - heading[k]) / 0.1
        bend[k + 1] = (
            bend[k]
            + 0.1 * (curvature * (lead.lead_m * math.cos(bend[k]) + lead.trail_m) - math.sin(bend[k])) / lead.trail_m
        )
    left, right = np.full(len(line), 1.225), np.full(len(line), 1.225)
    for k in range(0, len(line), 2):
        outlines = placed(np.array([*line[k], heading[k], bend[k]]))
        apart = np.linalg.norm(outlines[:, None] - line[None, ::5], axis=2).argmin(axis=1) * 5
        normal = np.column_stack([-np.sin(heading[apart]), np.cos(heading[apart])])
        off = ((outlines - line[apart]) * normal).sum(axis=1)
        np.maximum.at(left, apart, off)
        np.maximum.at(right, apart, -off)
    spread = np.ones(31)
    return (
        np.array([left[max(k - 15, 0) : k + 16].max() for k in range(len(left))]),
        np.array([right[max(k - 15, 0) : k + 16].max() for k in range(len(right))]) * spread[0],
    )


def placed(state: FloatArray) -> FloatArray:
    """Outline points (N, 2) of both bodies of a front axle's state (x, y, heading, bend)."""
    x, y, heading, bend = state.tolist()
    back = heading - bend
    c, s = math.cos(heading), math.sin(heading)
    front = np.array([x, y]) + BODIES.front_m @ np.array([[c, s], [-s, c]])
    rx = x - MODEL.front_m * c - MODEL.rear_m * math.cos(back)
    ry = y - MODEL.front_m * s - MODEL.rear_m * math.sin(back)
    c, s = math.cos(back), math.sin(back)
    return np.vstack([front, np.array([rx, ry]) + BODIES.rear_m @ np.array([[c, s], [-s, c]])])


def narrow(
    radius_m: float, turn_deg: float, c_m: float, seed: int = 0, rms_m: float = 0.05
) -> tuple[FloatArray, FloatArray]:
    """A centre line and walls with `c_m` of least room beside the swept bodies, rough outward."""
    line = bend_line(radius_m, turn_deg)
    left, right = swept_half_widths(line)
    fields = [
        noise_field(np.random.default_rng([seed, k]), Scales(4, 8.0, 0.6), (0.0, 200.0), (0.0, 1.0)) for k in range(2)
    ]
    at = np.arange(len(line), dtype=np.float64) * 0.1
    rough = []
    for one in fields:
        one.normalise(at, np.zeros(1), rms_m)
        rough.append(one.grid(at, np.zeros(1))[:, 0])
    return line, walls_of(line, left + c_m + rough[0] - rough[0].min(), right + c_m + rough[1] - rough[1].min())


@dataclass
class Drive:
    """What came of a drive."""

    clearances_m: list[float] = field(default_factory=list)
    speeds_mps: list[float] = field(default_factory=list)
    states: list[FloatArray] = field(default_factory=list)
    plans: list[Plan] = field(default_factory=list)
    commands: list[Setpoint] = field(default_factory=list)
    arrived: bool = False


def drive(
    line: FloatArray,
    walls: FloatArray,
    gear: int = 1,
    *,
    limit_mps: float = 2.8,
    settings: GuidanceSettings | None = None,
    method: Method | None = None,
    seconds: float = 90.0,
    gain: float = 1.0,
) -> Drive:
    """Drive a line from its start to its end."""
    used = settings or GuidanceSettings()
    guidance = Guidance(MODEL, BODIES, EYES_M, used, method or GaussNewton(used))
    start = 12.0
    path = path_of(line, limit_mps)
    heading = path[0, 2]
    state = np.array([line[0, 0] + start, line[0, 1], heading + (math.pi if gear < 0 else 0.0), 0.0, 0.0])
    directive = Directive(0, gear, path, float(path[-1, 5]) - 5.0)
    speed, now, out = 0.0, 0, Drive()
    queue: Setpoints = ()
    sent: list[Setpoint] = [Setpoint(-1_000_000_000, 0.0, 0.0)]
    while now < seconds * 1e9 and not out.arrived:
        if now % PERIOD_NS == 0:
            motion = _motion(now, state, speed)
            near = walls[np.hypot(*(walls - state[:2]).T) < 25.0]
            plan = guidance.plan(now, motion, sent[-60:], near, directive)
            queue = plan.setpoints
            out.plans.append(plan)
        wanted = _at(queue, now, used)
        if now % 20_000_000 == 0:
            sent.append(wanted)
        dead = now - round(MODEL.dead_time_s * 1e9)
        force = next((one for one in reversed(sent) if one.at_ns <= dead), sent[0])
        change = (force.speed_mps - speed) * -math.expm1(-0.01 / MODEL.drive_lag_s)
        speed += min(max(change, -0.015), 0.01)
        after = stepped(
            tuple(state.tolist()), speed, gain * force.steering_rate_rps, 0.01, MODEL.front_m, MODEL.rear_m, 0.2
        )
        state = np.array(after)
        now += STEP_NS
        if now % 100_000_000 == 0:
            outline = placed(state[:4])
            near = walls[np.hypot(*(walls - state[:2]).T) < 12.0]
            out.clearances_m.append(float(np.linalg.norm(outline[:, None] - near[None], axis=2).min()))
            out.speeds_mps.append(speed)
            out.states.append(state.copy())
            at = guidance._leads[gear].state(_motion(now, state, speed))
            left = directive.stop_m - path[np.hypot(path[:, 0] - at[0], path[:, 1] - at[1]).argmin(), 5]
            out.arrived = left < 0.3 and abs(speed) < 0.05
    out.commands = sent
    return out


def _motion(now: int, state: FloatArray, speed: float) -> Motion:
    x, y, heading, bend, rate = state.tolist()
    return Motion(now, x, y, heading, bend, rate, speed)


def _at(queue: Setpoints, now: int, settings: GuidanceSettings) -> Setpoint:
    times = np.array([one.at_ns for one in queue], dtype=float)
    speeds, rates = np.array([one.speed_mps for one in queue]), np.array([one.steering_rate_rps for one in queue])
    speed = float(np.interp(now, times, speeds))
    later = float(np.interp(now + 1e8, times, speeds))
    return Setpoint(now, speed + MODEL.drive_lag_s * (later - speed) / 0.1, float(np.interp(now, times, rates)))
