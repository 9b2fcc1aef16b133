"""Positioning from starts beside the pile's axis: `python -m tools.evaluate.positioning [--starts 200] [--out FILE.md]`.

Each start is a straight drift of some width with a pile at its end, the machine 14 m to 24 m before it, off by up to 0.5 m
and 10 degrees; the pile's toe is skewed by up to 10 degrees. Planar: real guidance and the real task, no ground, no perception.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lhdmap.loading.states import State
from tests.guidance.tunnels import BODIES, room
from tests.loading.task.bench import Bench, Drift, bench

WIDTHS_M = {"narrow, 3.2 to 3.6 m": (3.2, 3.6), "usual, 3.6 to 4.2 m": (3.6, 4.2), "wide, 4.2 to 5.0 m": (4.2, 5.0)}


class Came(NamedTuple):
    """What came of a start."""

    seed: int
    ended: str
    why: str
    seconds: float
    room_m: float
    beside_m: float


def start_of(seed: int, width_m: tuple[float, float]) -> Bench | None:
    """A start; None where the machine would stand in the wall."""
    rng = np.random.default_rng([seed, 2024])
    drift = Drift(30.0, 0.5 * rng.uniform(*width_m), math.radians(rng.uniform(-10.0, 10.0)))
    far, aside = rng.uniform(14.0, 24.0), rng.uniform(-0.5, 0.5)
    turned, bend = np.radians(rng.uniform(-10.0, 10.0)), np.radians(rng.uniform(-10.0, 10.0))
    start = (drift.toe_m - far - float(BODIES.front_box_m[1, 0]), aside, float(turned))
    if room(np.array([*start, float(bend)]), drift.walls_m) < 0.05:
        return None
    return bench(drift=drift, start=start, bend_rad=float(bend), guided=True)


def came(seed: int, width_m: tuple[float, float]) -> Came | None:
    """Run one start until the charge has touched, or help is asked for."""
    one = start_of(seed, width_m)
    if one is None:
        return None
    ends = (State.EXCAVATION, State.POSITIONING_ASSISTANCE, State.LOADING_ASSISTANCE, State.ABORTED)
    out = one.run(120.0, lambda said: said.state in ends)
    beside = _beside_m(one) if out.state == State.EXCAVATION else math.nan
    why = out.request.why if out.request is not None else ""
    return Came(seed, out.state.value, why, one.now_ns * 1e-9, min(one.rooms_m), beside)


def _beside_m(one: Bench) -> float:
    """Return the room of the lip's corners to the pile's limits, across the drift, where it touched."""
    y, heading = one.truth.state[1:3].tolist()
    (_, y0), (x1, y1) = BODIES.front_box_m
    corners = [y + x1 * math.sin(heading) + side * math.cos(heading) for side in (y0, y1)]
    return one.drift.half_m - max(abs(corner) for corner in corners)


def table(starts: int) -> tuple[str, list[Came]]:
    """Return the table of all classes, and all that came."""
    lines = [
        "| drift | starts | charged | asked for help | contacts | least room m | in time s, median / most |",
        "|" + " --- |" * 7,
    ]
    found: list[Came] = []
    for name, width_m in WIDTHS_M.items():
        rows: list[Came] = []
        seed = 0
        while len(rows) < starts:
            one = came(seed, width_m)
            seed += 1
            if one is not None:
                rows.append(one)
        charged = [one for one in rows if one.ended == State.EXCAVATION]
        times = [one.seconds for one in charged] or [math.nan]
        contacts = sum(one.room_m <= 0.0 for one in rows)
        lines.append(
            f"| {name} | {len(rows)} | {len(charged)} | {len(rows) - len(charged)} | {contacts} | "
            f"{min(one.room_m for one in rows):.2f} | {np.median(times):.0f} / {max(times):.0f} |"
        )
        found += rows
    return "\n".join(lines), found


def main() -> int:
    """Run all and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=200)
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    text, found = table(asked.starts)
    why = Counter(one.why for one in found if one.ended != State.EXCAVATION)
    for cause, count in why.most_common():
        text += f"\n\n{count} × {cause}"
    print(text)
    for one in found:
        if one.room_m <= 0.0 or one.ended != State.EXCAVATION:
            print(one, file=sys.stderr)
    if asked.out is not None:
        asked.out.write_text(text + "\n", encoding="utf-8")
    return 1 if any(one.room_m <= 0.0 for one in found) else 0


if __name__ == "__main__":
    raise SystemExit(main())
