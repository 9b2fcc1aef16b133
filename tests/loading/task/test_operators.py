"""Those who answer: the script of a replay, the terminal."""

from __future__ import annotations

from lhdmap.cli.operator import TerminalOperator, shown_lines
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
