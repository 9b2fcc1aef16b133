"""Heading over long drives without revisits: odometry, realigned, with gyroscopes good and bad (`evaluation/smoother.md`)."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.pipeline.track import TrackRows
from lhdmap.proprioception.gyro import GyroSettings
from lhdmap.smoothing.heading import GyroNoise, Heading, fused_heading
from lhdmap.smoothing.heading import Path as PlanarPath

from tools.evaluate.heading_drives import LENGTH_M
from tools.evaluate.heading_runs import Driven, kept


class Bad(NamedTuple):
    """What is wrong with a gyroscope: angle random walk (deg/√h), bias (deg/h, standard deviation), and what else."""

    walk: float
    bias: float
    kind: str = ""


GYROSCOPES = {
    "none": None,
    "0.3 deg/sqrt(h), no bias, and `gyro.bias_deg_h` says so": Bad(0.3, 0.0, "known"),
    "0.3 deg/sqrt(h), 5 deg/h": Bad(0.3, 5.0),
    "... after a rest of 5 min": Bad(0.3, 5.0, "rest"),
    "0.6 deg/sqrt(h), 20 deg/h": Bad(0.6, 20.0),
    "0.6 deg/sqrt(h), 720 deg/h": Bad(0.6, 720.0),
    "noisy: 10 deg/sqrt(h)": Bad(10.0, 720.0),
    "wrong sign": Bad(0.3, 5.0, "sign"),
    "degrees for radians": Bad(0.3, 5.0, "degrees"),
    "another axis (zero)": Bad(0.3, 5.0, "zero"),
    "frozen half-way": Bad(0.3, 5.0, "frozen"),
    "a jump of 5 degrees": Bad(0.3, 5.0, "jump"),
    "bias jumps by 720 deg/h": Bad(0.3, 5.0, "bias"),
    "scale 1 % off": Bad(0.3, 5.0, "scale"),
}
_REST_S, _DRAWS = 300.0, 3
_PLANAR = [0, 1, 5]  # of a pose: x, y, heading


def measured(true_rad: FloatArray, t: FloatArray, bad: Bad, rng: np.random.Generator) -> FloatArray:
    """Return the turn (N,) that a gyroscope tells of a true one at times t (N,), s."""
    steps = np.sqrt(np.diff(t, prepend=t[0]))
    noise = np.radians(bad.walk) / 60.0 * np.cumsum(steps * rng.standard_normal(len(t)))
    turned = true_rad + noise + np.radians(bad.bias * rng.standard_normal()) / 3600.0 * (t - t[0])
    half = len(t) // 2
    late = np.arange(len(t)) > half
    changed: dict[str, FloatArray] = {
        "sign": -turned,
        "degrees": 57.2958 * turned,
        "zero": turned - true_rad,
        "frozen": np.where(late, turned[half], turned),
        "jump": turned + np.radians(5.0) * late,
        "bias": turned + np.radians(720.0) / 3600.0 * np.maximum(t - t[half], 0.0),
        "scale": turned + 0.01 * true_rad,
    }
    return changed.get(bad.kind, turned)


def error_deg(one: Driven, bad: Bad | None, seed: int) -> float:
    """Return the heading's error at the end of a drive with such a gyroscope."""
    times, poses, true_rad = one.final.times_ns, one.final.poses[:, [0, 1, 5]], one.truth.poses[:, 5]
    if bad is not None and bad.kind == "rest":
        rest = np.arange(times[0] - round(_REST_S * 1e9), times[0], 200_000_000)
        times, true_rad = np.append(rest, times), np.append(np.full(len(rest), true_rad[0]), true_rad)
        poses = np.concatenate([np.repeat(poses[:1], len(rest), axis=0), poses])
    heading = poses[:, 2].copy()
    if bad is not None:
        rng = np.random.default_rng(seed)
        turned = measured(true_rad - true_rad[0], (times - times[0]) * 1e-9, bad, rng)
        defaults = GyroSettings()
        told = max(1.2 * bad.walk, 0.25 * defaults.noise_deg_sqrt_h)  # as learned from its readings
        noise = GyroNoise.of(told, 0.2 if bad.kind == "known" else defaults.bias_deg_h, defaults.bias_walk_deg_h)
        found = fused_heading(PlanarPath(times, poses), np.column_stack([turned, np.zeros(len(turned))]), noise)
        heading += found.turned_rad if isinstance(found, Heading) else 0.0
    error = heading - true_rad
    return float(np.degrees(error[-1] - error[0]))


def drift_deg_per_km(path: TrackRows, truth: TrackRows) -> float:
    """Return the heading's error at the end against the start, per kilometre."""
    error = path.poses[:, 5] - truth.poses[:, 5]
    return float(np.degrees(error[-1] - error[0]) / way_m(truth) * 1e3)


def end_m(path: TrackRows, truth: TrackRows) -> float:
    """Return how far the end is off in the plane, both paths from the same start."""
    own, true = (se2.between(rows.poses[0, _PLANAR], rows.poses[-1, _PLANAR]) for rows in (path, truth))
    return float(np.hypot(*(own - true)[:2]))


def way_m(path: TrackRows) -> float:
    """Return the length of a path in the plane."""
    return float(np.hypot(*np.diff(path.poses[:, :2], axis=0).T).sum())


def table(drives: list[Driven]) -> str:
    """Return the table of `evaluation/smoother.md`."""
    rows = ["| | heading, mean of the drives | worst |", "| --- | --- | --- |"]

    def row(name: str, values: list[float]) -> None:
        size = np.abs(values)
        rows.append(f"| {name} | {size.mean():.2f} deg/km | {size.max():.2f} |")

    row("odometry alone", [drift_deg_per_km(one.odometry, one.truth) for one in drives])
    for name, bad in GYROSCOPES.items():
        draws = range(1 if bad is None else _DRAWS)
        row(
            "realigned, no gyroscope" if bad is None else name,
            [1e3 * error_deg(one, bad, 10 * k + n) / way_m(one.truth) for k, one in enumerate(drives) for n in draws],
        )
    heights = [float(np.abs((p := one.final.poses[:, 2] - one.truth.poses[:, 2]) - p[0]).max()) for one in drives]
    ends = [end_m(one.final, one.truth) for one in drives]
    rows += ["", f"End in the plane, realigned: {np.mean(ends):.1f} m off on the mean, {np.max(ends):.1f} m at most."]
    rows += [
        f"Height: {np.mean(heights):.3f} m off at most on the mean of the drives, {np.max(heights):.3f} m in the worst."
    ]
    return "\n".join(rows)


def main() -> None:
    """Simulate and run what is missing, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="where logs and runs are kept")
    parser.add_argument("--drives", type=int, nargs="+", default=list(range(1, 11)), help="numbers of the drives")
    parser.add_argument("--length", type=float, default=LENGTH_M, help="of a drive, m")
    options = parser.parse_args()
    print(table([kept(seed, options.folder, options.length) for seed in options.drives]))


if __name__ == "__main__":
    main()
