"""Those who answer: the script of a replay, the terminal."""

from __future__ import annotations

import pytest
from lhdmap.cli.operator import TerminalAttendant, TerminalOperator, shown_lines
from lhdmap.console.messages import Ask, Outcome, Status
from lhdmap.errors import InputError
from lhdmap.loading.assistance import ABORT, GO_ON, LOADED, Answer, Operator, Reply, Request, ScriptedOperator

REQUEST = Request(
    3, 1_000_000_000, "loading", "excavation", "time limit", ("charging: collision detected",),
    {"cloud": "run.mcap@12.3", "lift_bar": 81.23456}, "free the machine",
)  # fmt: skip


def typed(*lines: str) -> tuple[TerminalOperator, list[str]]:
    left, shown = list(lines), []

    def read(prompt: str) -> str:
        shown.append(prompt)
        if not left:
            raise EOFError
        return left.pop(0)

    return TerminalOperator(read, shown.append), shown


def test_what_is_typed_is_the_answer() -> None:
    for line, kind in (("g", GO_ON), ("loaded", LOADED), (" A ", ABORT)):
        operator, _ = typed(line)
        assert operator.answer(REQUEST, 0) == Answer(3, kind, by="terminal")


def test_what_is_no_answer_is_asked_again_and_a_closed_terminal_aborts() -> None:
    operator, shown = typed("perhaps", "")
    assert operator.answer(REQUEST, 0) == Answer(3, ABORT, by="terminal")
    assert any("'perhaps' is no answer" in line for line in shown)


def test_a_request_is_shown_whole() -> None:
    text = "\n".join(shown_lines(REQUEST))
    for part in (
        "request 3",
        "excavation",
        "time limit",
        "collision detected",
        "run.mcap@12.3",
        "81.23",
        "free the machine",
    ):
        assert part in text


def test_a_script_answers_when_it_is_time_and_only_what_it_knows() -> None:
    operator: Operator = ScriptedOperator([Reply("time limit", LOADED, 20.0), Reply("positioning", GO_ON, 1.0)])
    assert operator.answer(REQUEST, 20_000_000_000) is None
    assert operator.answer(REQUEST, 21_000_000_000) == Answer(3, LOADED, by="script")
    other = REQUEST._replace(why="stuck", kind="positioning")
    assert operator.answer(other, 5_000_000_000) == Answer(3, GO_ON, by="script")
    assert operator.answer(other._replace(kind="loading"), 500_000_000_000) is None


STANDS = Status(3.0, False, "idle", True, ("not armed yet",))
SECOND_NS = 1_000_000_000
ASK = Ask(3, "loading", "excavation", "time limit", "free the machine")


def attendant(*lines: str) -> tuple[TerminalAttendant, list[str]]:
    left, shown = list(lines), []

    def read(prompt: str) -> str:
        shown.append(prompt)
        if not left:
            raise EOFError
        return left.pop(0)

    return TerminalAttendant(read, shown.append), shown


def test_at_a_terminal_leave_to_arm_holds_for_a_stop_while_arming_is_refused() -> None:
    one, shown = attendant("y", "no")
    kinds = [command.kind for k in range(100) for command in one.attend(k * SECOND_NS // 50, STANDS, None)]
    assert kinds == ["rearm"] * 4
    assert len(shown) == 2
    assert "not armed yet" in shown[0]
    armed = STANDS._replace(armed=True)
    assert not one.attend(2 * SECOND_NS, armed, None)
    assert not one.attend(3 * SECOND_NS, STANDS._replace(causes=("link lost",)), None)  # asked anew: no
    assert "link lost" in shown[2]


def test_a_machine_that_moves_is_not_asked_for() -> None:
    one, shown = attendant()
    assert not one.attend(0, STANDS._replace(standing=False), None)
    assert shown == []


def test_at_a_terminal_a_request_is_answered_once_and_again_where_the_answer_does_not_fit() -> None:
    one, shown = attendant("loaded", "g")
    (answer,) = one.attend(0, STANDS, ASK)
    assert (answer.kind, answer.number, answer.answer, answer.by) == ("answer", 3, LOADED, "terminal")
    one.told(Outcome(answer.id, taken=False, why="go_on, abort was wanted"))
    assert shown[-1] == "go_on, abort was wanted"
    (again,) = one.attend(1, STANDS, ASK)
    assert again.answer == GO_ON
    one.told(Outcome(again.id, taken=True))
    assert not one.attend(2, STANDS._replace(armed=True), ASK)


def test_without_a_terminal_nothing_is_armed() -> None:
    one, _ = attendant()
    with pytest.raises(InputError, match="nobody arms"):
        one.attend(1, STANDS, None)
