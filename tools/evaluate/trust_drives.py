"""Drives whose end is known: planar ones of all wall classes, and ones in space with tilted scanners."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lhdmap.config import Settings
from lhdmap.geometry import se2
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.steps import OdometryStep
from lhdmap.pipeline.inputs import ROLES_READ
from lhdmap.pipeline.mapping import MappingOptions, MappingPipeline, feed
from lhdmap.pipeline.track import TrackRows, resample
from lhdmap.simulation.drive import simulate_drift
from lhdmap.simulation.planar import PlanarScanner, drift_world, drive_along, simulate_scans
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriftSettings, DriveSettings
from lhdmap.simulation.sensing.sections import InclinometerSettings, ScannerSettings
from lhdmap.smoothing.keys import KeyScans
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.trust import ExpectedError, expected_error
from tests.integration.truth import rows_of

from tools.evaluate.worlds import MODERATE_M, ROUGH_M, SMOOTH_M, odometry, run, wheels_of

WALLS = {"rough": ROUGH_M, "moderate": MODERATE_M, "smooth": SMOOTH_M}
_BENDS = tuple((12.0 if k % 2 else 9.0 + 3.0 * (k % 4), (0.0, 1.2, 0.0, -1.4)[k % 4]) for k in range(13))
COURSES: dict[str, tuple[tuple[tuple[float, float], ...] | None, float | None, float]] = {
    "table": (None, 45.0, 80.0),  # pieces, where the cross drift is, range
    "bends": (_BENDS, None, 80.0),
    "straight, range 10 m": (((165.0, 0.0),), None, 10.0),
}
_KMH, _RATE_HZ = 12.0, 25.0
_SPACE_M = 90.0
_BIAS_STD_DEG = 0.03  # of the inclinometer: `attitude.bias_std_deg`
_HIT = np.zeros((1, 3))


class Driven(NamedTuple):
    """A drive: true and estimated poses (N, 3) of the processed scans, the odometry's steps, what is expected of the end.

    `end`: its error in the plane (m), heading (°), height (m, None: not observed).
    """

    truth: FloatArray
    estimate: FloatArray
    steps: list[OdometryStep]
    expected: ExpectedError
    end: tuple[float, float, float | None]


def planar(walls: str, course: str, seed: int, *, wheels: bool = False) -> Driven:
    """Drive 110 to 150 m in a planar drift."""
    pieces, cross_m, range_m = COURSES[course]
    world = drift_world(seed, rms_m=WALLS[walls], pieces=pieces, cross_drift_at_m=cross_m)
    truth = drive_along(world.centre_line_m, _KMH / 3.6, _RATE_HZ)
    scans = simulate_scans(world, truth, PlanarScanner(max_range_m=range_m), _RATE_HZ, seed)

    def make(velocity: FloatArray | None) -> PlanarOdometry:
        return odometry("anchored", velocity)

    driven = run(scans, truth, make, wheels_of(truth, _RATE_HZ, seed) if wheels else None)
    used = [k for k, step in enumerate(driven.steps) if step.processed]
    steps = [driven.steps[k] for k in used]
    keys = KeyScans(SmoothingSettings())
    for step in steps:
        keys.update(step.time_ns, step.pose_odom_base, _HIT, step.error, unseen=step.unseen)
    expected = expected_error(keys, None)
    assert expected is not None
    true, estimate = truth[used], np.array([step.pose_odom_base for step in steps])
    return Driven(true, estimate, steps, expected, (*_end_error(true, estimate), None))


class Sensors(NamedTuple):
    """What a machine in space has beside its front scanner."""

    rear: bool
    wheels: bool
    inclinometer: bool

    @property
    def roles(self) -> list[str]:
        """Roles of the log's topics that are read."""
        without = [("rear", self.rear), ("inclinometer", self.inclinometer), ("tachometer", self.wheels)]
        left_out = {role for role, there in without if not there} | (set() if self.rear or self.wheels else {"joints"})
        return [role for role in ROLES_READ if role not in left_out]

    def __str__(self) -> str:
        return ", ".join(name for name, there in zip(self._fields, self, strict=True) if there) or "front scanner alone"


def in_space(walls: str, seed: int, machines: list[Sensors]) -> list[Driven]:
    """Drive 90 m with scanners tilted by 2.5° and go through the log once for each of the machines."""
    with tempfile.TemporaryDirectory() as folder:
        drive = simulate_drift(_scenario(walls, seed), Path(folder) / "drive.mcap")
        return [_mapped(drive.log, rows_of(drive.truth), sensors) for sensors in machines]


def _scenario(walls: str, seed: int) -> DriftScenario:
    rng = np.random.default_rng(seed + 77)
    side = 1.0 if rng.random() < 0.5 else -1.0
    pieces = (
        (float(rng.uniform(12.0, 22.0)), 0.0, -8.0), (12.0, 12.0 * side, -4.0), (float(rng.uniform(10.0, 20.0)), 0.0, 6.0),
        (12.0, -10.0 * side, 0.0), (_SPACE_M, 0.0, 3.0),
    )  # fmt: skip
    return DriftScenario(
        seed=seed,
        drift=DriftSettings(pieces=pieces, mesh_m=0.06, roughness_m=WALLS[walls]),
        drive=DriveSettings(distance_m=_SPACE_M, speed_kmh=_KMH),
        scanner=ScannerSettings(beams=381, rate_hz=_RATE_HZ, sweep=True),
        inclinometer=InclinometerSettings(bias_pitch_deg=_BIAS_STD_DEG * rng.standard_normal()),
    )


def _mapped(log: Path, truth: TrackRows, sensors: Sensors) -> Driven:
    pipeline = MappingPipeline(Settings(), Machine(), MappingOptions(cloud=sensors.rear))
    with LogSource([log]) as source:
        feed(pipeline, source.messages([role for role in sensors.roles if role in source.roles]))
    rows = pipeline.path.final.rows()
    true = resample(truth, rows.times_ns).poses
    height_std_m = (
        pipeline.front_end.inclinometer.attitude.height_std_m(_SPACE_M) if pipeline.has_inclinometer else None
    )
    expected = expected_error(pipeline.evidence.smoother.keys, height_std_m)
    assert expected is not None
    flat, flat_true = rows.poses[:, [0, 1, 5]], true[:, [0, 1, 5]]
    risen_m = float((rows.poses[-1, 2] - rows.poses[0, 2]) - (true[-1, 2] - true[0, 2]))
    end = (*_end_error(flat_true, flat), risen_m if pipeline.has_inclinometer else None)
    return Driven(flat_true, flat, [], expected, end)


def _end_error(truth: FloatArray, estimate: FloatArray) -> tuple[float, float]:
    """Return how far the last pose is off against the first: metres, degrees."""
    off = se2.between(se2.between(truth[0], truth[-1]), se2.between(estimate[0], estimate[-1]))
    return float(np.hypot(off[0], off[1])), abs(math.degrees(float(off[2])))
