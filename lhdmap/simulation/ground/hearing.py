"""What a controller hears of the loading machine: noise, and a scan odometry that is late."""

from __future__ import annotations

from collections import deque

import numpy as np

from lhdmap.loading.signals import Signals
from lhdmap.machine import Machine
from lhdmap.simulation.ground.draws import generator
from lhdmap.simulation.ground.pressures import LiftGauge, load_centre
from lhdmap.simulation.ground.records import State
from lhdmap.simulation.ground.rig import tilt_bar
from lhdmap.simulation.ground.sections import Errors
from lhdmap.simulation.vehicle.state import Digging

_PA_PER_BAR = 1e5
_TURNS_MPS = 1e-6


class LateScans:
    """The scan odometry: speed and travel of some time ago, at its own rate, with a walk of the travel."""

    def __init__(self, errors: Errors) -> None:
        self._lag_ns, self._every_ns, self._mps = (
            round(1e9 * errors.scan_lag_s),
            round(1e9 / errors.scan_hz),
            errors.scan_mps,
        )
        self._past: deque[tuple[int, float, float]] = deque()
        self.begin(0)

    def begin(self, now_ns: int) -> None:
        """Forget what was."""
        self._past.clear()
        self._newest = (now_ns, float("nan"), 0.0)
        self._due_ns, self._walk_m = now_ns, 0.0

    def heard(self, now_ns: int, true: tuple[float, float], rng: np.random.Generator) -> tuple[int, float, float]:
        """Take the true speed and travel of now; return stamp, speed and travel of the newest scan that has been heard."""
        self._past.append((now_ns, *true))
        if now_ns >= self._due_ns:
            self._hear(now_ns, rng)
        return self._newest

    def _hear(self, now_ns: int, rng: np.random.Generator) -> None:
        """Take the scan that is due: of the time before its lag."""
        self._due_ns += self._every_ns
        past, seen_ns = self._past, now_ns - self._lag_ns
        if past[0][0] > seen_ns:
            return
        while len(past) > 1 and past[1][0] <= seen_ns:
            past.popleft()
        stamp, speed, travel = past[0]
        error = self._mps * float(rng.standard_normal())
        self._walk_m += error * 1e-9 * self._every_ns
        self._newest = (stamp, speed + error, travel + self._walk_m)


class Hearing:
    """The sensors of one machine; `begin` starts an attempt's noise."""

    def __init__(self, machine: Machine, errors: Errors) -> None:
        self._machine, self._errors = machine, errors
        self._scans = LateScans(errors)
        self._lift, self._swing = LiftGauge(machine, 0), (Digging(), 0.0, 0.0, 0)
        self.begin(0, 0, State(), 0, 0.0)

    def begin(self, seed: int, attempt: int, state: State, now_ns: int, toe_error_m: float) -> None:
        """Forget what was; the noise of an attempt comes from its seed, errors that stay from the load's."""
        self._rng = generator(seed, 4, attempt)
        self._lift = LiftGauge(self._machine, seed)
        self._swing = (Digging(), state.speed_mps, state.boom_rps, now_ns)
        self._scans.begin(now_ns)
        self._offset_m, self._centre = (state.x_m, toe_error_m), load_centre(seed, attempt)

    def signals(self, now_ns: int, state: State, toe_m: float, load_kg: float) -> Signals:
        """Return what is heard of a state at a moment; `toe_m` is the way of the lip to the toe."""
        errors, noise = self._errors, self._rng.standard_normal(7).tolist()
        x0_m, toe_error_m = self._offset_m
        stamp, speed, travel = self._scans.heard(now_ns, (state.speed_mps, state.x_m - x0_m), self._rng)
        lift = self._lift_now(now_ns, state, load_kg)
        return Signals(
            now_ns,
            state.wheel_mps + (errors.tacho_mps * noise[0] if abs(state.wheel_mps) > _TURNS_MPS else 0.0),
            speed,
            stamp,
            travel,
            state.boom_rad + errors.joint_rad * noise[1],
            state.bucket_rad + errors.joint_rad * noise[2],
            errors.joint_rad * noise[3],
            max(abs(state.pressure_pa) / _PA_PER_BAR + errors.pressure_bar * noise[4], 0.0),
            max(lift + errors.lift_bar * noise[5], 0.0),
            max(tilt_bar(self._machine, max(abs(state.tilting), state.at_stop)) + errors.pressure_bar * noise[6], 0.0),
            toe_m + toe_error_m,
            errors.toe_m,
        )

    def _lift_now(self, now_ns: int, state: State, load_kg: float) -> float:
        known, speed, boom, before_ns = self._swing
        if now_ns > before_ns:
            known = self._lift.swung(
                known, state.speed_mps - speed, (boom, state.boom_rps), 1e-9 * (now_ns - before_ns)
            )
            self._swing = (known, state.speed_mps, state.boom_rps, now_ns)
        return self._lift.bar(known, state.boom_rad, load_kg * self._centre, state.lifting)
