"""Starts from nothing in planar mines of 3 km, and machines put into another tunnel: `evaluation/localization.md`, "Starts".

    python -m tools.evaluate.localization_starts [--starts N] [--moved N] [--kind NAME] [--seed N]

A third of the starts, and half of the machines that are moved, are in tunnels that the map does not have.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from lhdmap.config import Settings
from lhdmap.geometry import se2
from lhdmap.localization.rows import TRACKING
from lhdmap.localization.search import GlobalSearch
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray
from lhdmap.odometry.steps import OdometryStep
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.pipeline.localize import Localizer

from tools.evaluate.localization_worlds import KINDS, SCAN_EVERY_M, TUNNELS, LiveScan, Taught, drive_through, taught

UNMAPPED = 5  # tunnels that are not in the map
REACH_M, AFTER_M = 45.0, 5.0
WRONG_M, WRONG_RAD = 1.0, math.radians(10.0)
RATE_HZ = 10.0
PER_DRIVE = 20


class Start(NamedTuple):
    """What came of one: whether the map has the place, travel until it tracked (inf: never), whether it ever tracked wrongly."""

    mapped: bool
    first_m: float
    wrong: bool
    searches: int


class Prepared(KnownMap):
    """A map whose search was made once."""

    made: dict[int, GlobalSearch] = {}  # noqa: RUF012  # of all maps, by identity of the topology

    def search(self, walls: MapWalls, settings: Settings) -> GlobalSearch:
        """Return what searches it."""
        key = id(self.topology)
        if key not in self.made:
            self.made[key] = KnownMap(*self).search(walls, settings)
        return self.made[key]


def driven(known: KnownMap, scans: Sequence[LiveScan], start: FloatArray | None = None) -> Iterator[Localizer]:
    """Yield the localizer after each scan of a drive."""
    with Localizer(known, Settings(), None, start) as localizer:
        for k, scan in enumerate(scans):
            stamp = round(k / RATE_HZ * 1e9)
            covariance = np.diag([(0.002 * SCAN_EVERY_M) ** 2, 0.001**2, math.radians(0.01) ** 2])
            step = OdometryStep(
                stamp, stamp, scan.odom, covariance, np.array([3.6, 0.0, 0.0]), np.zeros(3), 0.0, 1.0, False, "",
                True, False, error=SimpleNamespace(covariance=covariance),  # type: ignore[arg-type]
            )  # fmt: skip
            odometry = SimpleNamespace(
                points=scan.points, points_behind=np.zeros((0, 2)), gyro=SimpleNamespace(turn_rad=None)
            )
            localizer.take(stamp, step, odometry)  # type: ignore[arg-type]
            yield localizer


def started(mine: Taught, known: KnownMap, number: int, scans: Sequence[LiveScan]) -> Start:
    """Return what comes of a start at the first of some scans."""
    first_m, wrong, searches = math.inf, False, 0
    for k, localizer in enumerate(driven(known, scans)):
        row, way_m = localizer.rows[-1], k * SCAN_EVERY_M
        searches = len(localizer.searches)
        if row.status != TRACKING:
            continue
        first_m = min(first_m, way_m)
        if number >= TUNNELS:
            wrong = True
        else:
            off = se2.between(mine.on_map(number, scans[k].true), np.array([row.x_m, row.y_m, row.yaw_rad]))
            wrong = wrong or math.hypot(off[0], off[1]) > WRONG_M or abs(off[2]) > WRONG_RAD
        if way_m > first_m + AFTER_M:
            break
    return Start(number < TUNNELS, first_m, wrong, searches)


def starts_of(kind: str, seed: int, count: int) -> Iterator[Start]:
    """Yield what comes of starts anywhere in a mine, in both directions, a third of them in tunnels that are not mapped."""
    mine, rng = taught(kind, seed), np.random.default_rng([seed, 77])
    known = Prepared(*mine.known)
    reach = round(REACH_M / SCAN_EVERY_M)
    for drive in range(-(-count // PER_DRIVE)):
        number = int(rng.integers(TUNNELS, TUNNELS + UNMAPPED) if drive % 3 == 2 else rng.integers(TUNNELS))
        scans = drive_through(kind, seed, number, drive)
        for _ in range(min(PER_DRIVE, count - drive * PER_DRIVE)):
            first = int(rng.integers(len(scans) - reach))
            yield started(mine, known, number, scans[first : first + reach])


def moved_of(kind: str, seed: int, count: int) -> Iterator[tuple[bool, float]]:
    """Yield of machines put into another tunnel, lateral place and heading right: whether it is mapped, travel until noticed."""
    mine, rng = taught(kind, seed), np.random.default_rng([seed, 78])
    known = Prepared(*mine.known)
    reach = round(REACH_M / SCAN_EVERY_M)
    for one in range(count):
        number = int(rng.integers(TUNNELS, TUNNELS + UNMAPPED) if one % 2 else rng.integers(TUNNELS))
        scans = drive_through(kind, seed, number, int(rng.integers(50, 52)))
        first = int(rng.integers(len(scans) - reach))
        other = int(rng.choice([k for k in range(TUNNELS) if k != number]))
        place = int(rng.integers(50, len(mine.said[other]) - 150))
        start = np.append(mine.said[other][place], 0.0)
        noticed_m = math.inf
        for k, localizer in enumerate(driven(known, scans[first : first + reach], start)):
            if localizer.rows[-1].status != TRACKING:
                noticed_m = k * SCAN_EVERY_M
                break
        yield number < TUNNELS, noticed_m


def row_of(kind: str, starts: Sequence[Start], moved: Sequence[tuple[bool, float]]) -> str:
    """Return a row of the table."""
    mapped = np.array([one.first_m for one in starts if one.mapped])
    shares = [f"{np.mean(mapped <= way):.0%}" for way in (9.0, 15.0, 25.0, 40.0)]
    wrong = [sum(one.wrong for one in starts if one.mapped == which) for which in (True, False)]
    counts = [sum(one.mapped == which for one in starts) for which in (True, False)]
    noticed = np.array([way for _, way in moved])
    told = [f"{np.mean(noticed <= way):.0%}" for way in (3.0, 20.0, 40.0)] if len(noticed) else ["", "", ""]
    median = float(np.median(mapped)) if len(mapped) else math.nan
    return (
        f"| {kind} | {' / '.join(shares)} | {median:.1f} m | {wrong[0]} of {counts[0]} | {wrong[1]} of {counts[1]} "
        f"| {' / '.join(told)} of {len(noticed)} |"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, a row a kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=1000, help="a kind")
    parser.add_argument("--moved", type=int, default=60, help="machines put into another tunnel, a kind")
    parser.add_argument("--kind", choices=list(KINDS), action="append", help="default: all")
    parser.add_argument("--seed", type=int, default=1, help="of the first mine; each 250 starts are in another one")
    asked = parser.parse_args(arguments)
    ways = "found within 9 / 15 / 25 / 40 m | median | wrong, mapped | wrong, unmapped | moved: noticed within 3 / 20 / 40 m"
    print(f"| walls | {ways} |")
    print("| --- | --- | --- | --- | --- | --- |")
    for kind in asked.kind or KINDS:
        starts, moved = [], []
        for mine in range(max(-(-asked.starts // 250), 1)):
            starts += list(starts_of(kind, asked.seed + mine, min(asked.starts - 250 * mine, 250)))
            if mine == 0:
                moved = list(moved_of(kind, asked.seed, asked.moved))
            print(row_of(kind, starts, moved), flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
