"""Missions in mines that are drawn at random: `evaluation/mission_mines.md`.

    python -m tools.evaluate.mission_mines run [--seeds 1-8] [--buckets 2] [--keep FOLDER] >> LINES
    python -m tools.evaluate.mission_mines page LINES… -o evaluation/mission_mines.md

A drift with a bend and a grade, 4.2 to 5 m wide; a draw point of 20 to 32 m at 55 to 110 degrees, with a pile of one of four
kinds, and a dump at the other side; the machine is parked at the drift's end. Names say nothing of what places are for. A mine
whose places the teaching drive cannot be sent to is told, and counts. Seeds are not chosen.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from lhdmap.errors import LhdmapError
from lhdmap.replay.run import ReplayRequest, replay
from lhdmap.replay.scenario import load_scenario

HEAD = """\
# Missions in mines drawn at random

Written by `tools/evaluate/mission_mines.py`: each a mine of its own (what is drawn: the head of the tool), taught by an operator
who drives through it once; then buckets from draw point to dump and home, perception in the loop. Simulated.

"""


def plan_of(seed: int) -> str:
    """Return a mine plan."""
    rng = np.random.default_rng(seed)
    length, bend, width = rng.uniform(60.0, 110.0), math.radians(rng.uniform(-35.0, 35.0)), rng.uniform(4.2, 5.0)
    first = 0.55 * length
    end = [first + (length - first) * math.cos(bend), (length - first) * math.sin(bend), rng.uniform(0.0, 2.5)]
    line = [[0.0, 0.0, 0.0], [round(first, 2), 0.0, 0.2], [round(float(one), 2) for one in end]]
    draw_m, dump_m = rng.uniform(0.45, 0.75) * length, rng.uniform(18.0, 0.35 * length + 8.0)
    sides = ["left", "right"]
    rng.shuffle(sides)
    rough_m, angle, deep_m = rng.uniform(0.08, 0.14), rng.uniform(55.0, 110.0), rng.uniform(20.0, 32.0)
    pile = rng.choice(["normal", "skewed", "bulging", "asymmetric"])
    return f"""\
name = "drawn_{seed}"
seed = {seed}

[walls]
roughness_m = {rough_m:.3f}

[[drift]]
name = "M"
line_m = {line}
width_m = {width:.2f}

[[place]]
drift = "M"
kind = "draw_point"
side = "{sides[0]}"
at_m = {draw_m:.1f}
angle_deg = {angle:.0f}
length_m = {deep_m:.1f}
pile = "{pile}"
name = "Stope"

[[place]]
drift = "M"
kind = "dump"
side = "{sides[1]}"
at_m = {dump_m:.1f}
length_m = {rng.uniform(14.0, 20.0):.1f}
name = "Pass"

[[place]]
drift = "M"
kind = "park"
side = "end"
at_m = 0.0
name = "Yard"
"""


def run(seed: int, buckets: int, folder: Path) -> dict[str, Any]:
    """Run one, and return what came of it."""
    plan, scenario = folder / f"mine_{seed}.toml", folder / f"mission_{seed}.toml"
    plan.write_text(plan_of(seed), encoding="utf-8")
    scenario.write_text(
        f'kind = "mission"\nmine = "{plan.name}"\nseed = {seed}\nmap = "mine_{seed}.map"\nstart = "Yard"\n'
        f'mission = [{{ from = "Stope", to = "Pass", buckets = {buckets} }}]\n',
        encoding="utf-8",
    )
    request = ReplayRequest(load_scenario(scenario), folder / f"run_{seed}", force=True)
    try:
        verdict = replay(request).verdict
    except LhdmapError as error:
        return {"seed": seed, "buckets": buckets, "reason": str(error).splitlines()[0], "ok": False}
    wanted = ("ok", "reason", "cycles", "tonnes", "duration_s", "min_clearance_m", "assists", "contacts", "left_true_t")
    return {"seed": seed, "buckets": buckets, **{name: verdict.get(name) for name in wanted}}


def page(rows: Sequence[dict[str, Any]]) -> str:
    """Return the page of lines."""
    done = [one for one in rows if one["ok"]]
    contacts = sum(bool(one.get("contacts")) for one in rows)
    requests = sum(int(one.get("assists") or 0) for one in rows)
    clear = sorted(float(one["min_clearance_m"]) for one in done)
    told = f"{clear[0]:.2f} m, {clear[len(clear) // 2]:.2f} m" if clear else "–"
    head = [
        ("mines", str(len(rows))),
        ("all buckets dumped, machine back home", str(len(done))),
        ("buckets, tonnes", f"{sum(one['cycles'] for one in done)}, {sum(one['tonnes'] for one in done):.0f}"),
        ("contacts", str(contacts)),
        ("requests for help", str(requests)),
        ("least clearance of a run that ended well, least and median", told),
    ]
    lines = ["| | |", "| --- | --- |", *(f"| {name} | {value} |" for name, value in head), "", "## Each mine", ""]
    lines += ["| seed | what came of it | buckets | t | s | requests | least clearance, m |"]
    lines += ["| --- | --- | --- | --- | --- | --- | --- |"]
    for one in sorted(rows, key=lambda one: int(one["seed"])):
        known = one.get("duration_s") is not None
        cells = (
            [
                f"{one['cycles']} of {one['buckets']}",
                f"{one['tonnes']:.1f}",
                f"{one['duration_s']:.0f}",
                str(one["assists"]),
            ]
            if known
            else [f"0 of {one['buckets']}", "–", "–", "–"]
        )
        clear_m = f"{one['min_clearance_m']:.2f}" if known else "–"
        lines.append(f"| {one['seed']} | {one['reason']} | {' | '.join(cells)} | {clear_m} |")
    return HEAD + "\n".join(lines) + "\n"


def main() -> None:
    """Run, or make the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    runs = commands.add_parser("run")
    runs.add_argument("--seeds", default="1-8", help="from-to")
    runs.add_argument("--buckets", type=int, default=2)
    runs.add_argument("--keep", type=Path)
    pages = commands.add_parser("page")
    pages.add_argument("lines", nargs="+", type=Path)
    pages.add_argument("-o", "--out", type=Path, required=True)
    words = parser.parse_args()
    if words.command == "page":
        rows = [json.loads(line) for path in words.lines for line in path.read_text(encoding="utf-8").splitlines()]
        words.out.write_text(page(rows), encoding="utf-8")
        return
    low, high = (int(part) for part in words.seeds.split("-"))
    with tempfile.TemporaryDirectory() as kept:
        folder = words.keep or Path(kept)
        folder.mkdir(parents=True, exist_ok=True)
        for seed in range(low, high + 1):
            sys.stdout.write(json.dumps(run(seed, words.buckets, folder)) + "\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
