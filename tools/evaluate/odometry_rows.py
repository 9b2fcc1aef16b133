"""The rows of the odometry's table: each function measures one line of the issue on planar drives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from lhdmap.evaluation.planar_segments import SegmentErrors, planar_segments
from lhdmap.messages import FloatArray
from lhdmap.odometry.planar import PlanarOdometry

from tools.evaluate.figures import Figure
from tools.evaluate.worlds import (
    MODERATE_M,
    SEEDS,
    SMOOTH_M,
    Drive,
    Run,
    end_pct,
    odometry,
    run,
    scans_of,
    wheels_of,
)

SPEEDS_KMH = (6.0, 12.0, 24.0)
_MAP_MEMORY_M = 1.0


def drive_run(drive: Drive, method: str = "anchored", *, wheels: bool = False, range_noise_m: float = 0.012) -> Run:
    """Run the odometry over one drive."""
    truth, scans = scans_of(drive)
    steps = wheels_of(truth, drive.rate_hz, drive.seed) if wheels else None

    def make(velocity: FloatArray | None) -> PlanarOdometry:
        return odometry(method, velocity, range_noise_m=range_noise_m)

    return run(scans, truth, make, steps)


def ten_metres(run_: Run) -> SegmentErrors:
    """Return the errors over 10 m."""
    return planar_segments(run_.estimate, run_.truth)


def range_flow(seeds: Sequence[int]) -> Iterator[Figure]:
    """Range flow with the adaptive rate, at each speed, and its spread over the speeds."""
    group, means = "Range flow with adaptive rate (`odometry.method=range_flow`)", []
    for beams_deg, rate in ((0.5, 50.0), (0.5, 25.0), (0.25, 50.0)):
        for speed in SPEEDS_KMH:
            runs = [drive_run(Drive(seed, speed, rate, step_deg=beams_deg), "range_flow") for seed in seeds]
            mean = float(np.mean([ten_metres(one).translation_pct for one in runs]))
            share = float(np.mean([[step.processed for step in one.steps] for one in runs[:1]]))
            main = (beams_deg, rate) == (0.5, 50.0)
            means += [mean] if main else []
            name = f"{speed:g} km/h, {rate:g} Hz, {_beams(beams_deg)} beams, 10 m"
            yield Figure(group, name, mean, "%", 0.08, f"{100 * share:.0f} % of the scans processed")
    yield Figure(group, "spread over the speeds (largest / smallest), 50 Hz", max(means) / min(means), "", 1.15)


def _beams(step_deg: float) -> int:
    return round(190 / step_deg) + 1


def anchored(seeds: Sequence[int], streams: Sequence[tuple[float, float]]) -> Iterator[Figure]:
    """The default in rough walls: each speed, each stream as (step of the beams in degrees, rate)."""
    group = "Default (anchored), rough walls (12 cm rms)"
    for beams_deg, rate in streams:
        for speed in SPEEDS_KMH:
            runs = [drive_run(Drive(seed, speed, rate, step_deg=beams_deg)) for seed in seeds]
            yield from _anchored_figures(group, f"{speed:g} km/h, {rate:g} Hz, {_beams(beams_deg)} beams", runs)


def _anchored_figures(group: str, name: str, runs: list[Run]) -> Iterator[Figure]:
    short = [ten_metres(one) for one in runs]
    long = [planar_segments(one.estimate, one.truth, 100.0) for one in runs]
    ends = [end_pct(one) for one in runs]
    each = ", ".join(f"{one.translation_pct:.4f}" for one in short)
    yield Figure(group, f"{name}: 10 m", _mean(one.translation_pct for one in short), "%", 0.025, each)
    yield Figure(group, f"{name}: rotation", _mean(one.rotation_deg_per_m for one in short), "°/m", 0.001)
    yield Figure(group, f"{name}: 100 m", _mean(one.translation_pct for one in long), "%", 0.02)
    yield Figure(group, f"{name}: end point", _mean(ends), "%", 0.05, ", ".join(f"{end:.3f}" for end in ends))


def _mean(values: Iterator[float] | Sequence[float]) -> float:
    return float(np.mean(list(values)))


def disturbed(seeds: Sequence[int]) -> Iterator[Figure]:
    """Noise, short range, dust; 12 km/h."""
    group = "Disturbances, 12 km/h, 381 beams (anchored, 10 m)"
    for rate in (25.0, 50.0):
        base = Drive(rate_hz=rate)
        cases: tuple[tuple[str, Drive, float, float], ...] = (
            ("25 mm noise", replace(base, noise_m=0.025), 0.012, 0.05),
            ("25 mm noise, told (`range_noise_m`)", replace(base, noise_m=0.025), 0.025, 0.05),
            ("10 m range", replace(base, max_range_m=10.0), 0.012, 0.04),
            ("dust, mixed pixels, drop-outs", replace(base, dusty=True), 0.012, 0.05),
        )
        for name, drive, told_m, target in cases:
            errors = [
                ten_metres(drive_run(replace(drive, seed=seed), range_noise_m=told_m)).translation_pct for seed in seeds
            ]
            each = ", ".join(f"{e:.4f}" for e in errors)
            yield Figure(group, f"{name}, {rate:g} Hz", _mean(errors), "%", target, each)


def sweep(seeds: Sequence[int]) -> Iterator[Figure]:
    """Sweep distortion at 24 km/h and 25 Hz, as a ratio to the undistorted drive."""
    group, drive = "Sweep distortion, 24 km/h, 25 Hz (anchored, 10 m)", Drive(speed_kmh=24.0)
    plain = _mean([ten_metres(drive_run(replace(drive, seed=seed))).translation_pct for seed in seeds])
    swept = _mean([ten_metres(drive_run(replace(drive, seed=seed, sweep=True))).translation_pct for seed in seeds])
    yield Figure(group, "undistorted", plain, "%")
    yield Figure(group, "each beam at its own time", swept, "%")
    yield Figure(group, "ratio", swept / plain, "", 1.2)


def smooth(seeds: Sequence[int]) -> Iterator[Figure]:
    """Moderate and smooth walls, with flags and covariance; smooth with slipping wheels; 12 km/h."""
    for rate in (25.0, 50.0):
        group = f"Moderate (3 cm) and smooth (5 mm) walls, 12 km/h, {rate:g} Hz (anchored)"
        moderate = [drive_run(Drive(seed, rate_hz=rate, rms_m=MODERATE_M)) for seed in seeds]
        errors = [ten_metres(one).translation_pct for one in moderate]
        yield Figure(group, "moderate: 10 m", _mean(errors), "%", 0.04, _each(errors))
        yield Figure(group, "moderate: weak scans", 100 * _weak_share(moderate), "%")
        runs = [drive_run(Drive(seed, rate_hz=rate, rms_m=SMOOTH_M)) for seed in seeds]
        yield from _smooth_figures(group, "smooth", runs, 0.5)
        wheeled = [drive_run(Drive(seed, rate_hz=rate, rms_m=SMOOTH_M), wheels=True) for seed in seeds]
        yield from _smooth_figures(group, "smooth, tachometer (1 % scale, slip bursts of 2 s)", wheeled, 0.3)


def _smooth_figures(group: str, name: str, runs: list[Run], target: float) -> Iterator[Figure]:
    found = [ten_metres(one) for one in runs]
    errors = [one.translation_pct for one in found]
    nees = np.concatenate([along_nees(one, errors_) for one, errors_ in zip(runs, found, strict=True)])
    yield Figure(group, f"{name}: 10 m", _mean(errors), "%", target, _each(errors))
    yield Figure(group, f"{name}: worst segment", max(one.worst_pct for one in found), "%", 5.0)
    yield Figure(group, f"{name}: weak scans", 100 * _weak_share(runs), "%", note="flagged degenerate")
    note = f"median {np.median(nees):.2f} (0.45 where true); share under 3.84: {np.mean(nees < 3.84):.2f} (0.95)"
    yield Figure(group, f"{name}: NEES along, 10 m segments, mean", float(nees.mean()), "", None, note)


def _each(values: Sequence[float]) -> str:
    return ", ".join(f"{value:.3f}" for value in values)


def _weak_share(runs: list[Run]) -> float:
    return float(np.mean([step.degenerate for one in runs for step in one.steps if step.processed]))


def along_nees(run_: Run, errors: SegmentErrors) -> FloatArray:
    """Return the squared error along over its variance for each segment (M,).

    The pose's covariance is relative to the local map, which is renewed over `_MAP_MEMORY_M`: what it forgets adds up.
    """
    used = [k for k, step in enumerate(run_.steps) if step.processed]
    variance = np.array([run_.steps[k].covariance[0, 0] for k in used])
    path = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(run_.truth[used, :2], axis=0).T))])
    kept = variance * (1.0 - np.exp(-np.diff(path, prepend=0.0) / _MAP_MEMORY_M))
    total = np.concatenate([[0.0], np.cumsum(kept)])
    first, last = np.searchsorted(used, errors.spans[:, 0]), np.searchsorted(used, errors.spans[:, 1])
    last = np.minimum(last, len(used) - 1)
    spent = total[last + 1] - total[first] + variance[last]
    ratio: FloatArray = errors.vectors[:, 0] ** 2 / np.maximum(spent, 1e-12)
    return ratio


__all__ = ["SEEDS", "anchored", "disturbed", "drive_run", "range_flow", "smooth", "sweep", "ten_metres"]
