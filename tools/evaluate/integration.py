"""Cloud to mesh: how far the cloud's points lie from the walls, with exact poses and with own odometry, over 60 m.

python -m tools.evaluate.integration [--distance METRES] [--seeds N ...]
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from lhdmap.config import Settings
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.pipeline.again import integrate_again
from lhdmap.pipeline.inputs import ROLES_READ, Inputs
from lhdmap.pipeline.mapping import MappingPipeline, feed
from lhdmap.pipeline.track import resample, trajectory_of
from lhdmap.simulation.drive import SimulatedDrive, simulate_drift
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriftSettings, DriveSettings
from lhdmap.simulation.sensing.sections import InclinometerSettings, ScannerSettings
from tests.integration.truth import distances_to_mesh, in_truth_frame, rows_of

from tools.evaluate.figures import Figure, number, write

RESULT = Path(__file__).resolve().parents[2] / "evaluation" / "integration.md"
HEADING = """\
# Integration: cloud to mesh

Written by `python -m tools.evaluate.integration`; not edited by hand. Simulated drifts in space (arched, 12 cm rough, undulating
floor, bends and grades), {distance:g} m driven at 12 km/h; front and rear scanner, 381 beams at 25 Hz, each beam at its own time,
12 mm noise; inclinometer with 0.1° noise and 0.1 s lag. Distance of each cloud point to the nearest triangle; with own odometry
the cloud is put at the true first pose and nothing else is fitted. Worlds {seeds}.
"""


def scenario(seed: int, distance_m: float) -> DriftScenario:
    """Return the drive of the table."""
    pieces = ((20.0, 0.0, -8.0), (12.0, 12.0, -4.0), (16.0, 0.0, 6.0), (12.0, -10.0, 0.0), (distance_m, 0.0, 3.0))
    return DriftScenario(
        seed=seed,
        drift=DriftSettings(pieces=pieces, mesh_m=0.06),
        drive=DriveSettings(distance_m=distance_m, speed_kmh=12.0),
        scanner=ScannerSettings(beams=381, rate_hz=25.0, sweep=True),
        inclinometer=InclinometerSettings(noise_deg=0.1, lag_s=0.1),
    )


def measure(seed: int, distance_m: float) -> dict[str, FloatArray]:
    """Return the distances of the cloud's points to the mesh, metres, by how it was made, and errors of the height (m)."""
    with tempfile.TemporaryDirectory() as folder:
        drive = simulate_drift(
            scenario(seed, distance_m), Path(folder) / "drive.mcap", mesh_path=Path(folder) / "mesh.ply"
        )
        assert drive.mesh_file is not None
        pipeline = mapped(drive.log)
        times = pipeline.records.times_ns
        own = trajectory_of(resample(pipeline.path.final.rows(), times), times)
        cloud = pipeline.sweeps.cloud()
        inputs = Inputs([drive.log], Settings(), {}, "", poses="ground-truth")
        exact = integrate_again(inputs, pipeline, rows_of(drive.truth)).cloud()
        moved = in_truth_frame(own.positions_m, own, drive.truth)
        return {
            "exact": distances_to_mesh(exact.points_m.astype(float), drive.mesh_file),
            "own": distances_to_mesh(in_truth_frame(cloud.points_m.astype(float), own, drive.truth), drive.mesh_file),
            "height": height_errors(moved, drive),
        }


def mapped(log: Path) -> MappingPipeline:
    """Run the pipeline over a log."""
    pipeline = MappingPipeline(Settings(), Machine())
    with LogSource([log]) as source:
        return feed(pipeline, source.messages([role for role in ROLES_READ if role in source.roles]))


def height_errors(positions_m: FloatArray, drive: SimulatedDrive) -> FloatArray:
    """Return the errors of the height (N,), metres, at the scans' stamps."""
    errors: FloatArray = positions_m[:, 2] - drive.truth.positions_m[:, 2]
    return errors


def figures(seeds: list[int], distance_m: float) -> Iterator[Figure]:
    """Measure all worlds."""
    found = [measure(seed, distance_m) for seed in seeds]
    for key, name, targets in (("exact", "exact poses", (0.03, 0.10)), ("own", "own odometry", (0.06, 0.20))):
        for label, share, target in (("median", 50, targets[0]), ("p95", 95, targets[1])):
            each = [float(np.percentile(one[key], share)) for one in found]
            note = ", ".join(f"{value:.4f}" for value in each)
            yield Figure("Cloud to mesh", f"{name}: {label}", float(np.mean(each)), "m", target, note)
    each = [100 * float(np.abs(one["height"]).max()) / distance_m for one in found]
    yield Figure(
        "Height",
        "largest error over the distance driven",
        float(np.mean(each)),
        "%",
        0.2,
        ", ".join(f"{value:.3f}" for value in each),
    )


def main(words: list[str] | None = None) -> int:
    """Measure, print, write the table; 1 where a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--distance", type=float, default=60.0, help="metres driven")
    parser.add_argument("--seeds", nargs="+", type=int, default=[101, 102, 103], help="worlds")
    options = parser.parse_args(words)
    rows = list(figures(options.seeds, options.distance))
    for row in rows:
        print({None: "", True: "ok", False: "MISSED"}[row.ok], row.name, number(row.measured), row.unit, row.note)
    worlds = ", ".join(str(seed) for seed in options.seeds)
    write(RESULT, HEADING.format(distance=options.distance, seeds=worlds), rows)
    return 1 if any(row.ok is False for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
