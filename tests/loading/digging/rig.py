"""A loader of a few lines before a pile of a few lines: enough to close the loop, and its truth is known.

Along one line: the pile resists with `hardness_kn` per metre and `bucket turned` eases it; the tyres slip above `grip_kn`.
Nothing here is meant to be like a mine: figures of a mine are those of `simulation/ground`.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from lhdmap.loading.signals import Controller, Pedals, Signals, Turn

TICK_NS = 20_000_000
_TICK_S = 0.02
_KN_PER_BAR = 0.4
_MASS_T = 34.0
_ROLLING_KN = 10.3


@dataclass(frozen=True)
class World:
    """What a machine stands before: way to the toe, hardness, grip, bump on the way (at, force, length), noise, lag of scans."""

    toe_m: float = 3.0
    hardness_kn: float = 160.0
    grip_kn: float = 150.0
    bump: tuple[float, float, float] = (math.inf, 0.0, 0.0)
    noise: float = 0.0
    lag_ticks: int = 5
    toe_error_m: float = 0.0
    toe_std_m: float = 0.15
    top_mps: float = 1.75
    fill: float = 0.0
    seed: int = 1


@dataclass
class Loader:
    """The machine; `signals` is what it tells, `slip_s` and `touched_ns` are its truth."""

    world: World = field(default_factory=World)
    boom_rad: float = -0.35
    bucket_rad: float = -0.83
    speed_mps: float = 0.0
    wheels_mps: float = 0.0
    way_m: float = 0.0
    turned_m: float = 0.0
    force_kn: float = 0.0
    now_ns: int = 10_000_000_000
    swing_ns: int = 0
    slip_s: float = 0.0
    touched_ns: int = 0

    def __post_init__(self) -> None:
        """Begin with scans that lag."""
        self._rng = np.random.default_rng(self.world.seed)
        self._scans: deque[tuple[int, float]] = deque([(self.now_ns, 0.0)], maxlen=self.world.lag_ticks + 1)

    def signals(self) -> Signals:
        """Return what is told now."""
        tacho, press, scan = self.world.noise * self._rng.standard_normal(3) * (0.01, 4.0, 0.03)
        scan_ns, scan_mps = self._scans[0]
        toe_m = self.world.toe_m - self.way_m
        return Signals(
            now_ns=self.now_ns,
            tacho_mps=self.wheels_mps + tacho,
            scan_mps=scan_mps + scan,
            scan_ns=scan_ns,
            travel_m=self.way_m,
            boom_rad=self.boom_rad,
            bucket_rad=self.bucket_rad,
            articulation_rad=0.0,
            transmission_bar=max(self.force_kn / _KN_PER_BAR + press, 0.0),
            lift_bar=self.lift_bar() + 0.4 * press,
            tilt_bar=23.0,
            toe_m=toe_m + self.world.toe_error_m,
            toe_std_m=self.world.toe_std_m,
        )

    def lift_bar(self) -> float:
        """Return the boom's pressure: Eq. (9) the other way round, swinging after a lift at 1.4 Hz."""
        since_s = (self.now_ns - self.swing_ns) * 1e-9
        w = 2.0 * math.pi * 1.4
        still_bar = (self.world.fill + 1.0774) / 0.0207
        return still_bar * (1.0 + 0.15 * math.exp(-0.08 * w * since_s) * math.cos(w * since_s))

    def resistance_kn(self) -> float:
        """Return what pushes back."""
        at_m, force_kn, length_m = self.world.bump
        bump_kn = force_kn if at_m <= self.way_m < at_m + length_m else 0.0
        inside_m = max(self.way_m - self.world.toe_m - self.turned_m, 0.0)
        return bump_kn + self.world.hardness_kn * inside_m**1.25

    def tick(self, pedals: Pedals) -> None:
        """Move on by 20 ms."""
        self._joints(pedals)
        if self.way_m > self.world.toe_m and not self.touched_ns:
            self.touched_ns = self.now_ns
        wanted = 0.0 if pedals.brake else pedals.propel * self.world.top_mps
        back_kn = self.resistance_kn() + math.copysign(_ROLLING_KN, wanted) * (wanted != 0.0)
        engine_kn = min(max(back_kn + 60.0 * (wanted - self.wheels_mps), -168.0), 168.0)
        slips = abs(engine_kn) > self.world.grip_kn
        drive_kn = math.copysign(min(abs(engine_kn), self.world.grip_kn), engine_kn)
        self.force_kn = abs(engine_kn)
        before_mps = self.speed_mps
        self.speed_mps += (drive_kn - back_kn) / _MASS_T * _TICK_S
        if wanted > 0.0:
            self.speed_mps = max(self.speed_mps, 0.0)
        if wanted == 0.0:
            self.speed_mps = 0.0
        self.wheels_mps = self.speed_mps + (0.5 if slips else 0.0)
        self.slip_s += _TICK_S * slips
        self.way_m += 0.5 * (before_mps + self.speed_mps) * _TICK_S
        self.now_ns += TICK_NS
        self._scans.append((self.now_ns, self.speed_mps))

    def _joints(self, pedals: Pedals) -> None:
        share = 0.6 if pedals.tilt and pedals.lift else 1.0
        if pedals.lift:
            self.swing_ns = self.now_ns
        easy = 1.0 if self.resistance_kn() < 260.0 else 0.0
        turn_rad = 0.24 * share * pedals.tilt * easy * _TICK_S
        lift_rad = 0.16 * share * pedals.lift * _TICK_S
        self.bucket_rad = min(self.bucket_rad + turn_rad, 0.0)
        self.boom_rad = min(max(self.boom_rad + lift_rad, -0.35), 0.85)
        self.turned_m = min(self.turned_m + 2.0 * max(turn_rad, 0.0) + 3.0 * max(lift_rad, 0.0), 9.0)


def run(controller: Controller, loader: Loader, limit_s: float = 30.0) -> tuple[Turn, list[Turn], list[Signals]]:
    """Step a controller until it ends or the limit; return its last turn, all turns, and the signals of each."""
    signals = loader.signals()
    controller.begin(signals)
    turns: list[Turn] = []
    heard: list[Signals] = []
    while True:
        turn = controller.step(signals)
        turns.append(turn)
        heard.append(signals)
        if turn.ended or len(turns) * _TICK_S >= limit_s:
            return turn, turns, heard
        loader.tick(turn.pedals)
        signals = loader.signals()
