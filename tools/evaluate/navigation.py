"""Replays through narrow mines, perception in the loop: `python -m tools.evaluate.navigation FOLDER --room 0.25 --tunnels 6`.

Each mine is one drift of bends (radii log-uniform, 20 to 90 degrees) with a park at either end, made from its seed; its width
follows the swept bodies, and is shifted until the least room that the operator's drive leaves, measured by the simulator's bumper,
is the one that is asked for. It is taught once, then driven forward and in reverse. What is there already is not made again.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from lhdmap.config import Settings
from lhdmap.geometry import se2
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.mine.make_network import make_network
from lhdmap.mine.plan import load_plan
from lhdmap.replay.assemble import parts_of
from lhdmap.replay.parts import Parts
from lhdmap.replay.run import ReplayRequest, replay
from lhdmap.replay.scenario import Limits, Scenario
from lhdmap.replay.teaching import teach
from lhdmap.simulation.history import START_NS
from lhdmap.simulation.mine_drive import MineDrive, MineDriveSettings
from lhdmap.simulation.operator import OperatorSettings
from lhdmap.simulation.vehicle.vehicle import Vehicle
from tests.guidance.tunnels import STEP_M, swept_half_widths, winding_line

_EVERY = 20  # line points of a plan's point: 2 m
_SLOW_KMH = 5.0
_ENDS_M = 15.0


@dataclass(frozen=True)
class Tunnel:
    """A mine that was made: its plan, and the least room that the operator's drive leaves."""

    plan: Path
    room_m: float


def tunnel(
    folder: Path, seed: int, room_m: float, radii_m: tuple[float, float], length_m: float, rms_m: float
) -> Tunnel:
    """Make the mine of a seed so that the operator's drive leaves `room_m`."""
    told = folder / "tunnel.json"
    plan = folder / "mine.toml"
    if told.is_file():
        return Tunnel(plan, float(json.loads(told.read_text())["room_m"]))
    folder.mkdir(parents=True, exist_ok=True)
    line = winding_line(seed, radii_m, length_m, _ENDS_M)
    left, right = swept_half_widths(line)
    more, found = room_m + rms_m, math.nan
    for _ in range(5):
        plan.write_text(plan_toml(seed, line, 2.0 * (np.maximum(left, right) + more), rms_m), encoding="utf-8")
        found = measured(plan)
        if abs(found - room_m) < 0.01:
            break
        more += room_m - found
    told.write_text(json.dumps({"room_m": found}))
    return Tunnel(plan, found)


def plan_toml(seed: int, line: FloatArray, width_m: FloatArray, rms_m: float) -> str:
    """Return the plan of a drift along a line (N, 2), its widths (N,) as they are along it."""
    points = [[round(float(x), 3), round(float(y), 3), 0.0] for x, y in line[::_EVERY]]
    widths = [[round(k * STEP_M, 1), round(float(w), 3)] for k, w in list(enumerate(width_m))[:: _EVERY // 2]]
    return f"""name = "narrow{seed}"
seed = {seed}
[walls]
profile = "box"
roughness_m = {rms_m}
blast_flare_m = 0.03
[[drift]]
name = "N"
line_m = {points}
bend_radius_m = 5.0
height_m = 3.6
width_m = {widths}
[[place]]
drift = "N"
at_m = 0.0
kind = "park"
side = "end"
name = "A"
[[place]]
drift = "N"
kind = "park"
side = "end"
name = "B"
"""


def measured(plan: Path) -> float:
    """Return the least room that an operator leaves who drives slowly and without wandering."""
    drive = MineDrive(
        make_network(load_plan(plan)), Machine(), MineDriveSettings(operator=OperatorSettings(speed_kmh=_SLOW_KMH))
    )
    drive.drive()
    return drive.gauge.min_clearance_m


def as_mapped(parts: Parts, scenario: Scenario, folder: Path) -> Parts:
    """Return the parts with start and goal where the map has them: the teaching drive's stops, not the plan's places."""
    assert parts.autonomous is not None  # the scenario has a goal
    first = np.loadtxt(folder / "map_teaching.truth.tum", max_rows=1)
    origin = np.array([first[1], first[2], 2.0 * math.atan2(first[6], first[7])])
    assert isinstance(parts.vehicle, Vehicle)
    named = {one.name: one.pose for one in parts.autonomous.known.topology.waypoints}
    begin, end = named[scenario.start], named[scenario.goal]
    x, y, yaw = se2.compose(origin, begin[[0, 1, 3]]).tolist()
    state = parts.vehicle.at_rest(x, y, yaw, near_z_m=float(first[3]), time_ns=START_NS, load_kg=1000.0 * scenario.load)
    goal = se2.compose(origin, end[[0, 1, 3]])
    return replace(parts, start=state, goal_m=(float(goal[0]), float(goal[1]), float(first[3])))


def run(folder: Path, made: Tunnel, kind: str, *, reverse: bool, load_t: float, seed: int) -> dict[str, Any]:
    """Replay a tunnel; return what came of it, also from a replay that is there."""
    target = folder / f"run_{'rev' if reverse else 'fwd'}_{load_t:.0f}t_{seed}"
    told = target / "verdict.json"
    if not told.is_file():
        start, goal = ("B", "A") if reverse else ("A", "B")
        scenario = Scenario(
            mine=str(made.plan), seed=seed, map=str(folder / "map"), start=start, goal=goal, load=load_t,
            limits=Limits(time_s=300.0),
        )  # fmt: skip
        begun = time.process_time()
        parts = as_mapped(parts_of(scenario, folder), scenario, folder)
        replay(ReplayRequest(scenario, target, recording=False, force=True), parts)
        (target / "cpu_s.json").write_text(json.dumps(time.process_time() - begun))
    verdict = json.loads(told.read_text())
    states = [json.loads(line) for line in (target / "journal.jsonl").read_text().splitlines()]
    backed = sum(one["to"] == "backing" for one in states)
    keys = ("ok", "reason", "arrived", "min_clearance_m", "mean_speed_kmh", "max_speed_kmh", "distance_m", "assists")
    row = {key: verdict.get(key) for key in keys}
    return {
        "class": kind, "tunnel": folder.name, "room_m": made.room_m, "reverse": reverse, "load_t": load_t, "seed": seed,
        **row, "contacts": len(verdict["contacts"]), "back_ups": backed, "folder": str(target),
    }  # fmt: skip


def main() -> int:
    """Make, teach, replay; a line a run, then the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--room", type=float, default=0.25)
    parser.add_argument("--radii", type=float, nargs=2, default=(5.5, 15.0))
    parser.add_argument("--length", type=float, default=70.0)
    parser.add_argument("--rms", type=float, default=0.05)
    parser.add_argument("--tunnels", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--loads", type=float, nargs="+", default=None, help="t; default: by turns empty and 14")
    parser.add_argument("--make-only", action="store_true")
    asked = parser.parse_args()
    kind = f"c {asked.room:.2f}, R {asked.radii[0]:g}-{asked.radii[1]:g}"
    rows = []
    for seed in range(asked.first, asked.first + asked.tunnels):
        folder = asked.folder / f"{asked.room:.2f}_{asked.radii[0]:g}_{asked.radii[1]:g}_{seed}"
        made = tunnel(folder, seed, asked.room, tuple(asked.radii), asked.length, asked.rms)
        print(f"{folder.name}: least room {made.room_m:.3f} m", flush=True)
        if asked.make_only:
            continue
        if not (folder / "map").is_dir():
            scenario = Scenario(mine=str(made.plan), seed=seed)
            teach(scenario, make_network(load_plan(made.plan)), Machine(), folder / "map", Settings())
        for reverse in (False, True):
            for load_t in asked.loads or [14.0 * ((seed + reverse) % 2)]:
                row = run(folder, made, kind, reverse=reverse, load_t=load_t, seed=seed + 1)
                rows.append(row)
                print(json.dumps(row), flush=True)
                (asked.folder / f"rows_{asked.room:.2f}_{asked.first}.json").write_text(json.dumps(rows, indent=1))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
