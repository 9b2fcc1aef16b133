"""What a controller hears of the loading machine: noise, and a scan odometry that is late."""

from __future__ import annotations

from collections import deque

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


class Hearing:
    """The sensors of one machine; `begin` starts an attempt's noise."""

    def __init__(self, machine: Machine, errors: Errors) -> None:
        self._machine, self._errors = machine, errors
        self._lag_ns, self._every_ns = round(1e9 * errors.scan_lag_s), round(1e9 / errors.scan_hz)
        self._past: deque[tuple[int, float, float]] = deque()
        self._lift, self._swing = LiftGauge(machine, 0), (Digging(), 0.0, 0.0, 0)
        self.begin(0, 0, State(), 0, 0.0)

    def begin(self, seed: int, attempt: int, state: State, now_ns: int, toe_error_m: float) -> None:
        """Forget what was; the noise of an attempt comes from its seed, errors that stay from the load's."""
        self._rng = generator(seed, 4, attempt)
        self._lift = LiftGauge(self._machine, seed)
        self._swing = (Digging(), state.speed_mps, state.boom_rps, now_ns)
        self._past.clear()
        self._scan = (now_ns, float("nan"), 0.0)
        self._due_ns, self._walk_m = now_ns, 0.0
        self._offset_m, self._centre = (state.x_m, toe_error_m), load_centre(seed, attempt)

    def signals(self, now_ns: int, state: State, toe_m: float, load_kg: float) -> Signals:
        """Return what is heard of a state at a moment; `toe_m` is the way of the lip to the toe."""
        errors, noise = self._errors, self._rng.standard_normal(7).tolist()
        x0_m, toe_error_m = self._offset_m
        self._past.append((now_ns, state.speed_mps, state.x_m - x0_m))
        if now_ns >= self._due_ns:
            self._hear_scan(now_ns)
        stamp, speed, travel = self._scan
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

    def _hear_scan(self, now_ns: int) -> None:
        """Take the scan that is due: of the time before its lag."""
        self._due_ns += self._every_ns
        past, seen_ns = self._past, now_ns - self._lag_ns
        if past[0][0] > seen_ns:
            return
        while len(past) > 1 and past[1][0] <= seen_ns:
            past.popleft()
        stamp, speed, travel = past[0]
        error = self._errors.scan_mps * float(self._rng.standard_normal())
        self._walk_m += error * 1e-9 * self._every_ns
        self._scan = (stamp, speed + error, travel + self._walk_m)
