"""Loadings and missions in closed loop, run by run: evaluation/loops.md.

    python -m tools.evaluate.loops run SCENARIO --seeds 1-10 [--method adaptive] [--start DP3] [--offset 0.3] [--turned -5]
    python -m tools.evaluate.loops page

Each run adds a line to evaluation/loops.jsonl; the same scenario, seed and changes replace it. Seeds are not chosen.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from lhdmap.replay.run import ReplayRequest, replay
from lhdmap.replay.scenario import Scenario, find_scenario, load_scenario

DATA, PAGE = Path("evaluation/loops.jsonl"), Path("evaluation/loops.md")
KEPT = (
    "ok", "reason", "contacts", "min_clearance_m", "duration_s", "assists", "attempts", "fill", "fill_true", "charges",
    "early_triggers", "cycles", "tonnes", "time_by_phase_s", "realtime_factor",
)  # fmt: skip
COLUMNS = (
    "runs", "ok", "contacts", "least room, m", "attempts", "fill as weighed", "true fill", "weighed less true, rms",
    "early of charges", "requests", "seconds", "times real time",
)  # fmt: skip
HEAD = """\
# Loading and missions in closed loop

Perception, task, guidance, executor, machine, ground and pile in one loop ([replay](../docs/replay.md)); nobody in it sees the
truth. Made by `python -m tools.evaluate.loops`. Machine and ground are models: **these figures are the model's, never a mine's.**

"""


def main() -> int:
    """Run scenarios, or write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run")
    run.add_argument("scenario")
    run.add_argument("--seeds", default="1-10")
    run.add_argument("--method", default="")
    run.add_argument("--start", default="")
    run.add_argument("--map", default="")
    run.add_argument("--offset", type=float, default=0.0)
    run.add_argument("--turned", type=float, default=0.0)
    commands.add_parser("page")
    asked = parser.parse_args()
    if asked.command == "run":
        for seed in _seeds(asked.seeds):
            _keep(_run(asked, seed))
    PAGE.write_text(HEAD + "\n".join([*_head(), *_rows()]) + "\n" + _misses(), encoding="utf-8")
    return 0


def _seeds(text: str) -> range:
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


def _run(asked: argparse.Namespace, seed: int) -> dict[str, Any]:
    scenario = _changed(load_scenario(find_scenario(asked.scenario), seed=seed), asked)
    with tempfile.TemporaryDirectory() as folder:
        verdict = replay(ReplayRequest(scenario, Path(folder) / "run", recording=False)).verdict
    what = f"{Path(asked.scenario).stem}, {scenario.loading.method}"
    what += "".join(f", {name}" for name in (scenario.start if asked.start else "", _beside(asked)) if name)
    print(what, seed, verdict["reason"], file=sys.stderr, flush=True)
    return {"what": what, "seed": seed, **{key: verdict[key] for key in KEPT if key in verdict}}


def _changed(scenario: Scenario, asked: argparse.Namespace) -> Scenario:
    loading = replace(scenario.loading, offset_m=asked.offset, turned_deg=asked.turned)
    if asked.method:
        loading = replace(loading, method=asked.method, detector="paper" if asked.method == "paper" else "fused")
    return replace(scenario, loading=loading, start=asked.start or scenario.start, map=asked.map or scenario.map)


def _beside(asked: argparse.Namespace) -> str:
    return (
        f"begun {asked.offset:g} m beside the way, turned by {asked.turned:g}°" if asked.offset or asked.turned else ""
    )


def _keep(row: dict[str, Any]) -> None:
    kept = [one for one in _read() if (one["what"], one["seed"]) != (row["what"], row["seed"])] + [row]
    kept.sort(key=lambda one: (one["what"], one["seed"]))
    DATA.write_text("".join(json.dumps(one) + "\n" for one in kept), encoding="utf-8")


def _read() -> list[dict[str, Any]]:
    return [json.loads(line) for line in DATA.read_text(encoding="utf-8").splitlines()] if DATA.is_file() else []


def _head() -> list[str]:
    return [f"| {' | '.join(COLUMNS)} |", "| --- " * len(COLUMNS) + "|"]


def _rows() -> Iterator[str]:
    for what, group in groupby(_read(), key=lambda one: str(one["what"])):
        rows = list(group)
        fill, true = (np.array([_number(one.get(name)) for one in rows]) for name in ("fill", "fill_true"))
        off = fill - true
        rms = float(np.sqrt(np.nanmean(off**2))) if np.isfinite(off).any() else float("nan")
        charges = sum(one.get("charges", 0) for one in rows)
        cells = (
            f"{what}: {len(rows)}",
            str(sum(one["ok"] for one in rows)),
            str(sum(len(one["contacts"]) for one in rows)),
            f"{min(_number(one['min_clearance_m']) for one in rows):.2f}",
            f"{np.mean([one.get('attempts', 0) for one in rows]):.2f}",
            f"{np.nanmean(fill):.2f}",
            f"{np.nanmean(true):.2f}",
            f"{rms:.3f}",
            f"{sum(one.get('early_triggers', 0) for one in rows)} of {charges}",
            str(sum(one["assists"] for one in rows)),
            f"{np.median([one['duration_s'] for one in rows]):.0f}",
            f"{np.median([one['realtime_factor'] for one in rows]):.1f}",
        )
        yield f"| {' | '.join(cells)} |"


def _misses() -> str:
    lines = [f"* {one['what']}, seed {one['seed']}: {one['reason']}" for one in _read() if not one["ok"]]
    return "\nRuns that did not end well:\n\n" + "\n".join(lines) + "\n" if lines else "\nEach of them ended well.\n"


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


if __name__ == "__main__":
    raise SystemExit(main())
