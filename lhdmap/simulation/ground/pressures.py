"""The pressures that a loading machine's sensors see: transmission, lift with the machine's rocking, tilt."""

from __future__ import annotations

import math

from lhdmap.machine import Machine
from lhdmap.simulation.ground.draws import generator
from lhdmap.simulation.ground.records import State
from lhdmap.simulation.ground.rig import lift_bar, tilt_bar
from lhdmap.simulation.vehicle.state import Digging, VehicleState

_BAR_PA = 1e5
_CHARGE_BAR = 20.0  # of the transmission without load: its feed pump
_ROCK_HZ, _DAMPING = (1.0, 2.0), (0.04, 0.10)  # loading prototype, section 8: tyres carry the machine
_PER_MPS2, _PER_RPS2 = 0.04, 0.15  # share of the lift pressure for accelerations of machine and boom
_ZERO_BAR, _FRICTION_BAR, _CENTRE = (
    0.6,
    1.2,
    0.025,
)  # the same section: drift of zero, cylinder's friction, centre of the load
_MOVES_RPS = 0.005


class Gauges:
    """What the pressures of a machine are; `seed` gives its errors, which stay."""

    def __init__(self, machine: Machine, seed: int) -> None:
        self._machine = machine
        rng = generator(seed, 8)
        self._omega = 2.0 * math.pi * rng.uniform(*_ROCK_HZ)
        self._damping = rng.uniform(*_DAMPING)
        self._zero_bar = _ZERO_BAR * float(rng.standard_normal())
        self._seed, self._centre = seed, (0, 0.0)

    def read(self, before: VehicleState, state: VehicleState, dt_s: float) -> VehicleState:
        """Return `state` with its pressures; it has come from `before` in `dt_s`."""
        digging = self._rocked(before, state, dt_s)
        bucket = None if digging.bucket is None else State._make(digging.bucket)
        vertical = 0.0 if bucket is None else bucket.lifting * 1e3 * self._machine.digging.lift_force_kn
        centre = 1.0 + _CENTRE * self._of_load(digging.session)
        lift = lift_bar(self._machine, state.boom_rad, state.load_kg * centre, vertical)
        lift = lift * (1.0 + digging.rocking) + self._zero_bar + _FRICTION_BAR * digging.lifted
        return state._replace(
            transmission_bar=self._transmission(state, bucket),
            lift_bar=max(lift, 0.1),
            tilt_bar=tilt_bar(self._machine, state.curl),
            digging=digging,
        )

    def _transmission(self, state: VehicleState, bucket: State | None) -> float:
        drive, digging = self._machine.drive, self._machine.digging
        if bucket is not None:
            return max(abs(bucket.pressure_pa) / _BAR_PA, _CHARGE_BAR)
        force = state.traction_mps2 * (drive.mass_kg + state.load_kg)
        along = abs(force) if state.speed_mps == 0.0 else max(math.copysign(force, force * state.speed_mps), 0.0)
        per_bar = digging.displacement_l * 1e-3 / self._machine.dimensions.wheel_radius_m * _BAR_PA
        lost = digging.loss_bar if state.wheel_speed_mps != 0.0 else 0.0
        return min(max(along / per_bar + lost, _CHARGE_BAR), digging.relief_bar)

    def _rocked(self, before: VehicleState, state: VehicleState, dt_s: float) -> Digging:
        """Return the swing of the lift pressure a step later: a damped oscillator that accelerations drive, symplectic."""
        digging = state.digging or Digging()
        pushed = _PER_MPS2 * (state.speed_mps - before.speed_mps) / dt_s
        pushed += _PER_RPS2 * (state.boom_rate_rps - before.boom_rate_rps) / dt_s
        swing, rate, omega = digging.rocking, digging.rocking_rate, self._omega
        rate = (rate - dt_s * omega * omega * (swing + pushed)) / (1.0 + 2.0 * self._damping * omega * dt_s)
        moving = abs(state.boom_rate_rps) > _MOVES_RPS
        lifted = math.copysign(1.0, state.boom_rate_rps) if moving else digging.lifted
        return digging._replace(rocking=swing + dt_s * rate, rocking_rate=rate, lifted=lifted)

    def _of_load(self, session: int) -> float:
        """Return the error of the load's centre after an attempt, in its standard deviations."""
        if self._centre[0] != session:
            self._centre = (session, float(generator(self._seed, 9, session).standard_normal()))
        return self._centre[1]
