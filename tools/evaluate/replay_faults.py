"""Random faults in replays of a machine that drives itself: `evaluation/faults.md`.

    python -m tools.evaluate.replay_faults [SCENARIO.toml] [--runs N] [--seed N] [--most N] [--until S] [--keep FOLDER]

In each run one to `most` faults at chance times, at once too. Wanted of all: no contact; stops within the machine's stopping
distance; no motion on data that are old; after a stop nothing moves before it was armed again. Runs that miss are kept.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from lhdmap.driving.model import DriveModel, drive_model
from lhdmap.messages import FloatArray
from lhdmap.replay.assemble import Watchers, assemble, parts_of
from lhdmap.replay.journal import Event, Journal
from lhdmap.replay.process import EVERYWHERE, STATE, Outgoing, Process, Received
from lhdmap.replay.processes.film import Film
from lhdmap.replay.scenario import Scenario, load_scenario, scenario_toml
from lhdmap.simulation.history import SECOND_NS, START_NS
from lhdmap.simulation.sensing.faults import FaultSettings

from tools.evaluate.fault_options import fault_parser, wrote_page

FRONT, REAR = "/lidar/front/scan", "/lidar/rear/scan"
TACHOMETER, JOINTS, INCLINOMETER = "/machine/tachometer", "/machine/joints", "/inclinometer"
SENSORS = (FRONT, REAR, TACHOMETER, JOINTS, INCLINOMETER)
NEEDED = (FRONT, REAR, TACHOMETER, JOINTS)
LIMIT_S = 0.3 + 0.06 + 0.02  # the watchdog's age, the period and latency of a scan, a period of the control
SIZES = {
    "biased": {FRONT: 0.05, REAR: 0.05, TACHOMETER: 0.15, JOINTS: 0.0087, INCLINOMETER: 0.01},
    "noisy": {FRONT: 0.03, REAR: 0.03, TACHOMETER: 0.2, JOINTS: 0.004, INCLINOMETER: 0.01},
}
PROCESSES = ("perception", "navigation", "guidance", "executor", "station")
KINDS = ("dead", "frozen", "nan", "delayed", "dropped", "jump", "biased", "noisy", "overrun", "link_lost", "link_degraded",
         "person", "obstacle", "steering_stuck")  # fmt: skip
STANDS_MPS, MOVES_MPS = 0.03, 0.06
MARGIN = 1.1
IN_FLIGHT_S = 1.0  # dead time, and the brake on what was commanded before


class Drive(Process):
    """Keeps time, way and speed of the true machine."""

    name, period_ns, priority, site = "recorder", 50_000_000, 96, EVERYWHERE
    reads, inbox_size = (STATE,), 100_000

    def __init__(self) -> None:
        self.rows: list[tuple[float, float, float, float]] = []

    def step(self, now_ns: int, inbox: Sequence[Received]) -> list[Outgoing]:  # noqa: ARG002
        """Take what has come."""
        for one in inbox:
            state = one.message
            self.rows.append(((state.time_ns - START_NS) / SECOND_NS, state.x_m, state.y_m, state.speed_mps))
        return []


class Outcome(NamedTuple):
    """What came of a run: verdict, what was missed, least clearance, worst share of the stopping distance, arrived, assists."""

    reason: str
    missed: list[str]
    clearance_m: float
    worst_stop: float
    stops: int
    assists: int


def faults_of(rng: np.random.Generator, most: int, until_s: float) -> tuple[FaultSettings, ...]:
    """Return faults by chance; half of the time all begin at about the same time."""
    count, together_s = int(rng.integers(1, most + 1)), float(rng.uniform(4.0, until_s))
    together = rng.random() < 0.5
    found = []
    for _ in range(count):
        at_s = together_s + float(rng.uniform(0.0, 0.5)) if together else float(rng.uniform(4.0, until_s))
        found.append(_fault(rng, round(at_s, 2)))
    return tuple(sorted(found, key=lambda one: one.at_s))


def _fault(rng: np.random.Generator, at_s: float) -> FaultSettings:
    kind = str(rng.choice(KINDS))
    long_s = round(float(np.exp(rng.uniform(np.log(0.1), np.log(6.0)))), 2)
    match kind:
        case "overrun":
            return FaultSettings(
                at_s, "", kind, str(rng.choice(PROCESSES)), long_s, round(float(rng.uniform(0.1, 0.8)), 2)
            )
        case "link_lost":
            return FaultSettings(at_s, "", kind, "link", long_s)
        case "link_degraded":
            return FaultSettings(at_s, "", kind, "link", long_s, round(float(rng.uniform(0.2, 0.9)), 2))
        case "person":
            return FaultSettings(at_s, "", kind, "", long_s + 2.0)
        case "obstacle":  # one that the scanners see from near by
            return FaultSettings(at_s, "", kind, "", long_s + 2.0, 2.2)
        case "steering_stuck":
            return FaultSettings(at_s, "", kind, "", min(long_s, 1.0))
    target = str(rng.choice(SENSORS))
    sizes = {
        "delayed": rng.uniform(0.05, 1.0),
        "dropped": rng.uniform(0.2, 1.0),
        "jump": rng.choice([-0.5, 0.5]) * rng.random(),
    }
    if kind in SIZES:
        sizes[kind] = SIZES[kind][target] * rng.choice([-1.0, 1.0] if kind == "biased" else [1.0])
    return FaultSettings(at_s, "", kind, target, long_s, round(float(sizes.get(kind, 0.0)), 4))


def run(scenario: Scenario, folder: Path) -> Outcome:
    """Run a scenario and judge it."""
    journal, events, drive = Journal(None), list[Event](), Drive()
    journal.listeners.append(events.append)
    parts = parts_of(scenario, folder)
    run = assemble(scenario, parts, journal, Watchers(Film(parts.machine), more=[drive]))
    for _ in run.engine.run(START_NS + round(scenario.limits.time_s * SECOND_NS)):
        if run.monitor.ended:
            break
    run.engine.finish()
    tally = run.monitor.tally
    rows = np.array(drive.rows)
    model = drive_model(parts.machine, 1000.0 * scenario.load)
    missed, worst = stops_missed(rows, events, model)
    missed += stale_missed(scenario.faults, rows, events)
    missed += [f"contact: {tally.reason}"] if tally.touched.contacts else []
    stops = sum(1 for _ in told_at(events, "watchdog: armed", "disarmed"))
    return Outcome(tally.reason, missed, float(tally.touched.clearance_m or 0.0), worst, stops, tally.mission.assists)


def told_at(events: Sequence[Event], event: str, after: str) -> list[float]:
    """Return when (s) the executor noted something; refusals to arm are none."""
    return [
        (one.t_ns - START_NS) / SECOND_NS
        for one in events
        if one.event == event and one.values.get("after") == after and one.values.get("before") != after
    ]


def stops_missed(rows: FloatArray, events: Sequence[Event], model: DriveModel) -> tuple[list[str], float]:
    """Return what was missed at stops of the watchdog, and the worst share of the stopping distance."""
    missed, worst = [], 0.0
    armed = [*told_at(events, "watchdog: armed", "armed"), rows[-1, 0] + 1.0]
    for at_s in told_at(events, "watchdog: armed", "disarmed"):
        until_s = min(one for one in armed if one > at_s)
        part = rows[(rows[:, 0] >= at_s) & (rows[:, 0] < until_s)]
        if not len(part):
            continue
        stands = np.flatnonzero(np.abs(part[:, 3]) < STANDS_MPS)
        last = int(stands[0]) if len(stands) else len(part) - 1
        way_m = float(np.hypot(*np.diff(part[: last + 1, 1:3], axis=0).T).sum())
        allowed_m = model.stopping_m(float(part[0, 3]))
        if allowed_m > 0.3:
            worst = max(worst, way_m / allowed_m)
        if way_m > MARGIN * allowed_m + 0.05:
            missed.append(f"{at_s:.2f} s: stopped after {way_m:.2f} m, {allowed_m:.2f} m were allowed")
        later = part[(part[:, 0] > max(part[last, 0], at_s + IN_FLIGHT_S))]
        if len(stands) and len(later) and np.abs(later[:, 3]).max() > MOVES_MPS:
            missed.append(f"{at_s:.2f} s: moved again before it was armed")
    return missed, worst


def stale_missed(faults: Sequence[FaultSettings], rows: FloatArray, events: list[Event]) -> list[str]:
    """Return where the machine went on although a scanner, tachometer or joint had been silent for too long."""
    missed = []
    for fault in faults:
        silent = fault.kind in ("dead", "nan") or (fault.kind == "frozen" and fault.target in (FRONT, REAR))
        if not silent or fault.target not in NEEDED or fault.duration_s < LIMIT_S + 0.02:
            continue
        late_s = fault.at_s + LIMIT_S
        at = rows[np.searchsorted(rows[:, 0], min(late_s, rows[-1, 0])).clip(max=len(rows) - 1)]
        disarmed = [one for one in told_at(events, "watchdog: armed", "disarmed") if one <= late_s + 0.02]
        armed = [one for one in told_at(events, "watchdog: armed", "armed") if one <= fault.at_s]
        holds = not disarmed or (armed and max(disarmed) < max(armed))
        if holds and abs(at[3]) > STANDS_MPS and rows[-1, 0] > late_s:
            missed.append(f"{late_s:.2f} s: moves without {fault.target} ({fault.kind} since {fault.at_s:.2f} s)")
    return missed


def main() -> None:
    """Run and tell."""
    parser = fault_parser(__doc__, "tram_short.toml", 16.0, "replay_faults")
    arguments = parser.parse_args()
    if wrote_page(arguments, page):
        return
    arguments.keep.mkdir(parents=True, exist_ok=True)
    base = load_scenario(arguments.scenario)
    base = replace(base, map=base.map or str(arguments.keep / "map"), limits=replace(base.limits, time_s=90.0))
    worst: list[tuple[float, int]] = []
    failed = arrived = 0
    for seed in range(arguments.seed, arguments.seed + arguments.runs):
        rng = np.random.default_rng([seed, 19])
        told = replace(
            base, seed=seed, rearm_s=1.5, assist_s=3.0, faults=faults_of(rng, arguments.most, arguments.until)
        )
        began = time.monotonic()
        found = run(told, arguments.keep)
        arrived += found.reason == "arrived"
        worst.append((found.clearance_m, seed))
        kinds = [f"{one.kind} {one.target} {one.at_s:g}+{one.duration_s:g}" for one in told.faults]
        _say({"seed": seed, **found._asdict(), "faults": kinds, "took_s": round(time.monotonic() - began, 1)})
        if found.missed:
            failed += 1
            (arguments.keep / f"missed_{seed}.toml").write_text(scenario_toml(told), encoding="utf-8")
    least, seed = min(worst)
    _say({"runs": arguments.runs, "failed": failed, "arrived": arrived, "least_clearance_m": least, "of_seed": seed})


def page(lines: Sequence[dict[str, Any]]) -> str:
    """Return the page of so many runs."""
    stops = [one["worst_stop"] for one in lines if one["worst_stop"] > 0.0]
    least = sorted(lines, key=lambda one: float(one["clearance_m"]))
    clear_m = [float(one["clearance_m"]) for one in least]
    kinds = sorted({fault.split()[0] for one in lines for fault in one["faults"]})
    moved = [what for one in lines for what in one["missed"] if "moves" in what or "moved" in what]
    rows = {
        "runs": len(lines),
        "faults": sum(len(one["faults"]) for one in lines),
        "arrived": sum(one["reason"] == "arrived" for one in lines),
        "contacts": sum(one["reason"].startswith("contact") for one in lines),
        "motion on old data, or before arming": len(moved),
        "stops of the watchdog": sum(one["stops"] for one in lines),
        "their way over the stopping distance, median and worst": f"{np.median(stops):.2f}, {max(stops):.2f}"
        if stops
        else "",
        "least clearance of a run, least and median": f"{clear_m[0]:.3f} m, {np.median(clear_m):.2f} m",
    }
    table = "\n".join(f"| {name} | {value} |" for name, value in rows.items())
    worst = "\n".join(
        f"| {one['seed']} | {one['reason']} | {one['clearance_m']:.3f} | {'; '.join(one['faults'])} |"
        for one in least[:8]
    )
    return (
        "# Random faults\n\nWritten by `tools/evaluate/replay_faults.py`: drives of 34 m through the mine `short`, one to three "
        f"faults each, at chance times ({', '.join(kinds)}).\n\n| | |\n| --- | --- |\n{table}\n\n"
        "## The nearest to a wall\n\n| seed | what came of it | least clearance, m | faults (kind, target, begin + s) |\n"
        f"| --- | --- | --- | --- |\n{worst}\n"
    )


def _say(line: dict[str, Any]) -> None:
    print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
