"""Positioning with perception in the loop, from starts beside the way: `evaluation/positioning.md`.

    python -m tools.evaluate.positioning_seen run [--starts 40]
    python -m tools.evaluate.positioning_seen page

The mine `stope` as it ships (4.6 m) and the same with a drift of 3.4, 3.8 and 4.2 m, in turn; the machine begins 18 to 26 m
before the draw point, off by up to 0.5 m and 10 degrees (evenly), and is not told so. A run ends where the bucket has touched,
or help is asked for. Starts that would stand in a wall are drawn anew. Each adds a line to evaluation/positioning.jsonl; seeds are
not chosen, and what is there is not run again.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from lhdmap.config import Settings
from lhdmap.loading.states import ASSISTANCE, RESTING, State
from lhdmap.mine.plan import find_plan
from lhdmap.replay.scenario import LoadingPlan, Scenario
from tests.guidance.tunnels import room

from tools.evaluate.loading_fault_runs import Live, moments, started

DATA, PAGE = Path("evaluation/positioning.jsonl"), Path("evaluation/positioning.md")
WIDTHS_M = (4.6, 3.4, 4.2, 3.8)
ROOM_M, LONGEST_S = 0.05, 150.0
WAVES_M = 0.15  # roughness of the walls
_ENDS = {str(one) for one in (State.EXCAVATION, *ASSISTANCE, *RESTING)}
HEAD = """\
# Positioning with perception in the loop

By `python -m tools.evaluate.positioning_seen`: odometry, pile identification, loading task, guidance and executor on simulated
scans ([replay](../docs/replay.md)); the machine begins 18 to 26 m before the draw point, off by up to 0.5 m and 10°, and is not
told so. A run ends where the bucket has touched, or help is asked for. Contacts are those of the bodies with the mine's mesh.
**Machine, ground and mine are models.** Starts with less than 0.05 m of room are drawn anew.

"""


def main() -> int:
    """Run what is missing, or write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run")
    run.add_argument("--starts", type=int, default=40)
    commands.add_parser("page")
    asked = parser.parse_args()
    if asked.command == "run":
        done = {one["seed"] for one in _read()}
        with tempfile.TemporaryDirectory() as folder:
            for seed in (one for one in range(asked.starts) if one not in done):
                _keep(seed, Path(folder))
    PAGE.write_text(page(), encoding="utf-8")
    return 0


def scenario_of(seed: int, folder: Path) -> tuple[float, Scenario]:
    """Return the width of a seed's drift, and its scenario."""
    rng = np.random.default_rng([seed, 2020])
    width_m = WIDTHS_M[seed % len(WIDTHS_M)]
    mine = folder / f"stope_{width_m}.toml"
    text = find_plan("stope").read_text(encoding="utf-8")
    mine.write_text(text.replace("width_m = 4.6", f"width_m = {width_m}"), encoding="utf-8")
    approach_m, half_m = round(float(rng.uniform(18.0, 26.0)), 2), 0.5 * width_m - WAVES_M
    x = np.arange(-20.0, 20.0, 0.1)
    walls_m = np.vstack([np.column_stack([x, np.full(len(x), side * half_m)]) for side in (-1.0, 1.0)])
    while True:
        offset_m, turned_deg = round(float(rng.uniform(-0.5, 0.5)), 3), round(float(rng.uniform(-10.0, 10.0)), 2)
        if room(np.array([0.0, offset_m, math.radians(turned_deg), 0.0]), walls_m) > ROOM_M:
            break
    begins = LoadingPlan(approach_m=approach_m, offset_m=offset_m, turned_deg=turned_deg)
    return width_m, Scenario(kind="loading", mine=str(mine), start="DP1", seed=seed, loading=begins)


def _keep(seed: int, folder: Path) -> None:
    width_m, scenario = scenario_of(seed, folder)
    live = started(scenario, Settings())
    begins = {name: getattr(scenario.loading, name) for name in ("approach_m", "offset_m", "turned_deg")}
    row = {"seed": seed, "width_m": width_m, **begins, **_came(live)}
    with DATA.open("a", encoding="utf-8") as file:
        file.write(json.dumps(row) + "\n")
    print(row, file=sys.stderr, flush=True)


def _came(live: Live) -> dict[str, Any]:
    """Drive until the bucket has touched, or somebody is asked."""
    tally, ended, at_s = live.run.monitor.tally, "", 0.0
    for state, _ in moments(live, LONGEST_S):
        at_s += 0.1
        if state in _ENDS and state != State.IDLE:
            ended = state
            break
    last = [one for one in live.events if one.process == "loading" and one.event == "state"]
    stops = [
        one.cause
        for one in live.events
        if one.values.get("after") == "disarmed" and one.values.get("before") != "disarmed"
    ]
    return {
        "ended": ended or "still under way",
        "why": last[-1].cause if last else "",
        "seconds": round(at_s, 1),
        "contacts": tally.touched.count,
        "room_m": round(float(tally.touched.clearance_m or 0.0), 3),
        "stops": stops,
    }


def page() -> str:
    """Return the page of what has been run."""
    rows = sorted(_read(), key=lambda one: float(one["width_m"]))
    lines = [
        "| drift, m | starts | touched | asked for help | neither | contacts | least room, m | stops | s, median / most |",
        "|" + " --- |" * 9,
    ]
    for width_m, group in groupby(rows, key=lambda one: float(one["width_m"])):
        runs = list(group)
        charged = [one for one in runs if one["ended"] == State.EXCAVATION]
        asked = [one for one in runs if one["ended"] in {str(state) for state in ASSISTANCE}]
        times = [one["seconds"] for one in charged] or [float("nan")]
        lines.append(
            f"| {width_m:g} | {len(runs)} | {len(charged)} | {len(asked)} | {len(runs) - len(charged) - len(asked)} | "
            f"{sum(one['contacts'] for one in runs)} | {min(one['room_m'] for one in runs):.2f} | "
            f"{sum(len(one['stops']) for one in runs)} | {np.median(times):.0f} / {max(times):.0f} |"
        )
    helped = [one for one in rows if one.get("ended", State.EXCAVATION) != State.EXCAVATION or one.get("contacts")]
    lines += ["", "Runs that did not charge, or touched a wall:", ""] if helped else []
    lines += [
        f"* seed {one['seed']}, {one['width_m']:g} m, {one['offset_m']:+.2f} m, {one['turned_deg']:+.1f}°: {one['ended']}, "
        f"{one['why']}, {one['contacts']} contacts, {one['room_m']:.2f} m"
        for one in helped
    ]
    return HEAD + "\n".join(lines) + "\n"


def _read() -> Iterator[dict[str, Any]]:
    if DATA.is_file():
        yield from (json.loads(line) for line in DATA.read_text(encoding="utf-8").splitlines())


if __name__ == "__main__":
    raise SystemExit(main())
