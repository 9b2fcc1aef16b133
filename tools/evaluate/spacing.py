"""How far apart compared scans should be: the table behind the adaptive frame rate, `evaluation/spacing.md`.

python -m tools.evaluate.spacing
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from lhdmap.messages import FloatArray
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.settings import OdometrySettings, RangeFlowSettings

from tools.evaluate.figures import Figure, number, write
from tools.evaluate.odometry_rows import ten_metres
from tools.evaluate.worlds import Drive, run, scans_of

RESULT = Path(__file__).resolve().parents[2] / "evaluation" / "spacing.md"
WORLDS = (1, 2)  # settings are chosen here, and judged on the worlds of odometry.md
HEADING = """\
# Spacing of compared scans

Written by `python -m tools.evaluate.spacing`; not edited by hand. Translation error over 10 m, rough walls, 381 beams at 50 Hz;
worlds that settings are chosen on, not those of `odometry.md`.
"""


def error_pct(speed_kmh: float, odometry: OdometrySettings, range_flow: RangeFlowSettings) -> tuple[float, float]:
    """Return the error over 10 m and the share of scans processed, means over the worlds."""

    def make(velocity: FloatArray | None) -> PlanarOdometry:
        return PlanarOdometry(odometry, range_flow=range_flow, velocity=velocity)

    found = []
    for seed in WORLDS:
        truth, scans = scans_of(Drive(seed, speed_kmh, 50.0))
        one = run(scans, truth, make)
        found.append((ten_metres(one).translation_pct, float(np.mean([step.processed for step in one.steps]))))
    error, share = np.mean(np.array(found), axis=0)
    return float(error), float(share)


def figures() -> Iterator[Figure]:
    """Measure references of range flow alone, then scans of the default."""
    base, flow = OdometrySettings(method="range_flow"), RangeFlowSettings()
    for references in (1, flow.references):
        group = f"Range flow, {references} reference(s), by the travel between references (`range_flow.spacing_m`)"
        for spacing_m in (0.1, 0.2, 0.35, 0.5, 0.7, 1.0, 1.4):
            settings = replace(flow, spacing_m=spacing_m, references=references)
            error, _ = error_pct(12.0, base, settings)
            yield Figure(group, f"{spacing_m:g} m", error, "%")
    for speed in (6.0, 24.0):
        group = f"Default, {speed:g} km/h, by the travel between processed scans (`odometry.step_m`)"
        for step_m in (0.0, 0.08, 0.16, 0.32):
            error, share = error_pct(speed, OdometrySettings(step_m=step_m), flow)
            yield Figure(group, f"{step_m:g} m", error, "%", note=f"{100 * share:.0f} % of the scans processed")


def main() -> int:
    """Measure, print, write."""
    rows = []
    for row in figures():
        rows.append(row)
        print(row.group[:40], row.name, number(row.measured), row.unit, row.note, flush=True)
    write(RESULT, HEADING, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
