"""Classes of planar tunnels, and drives through them.

Each run draws a tunnel, a direction, a load and errors of the machine (pose noise 1 cm and 0.1 degrees, joint offset 0.5 degrees,
steering gain +-5 %, lags +-10 %, the route off by 0.15 m) from its seed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from lhdmap.evaluation.navigation.drive import squared_steps
from lhdmap.guidance.settings import GuidanceSettings
from lhdmap.navigation.settings import NavigationSettings

from tests.guidance.planar_drive import Drive, Errors, drive
from tests.guidance.tunnels import MACHINE, route_of, tunnel


@dataclass(frozen=True)
class Class:
    """A class of tunnels: least room (drawn between both), radii, roughness, speed limit."""

    room_m: tuple[float, float]
    radii_m: tuple[float, float] = (5.5, 15.0)
    length_m: float = 70.0
    rms_m: float = 0.10
    limit_kmh: float = 10.1
    limit_loaded_kmh: float = 7.9


CLASSES = {
    "c 0.10-0.25": Class((0.10, 0.25)),
    "c 0.25": Class((0.25, 0.25)),
    "c 0.50": Class((0.5, 0.5)),
    "c 0.15, R 12-40": Class((0.15, 0.15), (12.0, 40.0), 180.0),
    "c 0.5, R 30-60": Class((0.5, 0.5), (30.0, 60.0), 100.0, 0.10, 20.0, 18.0),
}


@dataclass(frozen=True)
class Row:
    """A run."""

    seed: int
    gear: int
    load_kg: float
    c_m: float
    arrived: bool
    contact: bool
    least_m: float
    mean_kmh: float
    top_kmh: float
    acd: float
    asd: float
    msd: float
    work_ms: float
    work_p99_ms: float
    duration_s: float


def errors_of(seed: int) -> Errors:
    """Draw the errors of a run."""
    rng = np.random.default_rng([seed, 9])
    return Errors(
        gain=1.0 + 0.05 * rng.uniform(-1.0, 1.0),
        lag=1.0 + 0.10 * rng.uniform(-1.0, 1.0),
        bend_offset_rad=math.radians(0.5) * float(rng.choice([-1.0, 1.0])),
        jitter_m=0.01,
        jitter_rad=math.radians(0.1),
        route_m=float(rng.normal(0.0, 0.15)),
        seed=seed,
    )


def row_of(kind: Class, seed: int, settings: GuidanceSettings) -> tuple[Row, Drive]:
    """Run a seed of a class: even seeds forward; of four, two carry a load."""
    gear, load = (1, -1)[seed % 2], MACHINE.drive.payload_kg * (seed // 2 % 2)
    c = float(np.random.default_rng([seed, 3]).uniform(*kind.room_m))
    line, walls = tunnel(seed // 2, c, kind.radii_m, kind.length_m, kind.rms_m)
    limit = (kind.limit_loaded_kmh if load else kind.limit_kmh) / 3.6
    given = NavigationSettings()
    route = route_of(seed // 2, line, given.crossing_weight, given.crossing_margin_m)
    out = drive(
        line, walls, gear, limit_mps=limit, settings=settings, errors=errors_of(seed), load_kg=load, seconds=240.0, route=route
    )  # fmt: skip
    speeds, bends = np.array(out.speeds_mps), np.degrees([one[3] for one in out.states])
    row = Row(
        seed, gear, load, c, out.arrived, out.contact, min(out.rooms_m), float(np.abs(speeds).mean() * 3.6),
        float(np.abs(speeds).max() * 3.6), *smoothness(out), float(np.median(out.work_ms)),
        float(np.quantile(out.work_ms, 0.99)), len(bends) / 10.0,
    )  # fmt: skip
    return row, out


def smoothness(out: Drive) -> tuple[float, float, float]:
    """Return ACD, ASD and MSD, Eqs. (22) and (23): at 10 Hz, commands as shares, speed in km/h, joint in degrees."""
    speeds, bends = 3.6 * np.array(out.speeds_mps), np.degrees([one[3] for one in out.states])
    told = out.commands[1::5]
    propel = np.array([one.speed_mps for one in told]) / MACHINE.dimensions.max_speed_kmh * 3.6
    rate = np.degrees([one.steering_rate_rps for one in told]) / MACHINE.dimensions.max_articulation_rate_dps
    jolts = squared_steps(speeds, bends)
    return float(squared_steps(propel, rate).mean()), float(jolts.mean()), float(jolts.max())
