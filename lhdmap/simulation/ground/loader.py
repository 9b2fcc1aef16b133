"""A machine before a pile: stepped by pedals, heard through its sensors, attempt after attempt on the same pile.

loader = Loader(load_machine(), load_ground("default"))
signals = loader.begin(seed=7)                # lip pressed on the floor, 7 m before the toe
signals = loader.step(Pedals(propel=0.5), 0.02)
loader.truth.fill, loader.truth.rock_n        # for evaluation only
signals = loader.retry()                      # backed off, bucket lowered again, the pile as it was left
"""

from __future__ import annotations

import math

import numpy as np

from lhdmap.loading.signals import Pedals, Signals
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.simulation.ground.draws import CELL_M, Attempt, draw_attempt, draw_load, hardness_factor
from lhdmap.simulation.ground.face import capacity, put_ahead, settle, take_boulder
from lhdmap.simulation.ground.hearing import Hearing
from lhdmap.simulation.ground.kernel import World, advance
from lhdmap.simulation.ground.records import State, record, state_of
from lhdmap.simulation.ground.rig import bucket_for, press_force_n, rig_of
from lhdmap.simulation.ground.sections import Grounds
from lhdmap.simulation.ground.truth import Truth, toe_of, truth_of

SUB_STEP_S = 0.002
_ORIGIN_M, _CELLS = -4.0, 340  # of the pile's cells; the toe begins at x = 0
_BOULDER_WAY_M = 0.6  # in rock, after which the boulder of an attempt has fallen into the bucket


class Loader:
    """One machine and one pile in a vertical plane. `begin` makes a new pile; all chance comes from its seed."""

    def __init__(self, machine: Machine, ground: Grounds, *, sub_step_s: float = SUB_STEP_S) -> None:
        self.machine, self.ground, self._sub_step_s = machine, ground, sub_step_s
        self._hearing = Hearing(machine, ground.errors)
        self._seed, self._number, self._now_ns = 0, 0, 0

    def begin(self, seed: int, *, approach_m: float = 7.0, time_ns: int = 0) -> Signals:
        """Stand with the bucket lowered, its lip `approach_m` before the toe of the new pile of this seed."""
        self._load = draw_load(self.ground, seed)
        self._seed, self._number, self._now_ns = seed, 0, time_ns
        self._rig = rig_of(self.machine, self._load.tilt_factor)
        self._rock = self._load.rock.copy()
        self._tonnes = float(self._rock["density"][0] / self._rock["swell"][0])
        self._rock["origin_m"] = _ORIGIN_M
        x = _ORIGIN_M + CELL_M * np.arange(_CELLS)
        self._heights = np.clip(x * self._rock["slope"], 0.0, self._load.crest_m)
        self._state = record(State())
        return self._attempt(approach_m)

    def retry(self, *, approach_m: float = 7.0) -> Signals:
        """Stand back again with the bucket lowered for the next attempt; what a level bucket does not hold is at the toe."""
        state, rig, rock = self._state, self._rig, self._rock
        settle(state[0], rig[0], rock[0], self._heights)
        self._from_the_sides()
        room = capacity(rock[0], rig[0], 0.0)
        lost = max(float(state["content_m3"][0]) - room, 0.0)
        state["content_m3"] -= lost
        state["spilled_m3"] += lost
        toe = round((toe_of(self._heights, _ORIGIN_M) - _ORIGIN_M) / CELL_M)
        put_ahead(self._heights, toe, rock[0], lost / float(rock["swell"][0] * rig["width_m"][0]))
        settle(state[0], rig[0], rock[0], self._heights)
        return self._attempt(approach_m)

    def step(self, pedals: Pedals, dt_s: float = 0.02) -> Signals:
        """Move on by `dt_s` with these pedals; what is no number is none."""
        shares = [min(max(v, -1.0), 1.0) if math.isfinite(v) else 0.0 for v in pedals[:3]]
        row = np.array([*shares, float(pedals.full_rpm), float(pedals.brake)])
        steps = max(1, round(dt_s / self._sub_step_s))
        advance(self._state, self._rig, self._rock, self._world, row, steps, dt_s / steps)
        self._now_ns += round(dt_s * 1e9)
        if self._chance.boulder_m3 > 0.0 and self._state["way_m"][0] > _BOULDER_WAY_M:
            take_boulder(self._state[0], self._rig[0], self._rock[0], self._heights, self._chance.boulder_m3)
            self._chance = self._chance._replace(boulder_m3=0.0)
        return self._hearing.signals(self._now_ns, state_of(self._state), self.truth)

    @property
    def truth(self) -> Truth:
        """What really is; for evaluation, never for a controller."""
        return truth_of(
            state_of(self._state), self.machine, self._tonnes, toe_of(self._heights, _ORIGIN_M), self._number
        )

    @property
    def pile(self) -> tuple[FloatArray, FloatArray]:
        """Places along x (m, the first toe at 0) and the pile's heights (m)."""
        return _ORIGIN_M + CELL_M * np.arange(_CELLS), self._heights.copy()

    def balance_m3(self) -> float:
        """Return rock in the pile, in place, and in the bucket, as in place, less what came from the sides, m³."""
        width, swell = float(self._rig["width_m"][0]), float(self._rock["swell"][0])
        inside = float(self._state["content_m3"][0]) / swell - float(self._state["lateral_m3"][0])
        return float(self._heights.sum()) * CELL_M * width + inside

    def _attempt(self, approach_m: float) -> Signals:
        """Draw the next attempt's chance and put the machine before the toe."""
        self._number += 1
        toe = toe_of(self._heights, _ORIGIN_M)
        chance = draw_attempt(self.ground, self._seed, self._number, toe - approach_m, approach_m)
        self._set_chance(chance)
        factor = hardness_factor(self.ground, self._seed, self._number)
        self._rock["hardness"] = self._load.rock["hardness"] * factor
        state, kept = (
            self._state,
            {name: float(self._state[name][0]) for name in ("content_m3", "lateral_m3", "spilled_m3")},
        )
        press = press_force_n(self.machine, self.ground.floor.press_bar) / float(self._rig["floor_stiffness"][0])
        bucket = bucket_for(self.machine, chance.lip_high_m if chance.lip_high_m > 0.0 else -press)
        state[:] = record(State(**kept))
        state["bucket_rad"], state["boom_rad"] = bucket, self.machine.linkage.boom_min_rad
        state["engine"] = self._rig["idle"]
        state["x_m"] = toe - approach_m
        lip = self.machine.linkage
        reach = lip.pivot_m[0] + lip.boom_m * math.cos(lip.boom_angle_rad)
        psi = lip.bucket_angle_rad + bucket - lip.bucket_max_rad
        state["x_m"] -= reach + math.cos(psi) * lip.lip_m[0] - math.sin(psi) * lip.lip_m[1]
        state["lip_x_m"] = state["begun_m"] = toe - approach_m
        advance(state, self._rig, self._rock, self._world, np.array([0.0, 0.0, 0.0, 0.0, 1.0]), 1, self._sub_step_s)
        self._hearing.begin(self._seed, self._number, chance.toe_error_m)
        return self._hearing.signals(self._now_ns, state_of(state), self.truth)

    def _set_chance(self, chance: Attempt) -> None:
        self._chance = chance
        self._dug_m2 = float(self._heights.sum()) * CELL_M
        self._world = World(self._heights, self._load.table, chance.noise, chance.strikes, chance.bumps)

    def _from_the_sides(self) -> None:
        """Let a share of what the attempt dug come from the sides: onto the lower half of the face."""
        dug = max(self._dug_m2 - float(self._heights.sum()) * CELL_M, 0.0)
        share = dug * float(self._rock["lateral_share"][0])
        toe = round((toe_of(self._heights, _ORIGIN_M) - _ORIGIN_M) / CELL_M)
        put_ahead(self._heights, toe, self._rock[0], share)
        self._state["lateral_m3"] += share * self._rig["width_m"]
        settle(self._state[0], self._rig[0], self._rock[0], self._heights)
