"""Random faults in missions: `evaluation/mission_faults.md`.

    python -m tools.evaluate.mission_faults [SCENARIO.toml] [--runs N] [--seed N] [--most N] [--until S] [--keep FOLDER]
                                            [--lines FILE… --page FILE]

In each run one to `most` faults of all kinds at chance times of a bucket. Wanted of all: no contact; no motion on data that are
old; after a stop of the watchdog nothing moves before it was armed again; the mission comes to its end, or has asked for help
more often than the station answers; each bucket that is counted was truly carried and truly dumped, and no ore is lost on the
way; each moment is in one phase. Runs that miss are kept as scenario files.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from lhdmap.driving.model import drive_model
from lhdmap.messages import FloatArray
from lhdmap.replay.assemble import Watchers, assemble, parts_of
from lhdmap.replay.journal import Event, Journal
from lhdmap.replay.mission_tally import MissionTally
from lhdmap.replay.process import STATE, Outgoing, Received
from lhdmap.replay.processes.film import Film
from lhdmap.replay.scenario import Scenario, load_scenario, scenario_toml
from lhdmap.simulation.history import SECOND_NS, START_NS

from tools.evaluate import replay_faults as drives
from tools.evaluate.fault_options import fault_parser, wrote_page

SPILLED_KG = 300.0
"""More than a load loses by being shaken: ore that is gone."""
WEIGHED = 0.15
"""How far a bucket that is counted may be from the one that was truly carried."""
_GIVEN_UP = "aborted: the station gave up"


class Ore(drives.Drive):
    """Keeps the true load of the bucket, too."""

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[tuple[float, float, float, float]] = []

    def step(self, now_ns: int, inbox: Sequence[Received]) -> list[Outgoing]:
        """Take what has come."""
        for one in inbox:
            if one.topic == STATE:
                state = one.message
                self.loads.append(((state.time_ns - START_NS) / SECOND_NS, state.load_kg, state.x_m, state.y_m))
        return super().step(now_ns, inbox)


class Outcome(NamedTuple):
    """What came of a run."""

    reason: str
    missed: list[str]
    clearance_m: float
    cycles: int
    stops: int
    assists: int
    duration_s: float
    phases: dict[str, float]


def run(scenario: Scenario, folder: Path) -> Outcome:
    """Run a mission and judge it."""
    journal, events, ore, tally = Journal(None), list[Event](), Ore(), MissionTally()
    journal.listeners += [events.append, tally]
    parts = parts_of(scenario, folder)
    run = assemble(scenario, parts, journal, Watchers(Film(parts.machine), more=[ore]))
    for _ in run.engine.run(START_NS + round((scenario.limits.time_s + 1.0) * SECOND_NS)):
        if run.monitor.ended:
            break
    run.engine.finish()
    found, rows = run.monitor.tally, np.array(ore.rows)
    stops, _ = drives.stops_missed(rows, events, drive_model(parts.machine, parts.machine.drive.payload_kg))
    missed = [one for one in stops if "before it was armed" in one]
    missed += drives.stale_missed(scenario.faults, rows, events)
    missed += [f"contact: {found.reason}"] if found.touched.contacts else []
    missed += _lost(events, np.array(ore.loads))
    wanted = sum(one.buckets for one in scenario.mission)
    duration_s = (run.engine.now_ns - START_NS) / SECOND_NS
    told = tally.verdict(run.engine.now_ns)
    if not (found.reason == "done" and told["cycles"] == wanted) and not found.reason.startswith(_GIVEN_UP):
        missed.append(f"ended in silence: {found.reason}, {told['cycles']} of {wanted} buckets")
    phases = {name: round(float(s), 1) for name, s in told["time_by_phase_s"].items()}
    if abs(sum(told["time_by_phase_s"].values()) - duration_s) > 1e-6:
        missed.append(f"phases sum up to {sum(phases.values()):.1f} s of {duration_s:.1f} s")
    count = len(drives.told_at(events, "watchdog: armed", "disarmed"))
    clear_m = float(found.touched.clearance_m or 0.0)
    return Outcome(found.reason, missed, clear_m, told["cycles"], count, told["assists"], round(duration_s, 1), phases)


def _lost(events: Sequence[Event], loads: FloatArray) -> list[str]:
    """Return where ore was lost, or a bucket is counted that was not carried; `loads` (N, 4): time, true load, place."""
    missed, since_s = [], 0.0
    at_s = loads[:, 0]
    for one in events:
        if one.process != "mission" or one.event != "cycle":
            continue
        now_s = (one.t_ns - START_NS) / SECOND_NS
        part = loads[(at_s > since_s) & (at_s <= now_s), 1]
        carried_t, left_t, told_t = 1e-3 * part.max(), 1e-3 * part[-1], float(one.values["mass_t"] or 0.0)
        if abs(told_t - carried_t) > WEIGHED * max(carried_t, 1.0) or left_t > 1e-3 * SPILLED_KG:
            missed.append(
                f"{now_s:.1f} s: {told_t:.1f} t are counted, {carried_t:.1f} t were carried, {left_t:.1f} t are left"
            )
        since_s = now_s
    for from_s, to_s in _hauls(events):
        part = loads[(at_s >= from_s) & (at_s <= to_s), 1]
        if len(part) and part[0] - part[-1] > SPILLED_KG:
            missed.append(f"{from_s:.1f} to {to_s:.1f} s: {part[0] - part[-1]:.0f} kg lost on the way")
    return missed


def _hauls(events: Sequence[Event]) -> list[tuple[float, float]]:
    """Return from when to when (s) the mission hauled."""
    states = [one for one in events if one.process == "mission" and one.event == "state"]
    seconds = [(one.t_ns - START_NS) / SECOND_NS for one in states]
    return [(seconds[k], seconds[k + 1]) for k in range(len(states) - 1) if states[k].after == "haul"]


def main() -> None:
    """Run and tell."""
    parser = fault_parser(__doc__, "demo_cycle.toml", 150.0, "mission_faults")
    parser.add_argument("--map", type=Path, help="a map of the mine that is there already")
    arguments = parser.parse_args()
    if wrote_page(arguments, page):
        return
    arguments.keep.mkdir(parents=True, exist_ok=True)
    base = load_scenario(arguments.scenario)
    base = replace(base, map=str(arguments.map or arguments.keep / "map"))
    for seed in range(arguments.seed, arguments.seed + arguments.runs):
        rng = np.random.default_rng([seed, 21])
        faults = drives.faults_of(rng, arguments.most, arguments.until)
        told = replace(base, seed=seed, rearm_s=1.5, assist_s=3.0, faults=faults)
        began = time.monotonic()
        found = run(told, arguments.keep)
        kinds = [f"{one.kind} {one.target} {one.at_s:g}+{one.duration_s:g}" for one in faults]
        line = {"seed": seed, **found._asdict(), "faults": kinds, "took_s": round(time.monotonic() - began, 1)}
        print(json.dumps(line), flush=True)
        if found.missed:
            (arguments.keep / f"missed_{seed}.toml").write_text(scenario_toml(told), encoding="utf-8")


def page(lines: Sequence[dict[str, Any]]) -> str:
    """Return the page of so many runs."""
    kinds = sorted({fault.split()[0] for one in lines for fault in one["faults"]})
    silent = [
        what for one in lines for what in one["missed"] if "silence" in what or "counted" in what or "lost" in what
    ]
    moved = [what for one in lines for what in one["missed"] if "moves" in what or "moved" in what]
    clear_m = sorted(float(one["clearance_m"]) for one in lines)
    rows = {
        "missions": len(lines),
        "faults": sum(len(one["faults"]) for one in lines),
        "bucket dumped, machine back home": sum(one["reason"] == "done" for one in lines),
        "given up by the station after five requests": sum(one["reason"].startswith(_GIVEN_UP) for one in lines),
        "contacts": sum(one["reason"].startswith("contact") for one in lines),
        "ore or buckets lost, runs that end without a word": len(silent),
        "motion on old data, or before arming": len(moved),
        "stops of the watchdog": sum(one["stops"] for one in lines),
        "requests for help": sum(one["assists"] for one in lines),
        "least clearance of a run, least and median": f"{clear_m[0]:.2f} m, {np.median(clear_m):.2f} m",
    }
    table = "\n".join(f"| {name} | {value} |" for name, value in rows.items())
    each = "\n".join(
        f"| {one['seed']} | {one['reason']} | {one['duration_s']:.0f} | {one['assists']} | {'; '.join(one['faults'])} "
        f"| {'; '.join(one['missed']) or '–'} |"
        for one in lines
    )
    return (
        "# Random faults in missions\n\nWritten by `tools/evaluate/mission_faults.py`: one bucket from draw point to dump of the "
        f"mine `cycle` and home, one to three faults each, at chance times ({', '.join(kinds)}).\n\n"
        f"| | |\n| --- | --- |\n{table}\n\n## Each run\n\n| seed | what came of it | s | requests | faults (kind, target, "
        f"begin + s) | missed |\n| --- | --- | --- | --- | --- | --- |\n{each}\n"
    )


if __name__ == "__main__":
    main()
