"""Landmarks of simulated tunnels, and a second drive that looks for them: `evaluation/landmarks.md`.

python -m tools.evaluate.landmarks [--quick]
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import numpy.typing as npt
from lhdmap.geometry import se2
from lhdmap.landmarks.build import landmarks_of, node_surface
from lhdmap.landmarks.icp import align, best_of
from lhdmap.landmarks.model import Landmarks
from lhdmap.landmarks.scans import NodeCloud, along_tunnel
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.landmarks.similarity import icp_model
from lhdmap.landmarks.store import write_landmarks
from lhdmap.landmarks.target import prepare
from lhdmap.messages import FloatArray
from tests.landmarks.worlds import MODERATE, ROUGH, SMOOTH, TunnelWorld, drive, tunnel

RESULT = Path(__file__).resolve().parents[2] / "evaluation" / "landmarks.md"
CLASSES = {"rough, 12 cm": ROUGH, "moderate, 3 cm": MODERATE, "smooth, 5 mm": SMOOTH}
_OFF = np.array([0.3, 0.1, 0.01])
_WRONG_M, _NEAR_M, _NEAR_DEG = 1.0, 0.10, 1.0
_STARTS_M, _SCALES = (0.0, 0.3, 0.5, 1.0, 2.0), (0.0, 0.001, 0.005, 0.01, -0.005)
_SHIFTS = np.column_stack([np.arange(-8.0, 9.0), np.zeros(17), np.zeros(17)])
HEADING = """\
# Landmarks

Written by `python -m tools.evaluate.landmarks`; not edited by hand. {count} tunnels of {length_m:.0f} m of each class, straight
and plain or with bends (15–25 m of radius) and niches (1.5–3 m deep), taught by one drive with a scan each metre at true poses.
Two scanners 7.2 m apart, 190°, 0.5°, 12 mm. A second drive, 0.3 m beside the first, looks for each landmark that has a radius:
what is within it from 0.3 m, 0.1 m and 0.6° away, what is elsewhere from 17 shifts along the axis. *Near*: within 0.10 m and 1°.
*Fits*: fitness up to the threshold. *Wrong*: over 1 m away, and fits. *Gap*: over 15 m of wall.

"""
_COLUMNS = (
    *(
        "walls",
        "have a radius",
        "keys each 100 m",
        "within a radius: near",
        "worst, m and °",
        "of these fit",
        "fits: near",
    ),
    *("wrong of all that fit", "keys mistaken", "not distinctive", "least gap, nats", "kB/m"),
)


class Found(NamedTuple):
    """Of one tunnel: counts as in the table; `errors` (N, 2): m and degrees of what is within a radius, `fits` (N,): of these."""

    landmarks: Landmarks
    errors: FloatArray
    fits: npt.NDArray[np.bool_]
    accepted: int
    wrong: int
    kilobytes: float


def found_in(seed: int, rms_m: float, length_m: float, settings: LandmarkSettings, *, bent: bool) -> Found:
    """Teach a tunnel, drive it again, look for each landmark that has a radius."""
    world = tunnel(seed, rms_m, length_m, bends=bent, niches=bent)
    made = landmarks_of(drive(world, seed=1), {"t": world.frame()}, {"t"}, settings)
    other = along_tunnel(drive(world, seed=77, offset_m=0.3), world.frame(), settings)
    errors, own, accepted, wrong = [], [], 0, 0
    for j in np.flatnonzero(made.radius > 0).tolist():
        for error, near, fits in _looked_for(made, other, j, settings):
            accepted, wrong = accepted + fits, wrong + (fits and error[0] > _WRONG_M)
            if near:
                errors.append(error)
                own.append(fits)
    return Found(made, np.array(errors).reshape(-1, 2), np.array(own, dtype=np.bool_), accepted, wrong, _size_kb(made))


def _looked_for(
    made: Landmarks, other: list[NodeCloud], j: int, settings: LandmarkSettings
) -> Iterator[tuple[tuple[float, float], bool, bool]]:
    """Yield for each cloud of the other drive: its error (m, degrees) on landmark `j`, whether it is near it, whether it fits."""
    model = icp_model(settings)
    target = prepare(made.cloud(j).astype(np.float64), model)
    for i, cloud in enumerate(other):
        true = se2.between(made.poses_node[j], cloud.pose_node_base)
        near = abs(i - j) <= made.radius[j]
        fit = (
            align(target, cloud.points_m, true + _OFF, model)
            if near
            else best_of(target, cloud.points_m, _SHIFTS, model)
        )
        off = se2.between(true, fit.pose)
        error = (math.hypot(off[0], off[1]), abs(math.degrees(off[2])))
        yield error, bool(near), bool(fit.valid and fit.fitness <= made.threshold[j])


def _size_kb(made: Landmarks) -> float:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "landmarks.npz"
        write_landmarks(path, made)
        return path.stat().st_size / 1024.0


def row(name: str, tunnels: list[Found], length_m: float, settings: LandmarkSettings) -> str:
    """Return the line of one class."""
    errors = np.concatenate([one.errors for one in tunnels])
    fits = np.concatenate([one.fits for one in tunnels])
    near = (errors[:, 0] <= _NEAR_M) & (errors[:, 1] <= _NEAR_DEG)
    metres = length_m * len(tunnels)
    radius = np.concatenate([one.landmarks.radius for one in tunnels])
    keys = sum(int(one.landmarks.key.sum()) for one in tunnels)
    accepted = sum(one.accepted for one in tunnels)
    stretches = [s for one in tunnels for s in one.landmarks.not_distinctive_m("t", settings)]
    profiles = [surface.profile for one in tunnels for surface in one.landmarks.surfaces.values()]
    least = min(float(profile.gap.min()) for profile in profiles if profile is not None)
    cells = (
        name,
        f"{100 * np.mean(radius > 0):.0f} %",
        f"{100 * keys / metres:.1f}",
        f"{_share(near)} of {len(near)}",
        f"{errors[:, 0].max(initial=0.0):.3f}, {errors[:, 1].max(initial=0.0):.2f}",
        _share(fits),
        _share(near[fits]),
        f"{sum(one.wrong for one in tunnels)} of {accepted}",
        f"{sum(mistaken(one.landmarks) for one in tunnels)}",
        f"{100 * sum(b - a for a, b in stretches) / metres:.0f} %",
        f"{least:.0f}",
        f"{sum(one.kilobytes for one in tunnels) / metres:.1f}",
    )
    return f"| {' | '.join(cells)} |"


def _share(flags: npt.NDArray[np.bool_]) -> str:
    return f"{100 * flags.mean():.1f} %" if len(flags) else "none"


def mistaken(made: Landmarks) -> int:
    """Return how many pairs of keys fit each other under a threshold."""
    keys = np.flatnonzero(made.key)
    between = made.threshold[keys] >= made.similarity["t"][np.ix_(keys, keys)]
    return int(between.sum() - np.diag(between).sum())


def table(settings: LandmarkSettings, seeds: range, length_m: float) -> Iterator[str]:
    """Yield the lines of one table."""
    yield f"| {' | '.join(_COLUMNS)} |"
    yield "|" + " --- |" * len(_COLUMNS)
    for name, rms_m in CLASSES.items():
        for bent in (False, True):
            tunnels = [found_in(seed, rms_m, length_m, settings, bent=bent) for seed in seeds]
            yield row(f"{name}, {'bends and niches' if bent else 'plain'}", tunnels, length_m, settings)


def capture(seeds: range, length_m: float) -> Iterator[str]:
    """Yield the lines of how far off ICP may start: clouds of the second drive on the same and the next landmark."""
    yield f"| walls | distance | {' | '.join(f'{off:g} m' for off in _STARTS_M)} |"
    yield "|" + " --- |" * (2 + len(_STARTS_M))
    for name, rms_m in CLASSES.items():
        for bent in (False, True):
            worlds = [tunnel(seed, rms_m, length_m, bends=bent, niches=bent) for seed in seeds]
            for fitness in ("line", "point"):
                settings = LandmarkSettings(fitness=fitness)
                errors = np.concatenate([_captured(world, settings) for world in worlds])
                shares = [
                    " / ".join(f"{np.mean(errors[errors[:, 0] == away, 1 + k] <= _NEAR_M):.2f}" for away in (0, 1))
                    for k in range(len(_STARTS_M))
                ]
                yield f"| {name}, {'bends and niches' if bent else 'plain'} | {fitness} | {' | '.join(shares)} |"


def _captured(world: TunnelWorld, settings: LandmarkSettings) -> FloatArray:
    """Return for each pair how many landmarks it is apart, and its errors along the axis by start, m."""
    model = icp_model(settings)
    own, other = (
        along_tunnel(drive(world, seed=seed, offset_m=offset_m), world.frame(), settings)
        for seed, offset_m in ((1, 0.0), (77, 0.3))
    )
    found = []
    for j, cloud in enumerate(own):
        target = prepare(cloud.points_m, model)
        for i in range(max(j - 1, 0), min(j + 2, len(other))):
            true = se2.between(cloud.pose_node_base, other[i].pose_node_base)
            poses = [
                align(target, other[i].points_m, true + np.array([off, 0.1, 0.01]), model).pose for off in _STARTS_M
            ]
            found.append([abs(i - j), *(abs(pose[0] - true[0]) for pose in poses)])
    return np.array(found)


def scales(length_m: float) -> Iterator[str]:
    """Yield the lines of what `Quality` says of maps that are stretched."""
    yield f"| walls | {' | '.join(f'{100 * scale:g} %' for scale in _SCALES)} |"
    yield "|" + " --- |" * (1 + len(_SCALES))
    for name, rms_m in CLASSES.items():
        world, cells = tunnel(3, rms_m, length_m), []
        for scale in _SCALES:
            scans = drive(world, seed=1, scale=1.0 + scale)
            quality = node_surface(scans, world.frame(), LandmarkSettings(), tunnel=True).quality
            cells.append(f"{100 * quality.scale:.2f} ± {100 * quality.scale_std:.2f} %, {quality.kappa:.1f}")
        yield f"| {name} | {' | '.join(cells)} |"


def _printed(lines: Iterable[str]) -> Iterator[str]:
    for line in lines:
        print(line, flush=True)
        yield line


def main(words: list[str] | None = None) -> int:
    """Measure and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one tunnel of 80 m a class; nothing is written")
    quick = parser.parse_args(words).quick
    seeds, length_m, settings = (range(1), 80.0, LandmarkSettings()) if quick else (range(2), 120.0, LandmarkSettings())
    parts = [HEADING.format(count=len(seeds), length_m=length_m)]
    for title, chosen in (
        ("Defaults: point to line, at least 60 % in common", settings),
        ("At least 35 % in common", replace(settings, min_share=0.35)),
        ('Point to point, as in the paper (`landmarks.fitness = "point"`)', replace(settings, fitness="point")),
    ):
        parts += [f"## {title}\n", *_printed(table(chosen, seeds, length_m)), ""]
    for title, lines in (
        (
            "How far off ICP may start along the axis: share within 0.10 m along it, same / next landmark",
            capture(seeds, length_m),
        ),
        ("Scale of maps that are stretched (columns), and kappa", scales(80.0)),
    ):
        parts += [f"## {title}\n", *_printed(lines), ""]
    if not quick:
        RESULT.write_text("\n".join(parts), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
