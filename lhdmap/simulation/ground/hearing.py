"""What a controller hears of the loading machine: noise, and a scan odometry that is late."""

from __future__ import annotations

from collections import deque

from lhdmap.loading.signals import Signals
from lhdmap.machine import Machine
from lhdmap.simulation.ground.draws import generator
from lhdmap.simulation.ground.records import State
from lhdmap.simulation.ground.rig import lift_bar, tilt_bar
from lhdmap.simulation.ground.sections import Errors
from lhdmap.simulation.ground.truth import Truth

_PA_PER_BAR = 1e5
_KEPT = 600


class Hearing:
    """The sensors of one machine; `begin` starts an attempt's noise."""

    def __init__(self, machine: Machine, errors: Errors) -> None:
        self._machine, self._errors = machine, errors
        self._past: deque[tuple[int, float, float]] = deque(maxlen=_KEPT)
        self._rng, self._toe_error_m = generator(0), 0.0
        self._scan = (0, float("nan"), 0.0)
        self._due_ns, self._walk_m, self._begun_m = 0, 0.0, float("nan")

    def begin(self, seed: int, attempt: int, toe_error_m: float) -> None:
        """Forget what was; the noise of an attempt comes from its seed."""
        self._rng, self._toe_error_m = generator(seed, 4, attempt), toe_error_m
        self._past.clear()
        self._scan = (0, float("nan"), 0.0)
        self._due_ns, self._walk_m, self._begun_m = -1, 0.0, float("nan")

    def signals(self, now_ns: int, state: State, truth: Truth) -> Signals:
        """Return what is heard of a state at a moment."""
        errors, noise = self._errors, self._rng.standard_normal(8).tolist()
        if self._begun_m != self._begun_m:
            self._begun_m, self._due_ns = state.x_m, now_ns
        self._past.append((now_ns, truth.speed_mps, state.x_m - self._begun_m))
        self._hear_scan(now_ns)
        stamp, speed, travel = self._scan
        moving = abs(truth.wheel_mps) > 1e-6
        load_kg = truth.fill * self._machine.drive.payload_kg
        boom, bucket = state.boom_rad, state.bucket_rad
        lift = lift_bar(self._machine, boom, load_kg, state.lifting * 1e3 * self._machine.digging.lift_force_kn)
        return Signals(
            now_ns=now_ns,
            tacho_mps=truth.wheel_mps + (errors.tacho_mps * noise[0] if moving else 0.0),
            scan_mps=speed,
            scan_ns=stamp,
            travel_m=travel,
            boom_rad=boom + errors.joint_rad * noise[1],
            bucket_rad=bucket + errors.joint_rad * noise[2],
            articulation_rad=errors.joint_rad * noise[3],
            transmission_bar=max(abs(state.pressure_pa) / _PA_PER_BAR + errors.pressure_bar * noise[4], 0.0),
            lift_bar=max(lift + errors.lift_bar * noise[5], 0.0),
            tilt_bar=max(tilt_bar(self._machine, state.tilting) + errors.pressure_bar * noise[6], 0.0),
            toe_m=truth.toe_m + self._toe_error_m,
            toe_std_m=errors.toe_m,
        )

    def _hear_scan(self, now_ns: int) -> None:
        """Take the newest scan where one is due: of the time before its lag."""
        if now_ns < self._due_ns:
            return
        self._due_ns += round(1e9 / self._errors.scan_hz)
        seen_ns = now_ns - round(1e9 * self._errors.scan_lag_s)
        old = [one for one in self._past if one[0] <= seen_ns]
        if not old:
            return
        stamp, speed, travel = old[-1]
        error = self._errors.scan_mps * float(self._rng.standard_normal())
        self._walk_m += error / self._errors.scan_hz
        self._scan = (stamp, speed + error, travel + self._walk_m)
