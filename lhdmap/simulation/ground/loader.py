"""A machine before a pile: stepped by pedals, heard through its sensors, attempt after attempt on the same pile.

loader = Loader(load_machine(), load_ground("default"))
signals = loader.begin(seed=7)                # lip pressed on the floor, 7 m before the toe
signals = loader.step(Pedals(propel=0.5), 0.02)
loader.truth.fill, loader.truth.rock_n        # for evaluation only
signals = loader.retry()                      # backed off, bucket lowered again, the pile as it was left
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lhdmap.loading.signals import Pedals, Signals
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.simulation.ground.draws import CELL_M, DUG_M3, Attempt, Load, draw_attempt, draw_load, hardness_factor
from lhdmap.simulation.ground.face import capacity, put_ahead, settle, take_boulder
from lhdmap.simulation.ground.hearing import Hearing
from lhdmap.simulation.ground.kernel import World, advance
from lhdmap.simulation.ground.linkage import lip
from lhdmap.simulation.ground.records import Record, State, record, state_of
from lhdmap.simulation.ground.rig import bucket_for, press_force_n, rig_of
from lhdmap.simulation.ground.sections import Grounds
from lhdmap.simulation.ground.truth import Truth, toe_of, truth_of

SUB_STEP_S = 0.002
_PRESSED_RAD = -0.04  # floor of a bucket that is pressed down: what it holds stays while it charges
BOULDER_WAY_M = 0.6
"""Way of the lip in rock after which the boulder of an attempt has fallen into the bucket."""
_ORIGIN_M, _CELLS = -16.0, 580  # of the pile's cells; the toe begins at x = 0


@dataclass(frozen=True, slots=True)
class _Scene:
    """One load's pile and machine; the arrays change."""

    seed: int
    load: Load
    rig: Record
    rock: Record
    heights: FloatArray
    state: Record
    kg_m3: float


class Loader:
    """One machine and one pile in a vertical plane. `begin` makes a new pile; all chance comes from its seed."""

    def __init__(self, machine: Machine, ground: Grounds, *, sub_step_s: float = SUB_STEP_S) -> None:
        self.machine, self.ground, self._sub_step_s = machine, ground, sub_step_s
        self._hearing = Hearing(machine, ground.errors)
        self._chance: Attempt
        self._world: World
        self._begun_m2 = 0.0
        self.begin(0)

    def begin(self, seed: int, *, approach_m: float = 7.0, time_ns: int = 0) -> Signals:
        """Stand with the bucket lowered, its lip `approach_m` before the toe of the new pile of this seed."""
        load = draw_load(self.ground, seed)
        rock = load.rock.copy()
        rock["origin_m"] = _ORIGIN_M
        x = _ORIGIN_M + CELL_M * np.arange(_CELLS)
        heights = np.clip(x * rock["slope"], 0.0, load.crest_m)
        kg_m3 = float(rock["density"][0] / rock["swell"][0])
        self._scene = _Scene(seed, load, rig_of(self.machine, load.tilt_factor), rock, heights, record(State()), kg_m3)
        self._number, self._digs, self._now_ns = 0, 0, time_ns
        return self._attempt(approach_m)

    def retry(self, *, approach_m: float = 7.0) -> Signals:
        """Stand back again with the bucket lowered for the next attempt; what a level bucket does not hold is at the toe."""
        scene, state = self._scene, self._scene.state
        rig, rock = scene.rig[0], scene.rock[0]
        settle(state[0], rig, rock, scene.heights)
        dug = max(self._begun_m2 - float(scene.heights.sum()) * CELL_M, 0.0)
        self._digs += dug * float(rig["width_m"]) > DUG_M3  # a charge that ended early loosens nothing
        beside = dug * float(rock["lateral_share"])
        state["lateral_m3"] += beside * rig["width_m"]
        lost = max(float(state["content_m3"][0]) - capacity(rock, rig, _PRESSED_RAD), 0.0)
        state["content_m3"] -= lost
        state["spilled_m3"] += lost
        toe = round((toe_of(scene.heights, _ORIGIN_M) - _ORIGIN_M) / CELL_M)
        put_ahead(scene.heights, toe, rock, beside + lost / float(rock["swell"] * rig["width_m"]))
        settle(state[0], rig, rock, scene.heights)
        return self._attempt(approach_m)

    def step(self, pedals: Pedals, dt_s: float = 0.02) -> Signals:
        """Move on by `dt_s` with these pedals; what is no number is none."""
        shares = [min(max(v, -1.0), 1.0) if math.isfinite(v) else 0.0 for v in pedals[:3]]
        scene, row = self._scene, np.array([*shares, float(pedals.full_rpm), float(pedals.brake)])
        steps = max(1, round(dt_s / self._sub_step_s))
        advance(scene.state, scene.rig, scene.rock, self._world, row, steps, dt_s / steps)
        self._now_ns += round(dt_s * 1e9)
        if self._chance.boulder_m3 > 0.0 and scene.state["way_m"][0] > BOULDER_WAY_M:
            take_boulder(scene.state[0], scene.rig[0], scene.rock[0], scene.heights, self._chance.boulder_m3)
            self._chance = self._chance._replace(boulder_m3=0.0)
        return self._heard()

    @property
    def state(self) -> State:
        """The whole state of the side view; for evaluation."""
        return state_of(self._scene.state)

    @property
    def truth(self) -> Truth:
        """What really is; for evaluation, never for a controller."""
        scene = self._scene
        return truth_of(self.state, self.machine, scene.kg_m3, toe_of(scene.heights, _ORIGIN_M), self._number)

    @property
    def pile(self) -> tuple[FloatArray, FloatArray]:
        """Places along x (m, the first toe at 0) and the pile's heights (m)."""
        x: FloatArray = _ORIGIN_M + CELL_M * np.arange(_CELLS, dtype=float)
        return x, self._scene.heights.copy()

    @property
    def hardness(self) -> float:
        """Hardness of the rock in this attempt."""
        return float(self._scene.rock["hardness"][0])

    def balance_m3(self) -> float:
        """Return rock in the pile, in place, and in the bucket, as in place, less what came from the sides, m³."""
        scene, state = self._scene, self.state
        inside = state.content_m3 / float(scene.rock["swell"][0]) - state.lateral_m3
        return float(scene.heights.sum()) * CELL_M * float(scene.rig["width_m"][0]) + inside

    def _attempt(self, approach_m: float) -> Signals:
        """Draw the next attempt's chance and put the machine before the toe."""
        self._number += 1
        scene, begin = self._scene, toe_of(self._scene.heights, _ORIGIN_M) - approach_m
        self._chance = draw_attempt(self.ground, scene.seed, self._number, begin, approach_m)
        self._begun_m2 = float(scene.heights.sum()) * CELL_M
        chance = self._chance
        self._world = World(scene.heights, scene.load.table, chance.noise, chance.strikes, chance.bumps)
        scene.rock["hardness"] = scene.load.rock["hardness"] * hardness_factor(self.ground, scene.seed, self._digs + 1)
        press_m = press_force_n(self.machine, self.ground.floor.press_bar) / float(scene.rig["floor_stiffness"][0])
        bucket = bucket_for(self.machine, chance.lip_high_m if chance.lip_high_m > 0.0 else -press_m)
        boom = self.machine.linkage.boom_min_rad
        ahead, height = lip(scene.rig[0], boom, bucket)
        kept = self.state
        scene.state[:] = record(
            State(
                x_m=begin - ahead, lip_x_m=begin, lip_z_m=height, begun_m=begin, boom_rad=boom, bucket_rad=bucket,
                engine=float(scene.rig["idle"][0]), content_m3=kept.content_m3, lateral_m3=kept.lateral_m3,
                spilled_m3=kept.spilled_m3,
            )
        )  # fmt: skip
        still = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
        advance(scene.state, scene.rig, scene.rock, self._world, still, 1, self._sub_step_s)
        self._hearing.begin(scene.seed, self._number, self.state, self._now_ns, chance.toe_error_m)
        return self._heard()

    def _heard(self) -> Signals:
        scene, state = self._scene, self.state
        toe_m = toe_of(scene.heights, _ORIGIN_M) - state.lip_x_m
        return self._hearing.signals(self._now_ns, state, toe_m, state.content_m3 * scene.kg_m3)
