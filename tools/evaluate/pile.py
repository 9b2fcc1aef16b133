"""The pile against the truth of simulated scenes, with exact poses and from the log alone, at a true distance of 15 and 25 m.

python -m tools.evaluate.pile [--seeds N] [--first SEED] [--hard N]
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from lhdmap.config import Settings
from lhdmap.pile.result import PileEstimate, PileReport, Snapshot
from lhdmap.pipeline.identify import identify
from lhdmap.simulation.drive import simulate_drift
from lhdmap.simulation.pile_facts import PileTruth
from lhdmap.simulation.pile_scenes import scene
from lhdmap.simulation.pile_truth import plane_over
from lhdmap.simulation.world import DriftWorld

from tools.evaluate.pile_seen import seen_height_m

RESULT = Path(__file__).resolve().parents[2] / "evaluation" / "pile.md"
MAIN = ("normal", "stope", "too_shallow", "wall", "hang_up", "boulder")
HARD = (
    "low_wall",
    "empty_stope",
    "side_opening",
    "machine",
    "post",
    "spill",
    "dust",
    "skewed",
    "bulging",
    "asymmetric",
    "concave",
)
_SEEN_M = 0.3
POSES = {"exact": "ground-truth", "own": ""}


class Row(NamedTuple):
    """One scene with one kind of poses: errors of width (m) and inclination (deg) at 15 m in sigmas, too; NaN: none."""

    variant: str
    poses: str
    status: str
    found: str
    width_m: float
    inclination_deg: float
    width_sigmas: float
    inclination_sigmas: float
    far_deg: float
    bound_deg: float
    loadable: float
    boulders: tuple[int, int]
    seen_m: float


def rows_of(job: tuple[str, int]) -> list[Row]:
    """Simulate a scene and measure it with both kinds of poses."""
    variant, seed = job
    with tempfile.TemporaryDirectory() as folder:
        scenario = scene(variant, seed)
        drive = simulate_drift(scenario, Path(folder) / "scene.mcap")
        if drive.pile is None:
            return []
        distances = drive.pile.distances_m(drive.truth.positions_m)
        stamps = drive.truth.stamps_ns
        at = [
            int(stamps[np.flatnonzero(distances <= limit)[0]]) if (distances <= limit).any() else 0
            for limit in (15.0, 25.0)
        ]
        world = DriftWorld(scenario)
        seen_m = seen_height_m(drive.log, drive.pile, at[1])
        return [
            _row((variant, poses), (world, drive.pile), identify(drive.log, Settings(), given), at, seen_m)
            for poses, given in POSES.items()
        ]


def _row(
    kind: tuple[str, str],
    scene_: tuple[DriftWorld, PileTruth],
    report: PileReport,
    at_ns: Sequence[int],
    seen_m: float,
) -> Row:
    world, truth = scene_
    near, far = (_until(report, stamp_ns) for stamp_ns in at_ns)
    best, early = near or PileEstimate(), far or PileEstimate()
    width, slope = best.width_m - truth.width_m, best.inclination_deg - truth.inclination_deg
    return Row(
        *kind,
        truth.status,
        best.status or "none",
        width,
        slope,
        width / best.width_std_m,
        slope / best.inclination_std_deg,
        early.inclination_deg - truth.inclination_deg if early.status != "none" else np.nan,
        _bound_deg(world, truth, best),
        best.probabilities.get("loadable", 0.0),
        (len(truth.boulders), len(best.boulders)),
        seen_m,
    )


def _bound_deg(world: DriftWorld, truth: PileTruth, seen: PileEstimate) -> float:
    """Return by how much the mesh's own slope over the heights that were seen differs from that over the defined ones."""
    if not seen.found or not np.isfinite(truth.inclination_deg):
        return np.nan
    low, high = (min(max(height, 0.2), 1.6) for height in seen.heights_m)
    plane = plane_over(world, truth, (low, high)) if high - low > 0.25 else None
    return np.nan if plane is None else plane.inclination_deg - truth.inclination_deg


def _until(report: PileReport, stamp_ns: int) -> PileEstimate | None:
    """Return the newest estimate of a face at a moment."""
    found: list[Snapshot] = [one for one in report.history if one.stamp_ns <= stamp_ns and one.estimate.found]
    return found[-1].estimate if found else None


def _statistics(values: Sequence[float]) -> str:
    known = np.abs([value for value in values if np.isfinite(value)])
    if not known.size:
        return "- | - | -"
    return f"{np.median(known):.2f} | {known.mean():.2f} | {np.percentile(known, 90):.2f}"


def _largest(values: Sequence[float]) -> str:
    known = np.abs([value for value in values if np.isfinite(value)])
    return f"{known.max():.1f}" if known.size else "-"


def _bound(rows: Sequence[Row]) -> str:
    known = np.abs([row.bound_deg for row in rows if np.isfinite(row.bound_deg)])
    return f"{known.mean():.2f} / {np.percentile(known, 90):.2f}" if known.size else "-"


def _line(variant: str, poses: str, rows: Sequence[Row]) -> str:
    sigmas = [
        [abs(row.width_sigmas) <= 2.0, abs(row.inclination_sigmas) <= 2.0]
        for row in rows
        if np.isfinite(row.width_sigmas)
    ]
    inside = "/".join(f"{100 * share:.0f}" for share in np.mean(sigmas, axis=0)) if sigmas else "-"
    measured = sum(bool(np.isfinite(row.inclination_deg)) for row in rows)
    right = np.mean([row.status == row.found for row in rows])
    confident = sum(row.loadable > 0.9 for row in rows if row.status != "loadable")
    seen = f"{sum(row.boulders[1] > 0 for row in rows)} of {len(rows)}"
    return (
        f"| {variant} | {poses} | {measured} of {len(rows)} | {_statistics([row.width_m for row in rows])} "
        f"| {_statistics([row.inclination_deg for row in rows])} | {_bound(rows)} | {inside} "
        f"| {sum(row.seen_m > _SEEN_M for row in rows)} "
        f"| {sum(bool(np.isfinite(row.far_deg)) for row in rows)} of {len(rows)} "
        f"| {_statistics([row.far_deg for row in rows])} | {_largest([row.far_deg for row in rows])} "
        f"| {100 * right:.0f} | {confident} | {seen} |"
    )


def table(rows: Sequence[Row], seeds: str) -> str:
    """Return the document."""
    head = (
        "# The ore pile\n\nWritten by `python -m tools.evaluate.pile`; not edited by hand. Scenes of `lhdmap simulate pile` "
        f"({seeds}); truth from the mesh. At a true 15 m from the toe: scenes in which a face with a true inclination was "
        "measured, of all; of these errors of width (m) and inclination (deg) as median, mean "
        "and 90th percentile of the absolute value; bound (mean / p90): by how much the slope of the "
        "mesh itself over the heights that were seen until then differs from the defined one; "
        "share within two standard deviations (width/inclination, %), "
        "at 25 m scenes in which the face was hit by then over more than 0.3 m of height (true poses; the others nobody can "
        "measure), and inclination where a status other than none was reported, status right at 15 m (%), "
        "scenes that are not loadable and called so with more than 90 %, scenes with a boulder found.\n\n"
        "| variant | poses | measured | width median | mean | p90 | inclination median | mean | p90 | bound | in 2 σ "
        "| 25 m: hit | reported | median | mean | p90 | largest "
        "| status | falsely loadable | boulders |\n" + "|---" * 20 + "|\n"
    )
    lines = []
    for variant in (*MAIN, *HARD):
        for poses in POSES:
            chosen = [row for row in rows if row.variant == variant and row.poses == poses]
            if chosen:
                lines.append(_line(variant, poses, chosen))
    return head + "\n".join(lines) + "\n"


def main() -> None:
    """Write the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--hard", type=int, default=10)
    parser.add_argument("--first", type=int, default=3000)
    words = parser.parse_args()
    jobs = [(variant, words.first + k) for k in range(words.seeds) for variant in MAIN]
    jobs += [(variant, words.first + k) for k in range(words.hard) for variant in HARD]
    with ProcessPoolExecutor(2) as pool:
        rows = [row for found in pool.map(rows_of, jobs) for row in found]
    RESULT.write_text(
        table(rows, f"{words.seeds} seeds a main variant, {words.hard} of the others, from {words.first}"), "utf-8"
    )


if __name__ == "__main__":
    main()
