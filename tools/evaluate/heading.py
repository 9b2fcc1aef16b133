"""Heading over long drives without revisits: odometry, realigned, with gyroscopes good and bad."""

from __future__ import annotations

import argparse
import pickle
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from lhdmap.config import settings_from
from lhdmap.geometry import se3
from lhdmap.logs.source import LogSource
from lhdmap.messages import FloatArray, GroundTruth, LaserScan, PointCloud
from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.pipeline.mounts import machine_of
from lhdmap.pipeline.outcome import ROLES_READ
from lhdmap.pipeline.track import Rows, resample
from lhdmap.proprioception.gyro import GyroSettings
from lhdmap.smoothing.heading import GyroNoise, Heading, fused_heading
from lhdmap.smoothing.heading import Path as Path2

from tools.evaluate.heading_drives import LENGTH_M, drive_of

_SETTINGS = {"pile.method": "off", "topology.method": "off"}


class Driven(NamedTuple):
    """What is kept of a drive: paths at the processed scans by odometry, realigned, and true, key scans, the gyroscope's turn."""

    odometry: Rows
    final: Rows
    truth: Rows
    keys: Any
    gyro: FloatArray


class _Pipeline(MappingPipeline):
    """The pipeline without the cloud."""

    def _hold(self, role: str, time_ns: int, sweep: LaserScan | PointCloud) -> None:
        pass


def driven(log: Path, changes: dict[str, Any] | None = None) -> Driven:
    """Run a log through the pipeline."""
    truth: list[GroundTruth] = []
    settings = settings_from(_SETTINGS | (changes or {}))
    with LogSource([log], {}) as source, _Pipeline(settings, machine_of(source, None)) as pipeline:
        for role, message in source.messages([*(r for r in ROLES_READ if r in source.roles), "ground_truth"]):
            if isinstance(message, GroundTruth):
                truth.append(message)
            else:
                pipeline.update(role, message)
        pipeline.finish()
    odometry = pipeline.track.rows()
    rpy = se3.rpy_from_quaternions(np.array([one.quaternion_xyzw for one in truth]))
    rpy[:, 2] = np.unwrap(rpy[:, 2])
    true = Rows(
        np.array([one.stamp_ns for one in truth], dtype=np.int64),
        np.column_stack([np.array([one.position_m for one in truth]), rpy]),
    )
    keys = [key._replace(points=key.points[:0]) for key in pipeline.smoother.keys.keys]
    times = odometry.times_ns
    return Driven(odometry, pipeline.path.final.rows(), resample(true, times), keys, pipeline.turns.at(times))


def kept(seed: int, folder: Path, length_m: float) -> Driven:
    """Return a drive, run where the folder does not have it."""
    log = drive_of(seed, folder, length_m)
    file = log.with_suffix(".pickle")
    if not file.is_file():
        file.write_bytes(pickle.dumps(driven(log)))
    found = pickle.loads(file.read_bytes())  # noqa: S301
    assert isinstance(found, Driven)
    return found


class Bad(NamedTuple):
    """What is wrong with a gyroscope: angle random walk (deg/√h), bias (deg/h, standard deviation), and what else."""

    walk: float
    bias: float
    kind: str = ""


GYROSCOPES = {
    "none": None,
    "0.3 deg/sqrt(h), bias taken off": Bad(0.3, 0.0),
    "0.3 deg/sqrt(h), 5 deg/h": Bad(0.3, 5.0),
    "... after a rest of 60 s": Bad(0.3, 5.0, "rest"),
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
_REST_S, _DRAWS = 60.0, 3


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
        noise = GyroNoise.of(told, defaults.bias_deg_h, defaults.bias_walk_deg_h)
        found = fused_heading(Path2(times, poses), np.column_stack([turned, np.zeros(len(turned))]), noise)
        heading += found.turned_rad if isinstance(found, Heading) else 0.0
    error = heading - true_rad
    return float(np.degrees(error[-1] - error[0]))


def drift_deg_per_km(path: Rows, truth: Rows) -> float:
    """Return the heading's error at the end against the start, per kilometre."""
    error = path.poses[:, 5] - truth.poses[:, 5]
    return float(np.degrees(error[-1] - error[0]) / way_m(truth) * 1e3)


def way_m(path: Rows) -> float:
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
    ends = [float(np.hypot(*(one.final.poses - one.truth.poses)[-1, :2])) for one in drives]
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
