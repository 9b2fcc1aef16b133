"""Faults while a machine loads, with perception in the loop: `evaluation/loading_faults.md`.

    python -m tools.evaluate.loading_faults run [SCENARIO] [--rounds N]
    python -m tools.evaluate.loading_faults page

Each sensor dead, frozen, biased, delayed by 0.5 s, and the operator's link lost, for 10 s, in each state of the loading machine.
Not all combinations are run: a round has each (sensor, fault) once and, of each fault, each state at least once; further rounds
pair them otherwise; to them come sensors that freeze where the state lives on them. Each run adds a line to
evaluation/loading_faults.jsonl; what is there is not run again.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from lhdmap.config import Settings
from lhdmap.loading.states import State
from lhdmap.replay.scenario import find_scenario, load_scenario
from lhdmap.simulation.sensing.faults import FaultSettings

from tools.evaluate.loading_fault_runs import PRESSURES, Live, in_a_copy, moments, started, with_fault
from tools.evaluate.loading_faults_page import page
from tools.evaluate.replay_faults import FRONT, INCLINOMETER, JOINTS, REAR, SIZES, TACHOMETER

DATA, PAGE = Path("evaluation/loading_faults.jsonl"), Path("evaluation/loading_faults.md")
TRANSMISSION, LIFT, TILT = PRESSURES
SENSORS = (FRONT, JOINTS, TILT, TRANSMISSION, TACHOMETER, LIFT, REAR, INCLINOMETER)
FAULTS = ("dead", "frozen", "biased", "delayed")
LINK = ("link", "link_lost")
LASTS_S, DELAY_S, BIAS_PA = 10.0, 0.5, 2e6
WINDOWS_S = {
    State.IDENTIFICATION: (0.5, 6.0),
    State.POSITIONING: (0.5, 14.0),
    State.CHARGING: (0.5, 5.0),
    State.EXCAVATION: (0.5, 12.0),
    State.PULL_BACK: (0.5, 11.0),
    State.WEIGHING: (0.5, 5.0),
    State.POSITIONING_ASSISTANCE: (0.5, 15.0),
}
"""When in a state a fault begins, by chance: as long as each lasts, about, where nothing is wrong."""
MORE = (
    (State.POSITIONING, JOINTS, "frozen"), (State.CHARGING, TACHOMETER, "frozen"), (State.CHARGING, TRANSMISSION, "frozen"),
    (State.EXCAVATION, TACHOMETER, "frozen"), (State.EXCAVATION, TRANSMISSION, "frozen"), (State.PULL_BACK, JOINTS, "frozen"),
    (State.WEIGHING, JOINTS, "frozen"), (State.WEIGHING, LIFT, "frozen"),
)  # fmt: skip
"""Beside the rounds: what says the same with new stamps, where the state lives on it."""
SHORT_S = 4.0  # positioning may take no longer where help is to be asked for


class Case(NamedTuple):
    """A fault of a sensor in a state, so long after it has begun."""

    state: State
    sensor: str
    kind: str
    after_s: float

    @property
    def key(self) -> tuple[str, str, str]:
        """What tells it from the others."""
        return self.state.value, self.sensor, self.kind

    def fault(self) -> FaultSettings:
        """Return it as a fault."""
        size = {"delayed": DELAY_S}.get(self.kind, 0.0)
        if self.kind == "biased":
            size = BIAS_PA if self.sensor in PRESSURES else SIZES["biased"][self.sensor]
        return FaultSettings(0.0, "", self.kind, self.sensor, LASTS_S, size)


def cases(rounds: int) -> list[Case]:
    """Return the combinations of so many rounds."""
    states = list(WINDOWS_S)
    pairs = [(state, *LINK) for state in states]
    for turn in range(rounds):
        for k, kind in enumerate(FAULTS):
            pairs += [(states[(j + 2 * k + 3 * turn) % 7], sensor, kind) for j, sensor in enumerate(SENSORS)]
    pairs += MORE
    rng = np.random.default_rng(20)
    return [Case(*one, round(float(rng.uniform(*WINDOWS_S[one[0]])), 1)) for one in dict.fromkeys(pairs)]


def main() -> int:
    """Run what is missing, or write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run")
    run.add_argument("scenario", nargs="?", default="loading_stope")
    run.add_argument("--rounds", type=int, default=1)
    commands.add_parser("page")
    asked = parser.parse_args()
    if asked.command == "run":
        done = {(one["state"], one["sensor"], one["kind"]) for one in _read()}
        left = [one for one in cases(asked.rounds) if one.key not in done]
        helped = [one for one in left if one.state == State.POSITIONING_ASSISTANCE]
        _drive(asked.scenario, helped, Settings(), short=True)
        _drive(asked.scenario, [one for one in left if one not in helped], Settings())
    PAGE.write_text(page(list(_read())), encoding="utf-8")
    return 0


def _drive(scenario: str, left: Sequence[Case], settings: Settings, *, short: bool = False) -> None:
    """Drive once, and give a copy each fault at its time."""
    if not left:
        return
    if short:
        settings = replace(settings, loading=replace(settings.loading, position_s=SHORT_S))
    live, waiting = started(load_scenario(find_scenario(scenario)), settings), list(left)
    for state, lasted_s in moments(live, 300.0):
        due = [one for one in waiting if one.state.value == state and lasted_s >= one.after_s]
        waiting = [one for one in waiting if one not in due]
        for one in due:
            in_a_copy(lambda one=one: _keep(one, live))  # type: ignore[misc]
        if not waiting:
            return
    print("not reached:", *(one.key for one in waiting), file=sys.stderr)


def _keep(case: Case, live: Live) -> None:
    fault = case.fault()
    row = dict(zip(("state", "sensor", "kind"), case.key, strict=True)) | {"size": fault.size}
    row |= with_fault(live, fault)
    with DATA.open("a", encoding="utf-8") as file:
        file.write(json.dumps(row) + "\n")
    print(*case.key, row["at_s"], row["missed"], file=sys.stderr, flush=True)


def _read() -> Iterator[dict[str, Any]]:
    if DATA.is_file():
        yield from (json.loads(line) for line in DATA.read_text(encoding="utf-8").splitlines())


if __name__ == "__main__":
    raise SystemExit(main())
