"""Loop closures: false ones among them, and a decline whose legs are alike: `evaluation/closures.md`.

python -m tools.evaluate.closures [--quick]
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from lhdmap.geometry import se2
from lhdmap.smoothing.evidence import Evidence
from lhdmap.smoothing.robust import judged
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.smoother import Smoother
from tests.smoothing.decline import Drive, Return, decline, driven
from tests.smoothing.loops import Falsehood, least_squares, rmse_m, twice_round

RESULT = Path(__file__).resolve().parents[2] / "evaluation" / "closures.md"
_FALSE_M, _FALSE_RAD, _LEVEL_M = 0.5, math.radians(3.0), 2.0
_SEEN_AGAIN = 8  # keys from the turn on: a place counts as seen again after 15 m of travel
HEADING = """\
# Loop closures

Written by `python -m tools.evaluate.closures`; not edited by hand.

## False ones among the closures

Two laps of a circle, 500 poses 2 m apart, 30 right closures (5 cm, 0.5°), {seeds} seeds. False ones join poses anywhere (random)
or take one stretch for another, all alike (block). The RMSE is that of all poses in the first one's frame, by plain least squares
over the closures that were kept; the oracle's has all right ones and no false one.
"""
_GNC = (
    "false ones",
    "share",
    "false kept",
    "right lost",
    "RMSE, median m",
    "of the oracle's, worst",
    "seconds, median",
)
DECLINE = """
## A decline whose legs are alike

Six legs of 60 m with equal stubs, joined by U-bends, driven down, then half of it up again, a key scan each metre (190°, 30 m,
12 mm). Walls are the same to the millimetre (0), or rough, each leg for itself. *False*: accepted, and of another place or over
0.5 m or 3° off; *found*: accepted and right, of the keys that are at a place seen 15 m of travel before. *Drift*: by the odometry,
largest on the drive, m.
Sums of {seeds} seeds. Stacked: every second leg lies under another, heights by an inclinometer; the others are planar logs.
"""
_DECLINE = ("legs", "drift", "walls, m", "comes back", "false", "found", "why not, most often", "seconds each")


class Counted(NamedTuple):
    """Of one drive: false closures that were accepted, keys with a right one, keys that could have one, drift (m), seconds."""

    false: int
    right: int
    possible: int
    drift_m: float
    seconds: float
    reasons: list[str]


def false_among(kind: Falsehood, share: float, seeds: range) -> str:
    """Return the line of one sort of false closures."""
    rows = []
    for seed in seeds:
        loops = twice_round(seed, kind, share)
        began = time.perf_counter()
        kept = judged(loops.odometry, loops.steps, loops.ties).kept
        spent = time.perf_counter() - began
        own, best = (rmse_m(loops, least_squares(loops, used)) for used in (kept, loops.right))
        rows.append([(kept & ~loops.right).sum(), (~kept & loops.right).sum(), own, own / best, spent])
    table = np.array(rows)
    right = 30 * len(seeds)
    cells = (
        kind if share else "none",
        f"{100 * share:.0f} %",
        f"{table[:, 0].sum():.0f}",
        f"{table[:, 1].sum():.0f} of {right}",
        f"{np.median(table[:, 2]):.2f}",
        f"{table[:, 3].max():.2f}",
        f"{np.median(table[:, 4]):.1f}",
    )
    return f"| {' | '.join(cells)} |"


def counted(drive: Drive) -> Counted:
    """Close the loops of a drive and compare them with the truth."""
    smoother = Smoother(SmoothingSettings())
    smoother.keys.keys = drive.keys
    began = time.perf_counter()
    level = np.zeros((len(drive.keys), 2))
    smoother.correction(floor=lambda _: np.column_stack([drive.heights_m, level]))
    spent = time.perf_counter() - began
    accepted = [one for one in smoother.evidence if one.accepted]
    right = {one.current_ns for one in accepted if is_right(one, drive)}
    wrong = [one for one in accepted if not is_right(one, drive)]
    drift = max(math.hypot(*(key.pose - true)[:2]) for key, true in zip(drive.keys, drive.true, strict=True))
    reasons = [one.reason for one in smoother.evidence if not one.accepted]
    first = drive.keys[drive.turn + _SEEN_AGAIN].time_ns if len(drive.keys) > drive.turn + _SEEN_AGAIN else 0
    again = sum(key.time_ns >= first for key in drive.keys)
    return Counted(len(wrong), sum(at >= first for at in right), again, drift, spent, reasons)


def is_right(one: Evidence, drive: Drive) -> bool:
    """Return whether a closure joins what belongs together."""
    rows = {key.time_ns: row for row, key in enumerate(drive.keys)}
    a, b = rows[one.earlier_ns], rows[one.current_ns]
    off = se2.between(se2.between(drive.true[a], drive.true[b]), one.offset)
    level = abs(float(drive.heights_m[a] - drive.heights_m[b])) < _LEVEL_M
    return level and math.hypot(off[0], off[1]) < _FALSE_M and abs(float(se2.wrap(off[2]))) < _FALSE_RAD


def alike(apart_m: float, scale: float, rough_m: float, back: Return, seeds: range, *, stacked: bool) -> str:
    """Return the line of one kind of decline."""
    found = []
    for seed in seeds:
        mine = decline(seed, rough_m, apart_m, stacked=stacked)
        found.append(counted(driven(mine, seed, back, scale=scale, heights=stacked)))
    reasons = [reason for one in found for reason in one.reasons]
    most = max(set(reasons), key=reasons.count, default="")
    cells = (
        f"{apart_m:g} m apart" + (", stacked" if stacked else ""),
        f"{max(one.drift_m for one in found):.1f}",
        f"{rough_m:g}",
        "turned round" if back == "turned" else "in reverse gear",
        f"{sum(one.false for one in found)}",
        f"{100 * sum(one.right for one in found) / sum(one.possible for one in found):.0f} %",
        f"{most} ({reasons.count(most)})" if most else "",
        f"{np.mean([one.seconds for one in found]):.0f}",
    )
    return f"| {' | '.join(cells)} |"


def declines(seeds: range, roughs: tuple[float, ...]) -> Iterator[str]:
    """Yield the lines of all declines."""
    layouts = ((12.0, 0.0, False), (20.0, 0.0, False), (14.0, 0.0, True), (12.0, 0.02, False))
    for apart_m, scale, stacked in layouts:
        for rough_m in roughs:
            for back in ("turned", "reverse"):
                yield alike(apart_m, scale, rough_m, back, seeds, stacked=stacked)


def _table(head: tuple[str, ...], lines: Iterable[str]) -> Iterator[str]:
    yield f"| {' | '.join(head)} |"
    yield "|" + " --- |" * len(head)
    for line in lines:
        print(line, flush=True)
        yield line


def main(words: list[str] | None = None) -> int:
    """Measure and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one seed, walls of 0.15 m; nothing is written")
    quick = parser.parse_args(words).quick
    few, many = (range(1), range(1)) if quick else (range(1, 3), range(10))
    kinds: list[tuple[Falsehood, float]] = [
        ("random", 0.0), ("random", 0.3), ("block", 0.3), ("random", 0.6), ("block", 0.6),
    ]  # fmt: skip
    parts = [HEADING.format(seeds=len(many)), *_table(_GNC, (false_among(kind, share, many) for kind, share in kinds))]
    parts += [
        DECLINE.format(seeds=len(few)),
        *_table(_DECLINE, declines(few, (0.15,) if quick else (0.0, 0.05, 0.15, 0.3))),
    ]
    if not quick:
        RESULT.write_text("\n".join(parts) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
