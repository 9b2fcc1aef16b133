"""The stepped machine that digs: trams as `Vehicle`, and with its bucket lowered, or in a pile, it is the side view's machine.

    piles = mine_piles(world, load_ground("default"), seed=1)      # lhdmap.simulation.ground.mine
    vehicle = LoadingVehicle(machine, world, piles, seed=1)
    state = vehicle.at_rest(x, y, yaw, near_z_m=z, time_ns=START_NS)
    state = vehicle.step(state, command, 0.01)

The machine has no state of its own, but piles change (`Piles`): a state that is stepped again meets them as they are now.
"""

from __future__ import annotations

import math

import numpy as np

from lhdmap.machine import Machine
from lhdmap.messages import Command, FloatArray
from lhdmap.simulation.ground.draws import CELL_M, draw_load, generator
from lhdmap.simulation.ground.face import take_boulder
from lhdmap.simulation.ground.kernel import GRAVITY_MPS2, World, advance
from lhdmap.simulation.ground.linkage import lip
from lhdmap.simulation.ground.loader import BOULDER_WAY_M
from lhdmap.simulation.ground.piles import Cut, Piles
from lhdmap.simulation.ground.pressures import Gauges
from lhdmap.simulation.ground.records import Record, State, record, state_of
from lhdmap.simulation.ground.rig import rig_of
from lhdmap.simulation.ground.sections import Grounds
from lhdmap.simulation.surroundings import Ground
from lhdmap.simulation.vehicle import kernel
from lhdmap.simulation.vehicle.plant import drawn_errors, plant_of
from lhdmap.simulation.vehicle.state import Digging, VehicleState, state_of_row
from lhdmap.simulation.vehicle.vehicle import ROW, SUB_STEP_S, Vehicle, in_force, queued, within

_SIDE_STEP_S = 0.002
_LOWERED_RAD, _RACKED_RAD = 0.15, 0.05  # from the upper stop: lowered from the first on, until the second


class LoadingVehicle:
    """A drop-in for `Vehicle` that digs in piles, weighs and dumps; `seed` decides how far it is from its file.

    Without `piles` it lowers, dumps and weighs all the same.
    """

    def __init__(self, machine: Machine, ground: Ground, piles: Piles | None = None, *, seed: int = 0) -> None:
        self.machine, self.piles = machine, piles or Piles({}, Grounds(), seed=seed)
        self._ground, self._tramming = ground, Vehicle(machine, ground, seed=seed)
        self._errors = drawn_errors(machine.spread, seed)
        hydraulic, filling = self.piles.ground.hydraulic, self.piles.ground.filling
        spread = float(generator(seed, 7).standard_normal())
        self._rig = rig_of(machine, hydraulic.tilt_factor * max(1.0 + hydraulic.tilt_spread * spread, 0.4))
        self._kg_m3 = 1e3 * self.piles.ground.rock.density_t_m3 / filling.swell
        self._gauges = Gauges(machine, seed)
        self._loose, self._nothing = _loose_rock(self.piles.ground), _no_pile()

    def at_rest(
        self,
        x_m: float,
        y_m: float,
        yaw_rad: float,
        *,
        near_z_m: float,
        articulation_rad: float = 0.0,
        load_kg: float = 0.0,
        time_ns: int,
    ) -> VehicleState:
        """Return the machine standing at a place, as `Vehicle.at_rest`."""
        state = self._tramming.at_rest(
            x_m, y_m, yaw_rad, near_z_m=near_z_m, articulation_rad=articulation_rad, load_kg=load_kg, time_ns=time_ns
        )
        return self._gauges.read(state, state, 0.01)

    def step(self, state: VehicleState, command: Command, dt_s: float) -> VehicleState:
        """Return the state after `dt_s` with a command given now.

        Tramming, it counts after its dead time; digging at once but for steering: engine, pump and valves have their lags.
        """
        lowered = self._lowered(state)
        cut = self.piles.follow(state.time_ns, self._lip_m(state), state.yaw_rad, state.load_kg, lowered=lowered)
        after = self._dig(state, command, dt_s, cut) if cut is not None or lowered else self._tram(state, command, dt_s)
        return self._gauges.read(state, after, dt_s)

    def _tram(self, state: VehicleState, command: Command, dt_s: float) -> VehicleState:
        digging = (state.digging or Digging())._replace(bucket=None)
        return self._tramming.step(state, command, dt_s)._replace(digging=digging)

    def _lowered(self, state: VehicleState) -> bool:
        """Return whether the bucket is out of tramming posture, with hysteresis."""
        digs = state.digging is not None and state.digging.bucket is not None
        return state.bucket_rad < self.machine.linkage.bucket_max_rad - (_RACKED_RAD if digs else _LOWERED_RAD)

    def _lip_m(self, state: VehicleState) -> FloatArray:
        ahead, _ = lip(self._rig[0], state.boom_rad, state.bucket_rad)
        return np.array([state.x_m + ahead * math.cos(state.yaw_rad), state.y_m + ahead * math.sin(state.yaw_rad)])

    def _dig(self, state: VehicleState, command: Command, dt_s: float, cut: Cut | None) -> VehicleState:
        end_ns = state.time_ns + round(dt_s * 1e9)
        dead_ns = round(self.machine.drive.dead_time_s * 1e9)
        pending = queued(state.pending, state.time_ns, state.time_ns + dead_ns, command)
        commands, _ = in_force(pending, state.time_ns, end_ns)
        side, rock = self._side(state, cut), self._loose if cut is None else cut.rock
        rock["friction"] = self._ground.friction(np.array(state[1:4]))
        propel, _, tilt, lift, full_rpm, brake = within(command)
        pedals = np.array([propel, tilt, lift, full_rpm, brake])
        world = self._nothing if cut is None else cut.world
        steps = max(1, round(dt_s / _SIDE_STEP_S))
        advance(side, self._rig, rock, world, pedals, steps, dt_s / steps)
        if cut is None:
            self._nothing.heights[:] = 0.0  # what fell is gone: over a dump, or too little to drive over
        elif cut.chance.boulder_m3 > 0.0 and side["way_m"][0] > BOULDER_WAY_M:
            take_boulder(side[0], self._rig[0], rock[0], world.heights, cut.chance.boulder_m3)
            cut.chance = cut.chance._replace(boulder_m3=0.0)
        return self._carried(state, state_of(side), pending, float(commands[-1][kernel.STEERING]), dt_s)

    def _side(self, state: VehicleState, cut: Cut | None) -> Record:
        """Return the record of the side view: what the state says, and what the last step left of the rest."""
        known, number = state.digging, 0 if cut is None else cut.number
        before = None if known is None or known.bucket is None else State._make(known.bucket)
        one = self._lowering(state) if before is None else before
        if before is None or known is None or known.session != number:
            one = one._replace(embed_m=0.0, way_m=0.0, begun_m=math.nan, slip_s=0.0, rear_up_s=0.0)
        x = 0.0 if cut is None else cut.place_m(state.x_m, state.y_m)
        ahead, height = lip(self._rig[0], state.boom_rad, state.bucket_rad)
        weight = (self.machine.drive.mass_kg + state.load_kg) * GRAVITY_MPS2
        one = one._replace(
            x_m=x, lip_x_m=x + ahead, lip_z_m=height, begun_m=x + ahead if math.isnan(one.begun_m) else one.begun_m,
            speed_mps=state.speed_mps, wheel_mps=state.wheel_speed_mps, boom_rad=state.boom_rad, bucket_rad=state.bucket_rad,
            boom_rps=state.boom_rate_rps, bucket_rps=state.bucket_rate_rps, brake=state.brake,
            content_m3=state.load_kg / self._kg_m3, pull_n=weight * math.sin(state.pitch_rad), busy=1.0,
        )  # fmt: skip
        return record(one)

    def _lowering(self, state: VehicleState) -> State:
        """Return the side view of a machine that has trammed: engine, pump and pressure as its speed needs them."""
        rig = self._rig[0]
        stroke = min(max(state.wheel_speed_mps / rig["gear_mps"], -1.0), 1.0)
        mass = self.machine.drive.mass_kg + state.load_kg
        pressure = state.traction_mps2 * mass * rig["wheel_radius_m"] / rig["displacement_m3"]
        return State(engine=rig["idle"] + (1.0 - rig["idle"]) * abs(stroke), stroke=stroke, pressure_pa=float(pressure))

    def _carried(
        self,
        state: VehicleState,
        side: State,
        pending: tuple[tuple[int, Command], ...],
        steering_rps: float,
        dt_s: float,
    ) -> VehicleState:
        """Return the machine where the side view's speed and the steering bring it."""
        load_kg = side.content_m3 * self._kg_m3
        plant, row = plant_of(self.machine, load_kg, self._errors), np.array(state[1 : 1 + ROW])
        row[7] = side.speed_mps
        steps = max(1, math.ceil(dt_s / SUB_STEP_S - 1e-6))
        points = kernel.carry(row, plant, steering_rps, state.speed_mps, steps, dt_s / steps)
        kernel.stand(row, plant, points, self._ground.floor_height(points))
        known = state.digging or Digging()
        number = 0 if self.piles.cut is None else self.piles.cut.number
        moved = state_of_row(state.time_ns + round(dt_s * 1e9), row, pending)
        return moved._replace(
            wheel_speed_mps=side.wheel_mps, boom_rad=side.boom_rad, bucket_rad=side.bucket_rad,
            boom_rate_rps=side.boom_rps, bucket_rate_rps=side.bucket_rps, load_kg=load_kg, brake=side.brake,
            traction_mps2=side.traction_n / plant.mass_kg, curl=min(max(abs(side.tilting), side.at_stop), 1.0),
            digging=known._replace(bucket=tuple(side), session=number),
        )  # fmt: skip


def _loose_rock(ground: Grounds) -> Record:
    """Return the rock of no pile: what holds the content, and nothing to dig."""
    rock = draw_load(ground, 0).rock.copy()
    rock["origin_m"], rock["step_m"] = 0.0, CELL_M
    rock["density"] = 1e3 * ground.rock.density_t_m3
    return rock


def _no_pile() -> World:
    return World(np.zeros(40), np.zeros((15, 3)), np.ones(1), np.zeros((0, 3)), np.zeros((0, 3)))
