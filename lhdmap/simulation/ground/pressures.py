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


class LiftGauge:
    """The lift cylinder's pressure: the machine rocks on its tyres, and some errors stay; `seed` gives them."""

    def __init__(self, machine: Machine, seed: int) -> None:
        self._machine = machine
        rng = generator(seed, 8)
        self._omega = 2.0 * math.pi * rng.uniform(*_ROCK_HZ)
        self._damping = rng.uniform(*_DAMPING)
        self._zero_bar = _ZERO_BAR * float(rng.standard_normal())

    def swung(self, known: Digging, speed_mps: float, boom_rps: tuple[float, float], dt_s: float) -> Digging:
        """Return the swing a step later: a damped oscillator that accelerations drive, symplectic.

        `speed_mps` is by how much the speed has changed, `boom_rps` the boom's rate before and now.
        """
        pushed = _PER_MPS2 * speed_mps / dt_s + _PER_RPS2 * (boom_rps[1] - boom_rps[0]) / dt_s
        rate = known.rocking_rate - dt_s * self._omega * self._omega * (known.rocking + pushed)
        rate /= 1.0 + 2.0 * self._damping * self._omega * dt_s
        lifted = math.copysign(1.0, boom_rps[1]) if abs(boom_rps[1]) > _MOVES_RPS else known.lifted
        return known._replace(rocking=known.rocking + dt_s * rate, rocking_rate=rate, lifted=lifted)

    def bar(self, known: Digging, boom_rad: float, load_kg: float, lifting: float) -> float:
        """Return the pressure; `lifting` is the share of the cylinder's force that the lip meets.

        Eq. (9) is calibrated with a boom that came from below: its friction shows where it came from above.
        """
        vertical = lifting * 1e3 * self._machine.digging.lift_force_kn
        steady = lift_bar(self._machine, boom_rad, load_kg, vertical)
        return max(steady * (1.0 + known.rocking) + self._zero_bar + _FRICTION_BAR * (known.lifted - 1.0), 0.1)


def load_centre(seed: int, session: int) -> float:
    """Return the factor on the load's torque in an attempt: where its middle lies."""
    return 1.0 + _CENTRE * float(generator(seed, 9, session).standard_normal())


class Gauges:
    """What the pressures of a loading machine are; `seed` gives its errors, which stay."""

    def __init__(self, machine: Machine, seed: int) -> None:
        self._machine, self._seed = machine, seed
        self._lift = LiftGauge(machine, seed)
        self._centre = (0, load_centre(seed, 0))

    def read(self, before: VehicleState, state: VehicleState, dt_s: float) -> VehicleState:
        """Return `state` with its pressures; it has come from `before` in `dt_s`."""
        booms = (before.boom_rate_rps, state.boom_rate_rps)
        known = self._lift.swung(state.digging or Digging(), state.speed_mps - before.speed_mps, booms, dt_s)
        bucket = None if known.bucket is None else State._make(known.bucket)
        if self._centre[0] != known.session:
            self._centre = (known.session, load_centre(self._seed, known.session))
        lifting = 0.0 if bucket is None else bucket.lifting
        return state._replace(
            transmission_bar=self._transmission(state, bucket),
            lift_bar=self._lift.bar(known, state.boom_rad, state.load_kg * self._centre[1], lifting),
            tilt_bar=tilt_bar(self._machine, state.curl),
            digging=known,
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
