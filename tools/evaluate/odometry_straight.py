"""Rows of the odometry's table on straight drifts of smooth walls: where nothing but 5 mm of roughness tells the way."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from lhdmap.evaluation.planar_segments import planar_segments
from lhdmap.messages import FloatArray
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.simulation.planar import PlanarScanner, drift_world, poses_along, simulate_scans, way_from_rest

from tools.evaluate.figures import Figure
from tools.evaluate.worlds import SMOOTH_M, Run, end_pct, odometry, run, wheels_of

GROUP = "Straight drifts of smooth walls (5 mm), 100 m driven"
SEEDS = (701, 702, 703, 704, 705, 706)  # worlds that nothing was chosen on
_START_M, _LENGTH_M, _WORLD_M = 5.0, 100.0, 115.0


class Straight(NamedTuple):
    """A kind of drive: range, from rest or at full speed all along, octaves and persistence of the walls, stream."""

    max_range_m: float
    from_rest: bool
    walls: tuple[int, float]
    speed_mps: float
    rate_hz: float
    wheels: bool = False


KINDS = {
    "towards an end face, range 80 m, 12 km/h, 25 Hz": Straight(80.0, False, (6, 0.75), 12 / 3.6, 25.0),
    "the same from rest, 9 km/h, 50 Hz": Straight(80.0, True, (6, 0.75), 2.5, 50.0),
    "range 10 m, 9 km/h, 50 Hz": Straight(10.0, False, (6, 0.75), 2.5, 50.0),
    "the same from rest": Straight(10.0, True, (6, 0.75), 2.5, 50.0),
    "long waves alone, range 20 m, from rest": Straight(20.0, True, (4, 0.5), 2.5, 50.0),
    "the same, tachometer (1 % scale, slip bursts of 2 s)": Straight(20.0, True, (4, 0.5), 2.5, 50.0, wheels=True),
}


def straight(seeds: Sequence[int]) -> Iterator[Figure]:
    """Each kind: mean over 10 m, the worst 10 m of all, the end."""
    for name, kind in KINDS.items():
        runs = [straight_run(kind, seed) for seed in seeds]
        errors = [planar_segments(one.estimate, one.truth) for one in runs]
        means = [one.translation_pct for one in errors]
        each = ", ".join(f"{mean:.2f}" for mean in means)
        yield Figure(GROUP, f"{name}: 10 m", float(np.mean(means)), "%", 0.5, each)
        yield Figure(GROUP, f"{name}: worst segment", max(one.worst_pct for one in errors), "%", 5.0)
        ends = [end_pct(one) for one in runs]
        yield Figure(GROUP, f"{name}: end", float(np.mean(ends)), "%", None, ", ".join(f"{end:.2f}" for end in ends))


def straight_run(kind: Straight, seed: int) -> Run:
    """Drive one of them."""
    octaves, persistence = kind.walls
    world = drift_world(
        seed,
        rms_m=SMOOTH_M,
        pieces=((_WORLD_M, 0.0),),
        cross_drift_at_m=None,
        octaves=octaves,
        persistence=persistence,
    )
    way = np.arange(0.0, _LENGTH_M, kind.speed_mps / kind.rate_hz)
    if kind.from_rest:
        way = way_from_rest(kind.speed_mps, kind.rate_hz, _LENGTH_M)
    truth = poses_along(world.centre_line_m, _START_M + way)
    scans = simulate_scans(world, truth, PlanarScanner(max_range_m=kind.max_range_m), kind.rate_hz, seed)

    def make(velocity: FloatArray | None) -> PlanarOdometry:
        return odometry("anchored", velocity)

    return run(scans, truth, make, wheels_of(truth, kind.rate_hz, seed) if kind.wheels else None)
