"""What it costs to ask for the pose of now: `MappingPipeline.pose_at` against the pose that comes later: `evaluation/pose_now.md`.

python -m tools.evaluate.pose_now
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lhdmap.config import Settings
from lhdmap.geometry import se3
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.pipeline.mapping import MappingOptions, MappingPipeline
from lhdmap.pipeline.pose_now import PoseNow
from lhdmap.pipeline.track import FinalTrack, TrackRows
from lhdmap.simulation.drive import simulate_drift
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriftSettings, DriveSettings

RESULT = Path(__file__).resolve().parents[2] / "evaluation" / "pose_now.md"
AGES_S = (0.1, 0.2, 0.3, 0.4, 0.5)
SEEDS = (21, 22)
HEADING = """\
# A pose at any time

Written by `python -m tools.evaluate.pose_now`; not edited by hand. The pipeline's poses come late: the inclinometer's filter
waits for samples behind a scan. `MappingPipeline.pose_at(now)` carries the newest one on, by wheels and joint where the log has
them, else by the last motion, with the attitude of now. Below: how far it is from the pose that the pipeline gives for the same
moment later (rms), {seeds} simulated drives a row of 60 m through rough walls with bends and grades. At 0.1 and 0.2 s the wheels
of that moment are there already, at 0.4 and 0.5 s mostly not.

| km/h | sensors | age, s | along, mm | across, mm | height, mm | heading, mrad | in 2 σ, % |
| --- | --- | --- | --- | --- | --- | --- | --- |
"""


class Asked(NamedTuple):
    """What was asked: the age (s) that was asked for, and the answer."""

    age_s: float
    pose: PoseNow


def answers(log: Path, *, wheels: bool) -> tuple[list[Asked], TrackRows]:
    """Drive through a log and ask at each new pose; return the answers, and the path that was known in the end."""
    pipeline, asked, newest_ns = MappingPipeline(Settings(), Machine(), MappingOptions(cloud=False)), [], 0
    roles = ["front", "inclinometer", "tf_static", *(["joints", "tachometer"] if wheels else [])]
    with LogSource([log]) as source, pipeline:
        for role, message in source.messages(roles):
            pipeline.update(role, message)
            last_ns = pipeline.track.last_ns
            if last_ns is not None and last_ns > newest_ns:
                newest_ns = last_ns
                poses = [(age, pipeline.pose_at(last_ns + round(age * 1e9))) for age in AGES_S]
                asked += [Asked(age, pose) for age, pose in poses if pose is not None]
        pipeline.finish()
    return asked, pipeline.track.rows()


def errors(asked: list[Asked], known: TrackRows) -> FloatArray:
    """Return along, across, height (m), heading (rad) and whether the planar error is within 2 sigma, shape (N, 5)."""
    path, end_ns = FinalTrack(known), known.times_ns[-1]
    rows = []
    for one in asked:
        if one.pose.stamp_ns > end_ns:
            continue
        T_later = path.matrices_at(np.array([one.pose.stamp_ns]))[0]
        T = se3.inverse(T_later) @ one.pose.T_odom_base
        heading = float(np.arctan2(T[1, 0], T[0, 0]))
        off = np.array([T[0, 3], T[1, 3], heading])
        within = float(off @ np.linalg.solve(one.pose.covariance, off)) < 8.02  # chi-square, three degrees, 95.4 %
        rows.append((T[0, 3], T[1, 3], T_later[2, 3] - one.pose.T_odom_base[2, 3], heading, float(within)))
    return np.array(rows).reshape(-1, 5)


def drive(folder: Path, seed: int, speed_kmh: float) -> Path:
    """Simulate a drive; return its log."""
    scenario = DriftScenario(seed=seed, drift=DriftSettings(mesh_m=0.1), drive=DriveSettings(60.0, speed_kmh))
    return simulate_drift(replace(scenario, truth=False), folder / f"{seed}_{speed_kmh:.0f}.mcap").log


def table(folder: Path) -> Iterator[str]:
    """Yield the rows."""
    for speed_kmh in (12.0, 24.0):
        logs = [drive(folder, seed, speed_kmh) for seed in SEEDS]
        for name, wheels in (("wheels and joint", True), ("none", False)):
            found = [answers(log, wheels=wheels) for log in logs]
            for age in AGES_S:
                parts = [errors([one for one in asked if one.age_s == age], known) for asked, known in found]
                rows = np.concatenate(parts)
                along, across, height, heading = 1e3 * np.sqrt(np.mean(rows[:, :4] ** 2, axis=0))
                within = 100.0 * rows[:, 4].mean()
                yield (
                    f"| {speed_kmh:.0f} | {name} | {age:.1f} | {along:.1f} | {across:.1f} | {height:.1f} | {heading:.2f} "
                    f"| {within:.0f} |"
                )


def main() -> int:
    """Measure, print and write the table."""
    with tempfile.TemporaryDirectory() as folder:
        lines = []
        for line in table(Path(folder)):
            print(line, flush=True)
            lines.append(line)
    RESULT.write_text(HEADING.format(seeds=len(SEEDS)) + "\n".join(lines) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
