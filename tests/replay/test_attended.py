"""A machine that somebody attends: armed, answered and stopped by his commands alone, and the same again by its journal."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from lhdmap.config import Settings
from lhdmap.console.attendant import Recorded
from lhdmap.console.messages import ANSWER, REARM, STOP, Ask, Command, Event, Outcome, Plan, Status
from lhdmap.errors import InputError, UsageError
from lhdmap.loading.assistance import Request
from lhdmap.replay import journal as journals
from lhdmap.replay.assemble import Watchers, assemble, parts_of
from lhdmap.replay.assemble_station import check_attended
from lhdmap.replay.journal import Journal
from lhdmap.replay.process import LOADING, MACHINE_SAYS, STATE, Received
from lhdmap.replay.processes.attended import Attended
from lhdmap.replay.processes.film import Film
from lhdmap.replay.processes.shown import Shown
from lhdmap.replay.processes.told import Health, LoadingNow, Word
from lhdmap.replay.scenario import ModeAt, Scenario
from lhdmap.settings_tree import tree_from
from lhdmap.simulation.history import SECOND_NS, START_NS

from tests.replay.short import tram

STANDS = Health(START_NS, False, "idle", True, ("not armed yet",))
ARMED = Health(START_NS, True, "autonomous", True, ())


class Script:
    """Commands at seconds after the start."""

    def __init__(self, *commands: tuple[float, Command]) -> None:
        self.left = list(commands)
        self.outcomes: list[Outcome] = []
        self.events: list[Event] = []
        self.plans: list[Plan] = []
        self.seen: list[tuple[Status, Ask | None]] = []
        self.shows, self.notes, self.told = self.plans.append, self.events.append, self.outcomes.append

    def attend(self, now_ns: int, status: Status, request: Ask | None) -> Sequence[Command]:
        self.seen.append((status, request))
        found = [command for at_s, command in self.left if now_ns - START_NS >= at_s * SECOND_NS]
        self.left = self.left[len(found) :]
        return found


def words(script: Script, health: Health, for_s: float = 1.0, loading: LoadingNow | None = None) -> list[Word]:
    """Return what is said where the machine tells the same all the time."""
    one = Attended(script, (ModeAt(),), Shown(on_map=False), Journal().of("station"))
    said = []
    for k in range(round(50 * for_s)):
        now_ns = START_NS + k * SECOND_NS // 50
        inbox = [Received(MACHINE_SAYS, now_ns, health)]
        inbox += [] if loading is None else [Received(LOADING, now_ns, loading)]
        said += [out.message for out in one.step(now_ns, inbox)]
    return said


def command(kind: str, number: int = 0, answer: str = "", cause: str = "") -> Command:
    return Command("c", kind, number, answer, "anna", cause)


def test_nothing_is_armed_or_answered_without_a_command() -> None:
    said = words(Script(), STANDS._replace(asks="assistance: no route"), 60.0)
    assert not any(word.rearm or word.go_on or word.answer or word.mode for word in said)
    assert len(said) == 600  # a sign of life ten times a second


def test_a_command_to_arm_arms_once_for_the_mode_that_is_wanted() -> None:
    said = words(Script((0.5, command(REARM))), STANDS)
    assert [word.mode for word in said if word.rearm] == ["autonomous"]


@pytest.mark.parametrize(("health", "why"), [(STANDS._replace(standing=False), "moves"), (ARMED, "armed")])
def test_what_moves_or_is_armed_is_not_armed(health: Health, why: str) -> None:
    script = Script((0.5, command(REARM)))
    assert not any(word.rearm for word in words(script, health))
    assert not script.outcomes[0].taken
    assert why in script.outcomes[0].why


def test_a_stop_goes_out_in_the_same_turn_with_its_cause() -> None:
    said = words(Script((0.5, command(STOP, cause="operator's page silent for 0.46 s"))), ARMED)
    ((at_ns, stop),) = [(word.stamp_ns, word.stop) for word in said if word.stop]
    assert (at_ns - START_NS, stop) == (SECOND_NS // 2, "operator's page silent for 0.46 s")


def test_an_answer_reaches_the_loading_task_with_its_name_and_one_to_another_request_does_not() -> None:
    request = Request(2, START_NS, "loading", "charging", "time limit", ("a",), {"fill": 0.31, "log": "x"}, "free it")
    now = LoadingNow(START_NS, 1, "loading_assistance", "", 1, 0.3, 0.03, request)
    script = Script((0.2, command(ANSWER, 2, "go_on")), (0.4, command(ANSWER, 1, "loaded")))  # the page's numbers
    answers = [word.answer for word in words(script, ARMED, loading=now) if word.answer]
    assert [(one.number, one.kind, one.by) for one in answers] == [(2, "loaded", "anna")]
    assert [outcome.taken for outcome in script.outcomes] == [False, True]
    shown = script.seen[-1][1]
    assert shown is not None
    assert (shown.why, shown.tried, shown.evidence) == ("time limit", ("a",), (("fill", "0.31"), ("log", "x")))


def test_what_the_machine_still_says_of_a_request_that_has_ended_is_no_new_one() -> None:
    request = Request(1, START_NS, "positioning", "positioning", "operator took over", (), {}, "free it")
    shown, now = Shown(on_map=False), LoadingNow(START_NS, 1, "held", "", 1, 0.3, 0.03, None)
    asks = ARMED._replace(asks="assistance: operator took over")
    told = [
        (now._replace(request=request), ARMED),
        (now._replace(request=request), asks),
        (now, asks),
        (now, ARMED),
        (now, asks),
    ]
    numbers = []
    for loading, health in told:
        shown.take(Received(LOADING, START_NS, loading))
        shown.take(Received(MACHINE_SAYS, START_NS, health))
        asked = shown.request()
        numbers.append(None if asked is None else (asked.number, asked.kind))
    assert numbers == [(1, "positioning"), (1, "positioning"), None, None, (2, "navigation")]


def test_navigation_is_told_to_go_on_as_long_as_it_asks_and_is_given_up_for_good() -> None:
    asks = ARMED._replace(asks="assistance: no route")
    said = words(Script((0.5, command(ANSWER, 1, "go_on"))), asks)
    assert {word.go_on for word in said if word.stamp_ns - START_NS < SECOND_NS // 2} == {False}
    assert {word.go_on for word in said if word.stamp_ns - START_NS >= SECOND_NS // 2} == {True}
    given_up = words(Script((0.5, command(ANSWER, 1, "abort"))), asks)
    assert given_up[-1].gave_up == "anna aborts: no route"
    assert given_up[-1].mode == "idle"
    script = Script((0.5, command(ANSWER, 1, "loaded")))
    words(script, asks)
    assert not script.outcomes[0].taken


def test_what_only_the_simulator_knows_is_not_shown() -> None:
    script = Script()
    one = Attended(script, (ModeAt(),), Shown(on_map=False), Journal().of("station"))
    for process in ("monitor", "plant", "faults", "engine", "executor"):
        one.heard(journals.Event(START_NS, process, "contact"))
    assert [event.process for event in script.events] == ["executor"]
    assert STATE not in one.reads


@pytest.mark.parametrize(
    "table",
    [{"kind": "grizzly", "rocks": 1, "mine": ""}, {"mine": "ring", "driver": "operator"}, {"mine": "ring"}],
)
def test_who_has_nobody_that_asks_cannot_be_attended(table: dict[str, object]) -> None:
    with pytest.raises(UsageError, match="nobody asks"):
        check_attended(tree_from(Scenario, table))


def test_a_journal_is_wanted(tmp_path: Path) -> None:
    for text in (
        "x",
        '{"process": "station", "event": "command", "t_ns": 1, "cause": "", "values": {"id": "a", "kind": "drive"}}',
    ):
        (tmp_path / "journal.jsonl").write_text(text)
        with pytest.raises(InputError, match="journal"):
            Recorded.of(tmp_path / "journal.jsonl")


def drive(folder: Path, attendant: Script | Recorded, path: Path, for_s: float) -> list[tuple[float, float]]:
    """Drive through the mine `short`; return seconds and true speeds."""
    told = tram(folder)
    parts = replace(parts_of(told, folder, Settings()), attendant=attendant)
    journal, film = Journal(path), Film(parts.machine)
    run = assemble(told, parts, journal, Watchers(film))
    for _ in run.engine.run(START_NS + round(for_s * SECOND_NS)):
        pass
    run.engine.finish()
    journal.close()
    return [(float(row[0]), float(row[6])) for row in film.series.rows()]


def test_a_stop_brakes_the_machine_until_it_is_armed_and_the_journal_does_it_again(
    taught: Path, tmp_path: Path
) -> None:
    script = Script((2.6, command(REARM)), (5.0, command(STOP, cause="operator's page silent for 0.46 s")))
    speeds = drive(taught, script, tmp_path / "first.jsonl", 7.5)
    assert max(speed for at_s, speed in speeds if at_s < 2.6) < 0.02
    assert max(speed for _, speed in speeds) > 0.5
    assert max(abs(speed) for at_s, speed in speeds if at_s > 7.0) < 0.02
    lines = [json.loads(line) for line in (tmp_path / "first.jsonl").read_text().splitlines()]
    stopped = next(
        line for line in lines if line["event"] == "watchdog: armed" and line["values"]["after"] == "disarmed"
    )
    assert stopped["cause"] == "operator's page silent for 0.46 s"
    assert (stopped["t_ns"] - START_NS) / SECOND_NS == pytest.approx(5.0, abs=0.021)
    assert script.plans[0].frame == "map"
    assert any(status.pose is not None for status, _ in script.seen)
    drive(taught, Recorded.of(tmp_path / "first.jsonl"), tmp_path / "again.jsonl", 7.5)
    assert (tmp_path / "again.jsonl").read_bytes() == (tmp_path / "first.jsonl").read_bytes()
