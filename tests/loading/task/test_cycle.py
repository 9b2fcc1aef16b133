"""Whole cycles on the bench: a kinematic machine in a drift, real guidance, simple controllers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from lhdmap.loading.assistance import ABORT, GO_ON, LOADED, Reply, ScriptedOperator
from lhdmap.loading.digging_parts import Controllers
from lhdmap.loading.moment import LoadingInput, LoadingOutput
from lhdmap.loading.signals import Pedals, Turn
from lhdmap.loading.states import ASSISTANCE, State
from lhdmap.loading.task_settings import LoadingSettings

from tests.loading.task.bench import Bench, Drift, Until, bench, controllers, shown

OVER = (State.DONE, State.ABORTED)


def over(out: LoadingOutput) -> bool:
    return out.state in OVER


def states(one: Bench) -> list[str]:
    return [note.after for _, note in one.notes if note.event == "state"]


CYCLE = [
    State.IDENTIFICATION, State.POSITIONING, State.CHARGING, State.EXCAVATION, State.PULL_BACK, State.WEIGHING,
]  # fmt: skip


def test_a_cycle_from_the_drift_to_a_weighed_bucket() -> None:
    one = bench(start=(8.0, 0.3, 0.1), guided=True)
    out = one.run(120.0, over)
    assert states(one) == [*CYCLE, State.DONE]
    assert (out.attempts, out.fill, out.assists) == (1, 0.9, 0)
    assert min(one.rooms_m) > 0.0


def test_it_hands_over_to_the_correction_while_it_rolls() -> None:
    one = bench(start=(8.0, 0.2, 0.0), guided=True)
    one.run(60.0, lambda out: out.phase == "lower")
    began = next(k for k, out in enumerate(one.said) if out.phase == "approach")
    rolling = [out.phase for out in one.said[began:]]
    assert rolling == sorted(rolling, key=["approach", "align", "lower"].index)
    # fast enough at the hand-over that it cannot have stopped
    at = next(k for k, out in enumerate(one.said) if out.phase in ("align", "lower"))
    assert one.speeds_mps[at // 5 - 1] > 0.5


def test_attempts_go_on_until_the_bucket_is_full_and_each_is_weighed() -> None:
    fills = iter([0.5, 0.7, 0.92])
    weigh = shown(
        lambda s, n: Turn(Pedals(), "settled" if n == 100 else "", (("fill", next(fills) if n == 100 else 0.0),))
    )
    one = bench(start=(8.0, 0.0, 0.0), controllers=controllers()._replace(weigh=weigh), rule=Until(0.85))
    out = one.run(240.0, over)
    assert states(one) == [*CYCLE * 3, State.DONE]
    assert (out.attempts, out.fill) == (3, 0.92)


def test_each_attempt_begins_far_enough_from_the_pile() -> None:
    one = bench(start=(8.0, 0.0, 0.0), fill=0.5, rule=Until(0.85, most=2))
    one.run(240.0, over)
    ways = [note.values["way_m"] for _, note in one.notes if note.after == State.CHARGING]
    assert len(ways) == 2
    assert all(way > 2.0 for way in ways)


@pytest.mark.parametrize(("status", "why"), [("hang_up", "hang_up"), ("wall", "wall"), ("none", "none")])
def test_a_pile_that_is_not_loadable_is_one_for_an_operator(status: str, why: str) -> None:
    def change(told: LoadingInput) -> LoadingInput:
        return told._replace(pile=drift.snapshot(told.now_ns, status))

    drift = Drift()
    one = bench(drift=drift, start=(19.0, 0.0, 0.0), change=change)
    out = one.run(30.0, lambda said: said.request is not None)
    assert out.state == State.POSITIONING_ASSISTANCE
    assert out.request is not None
    assert why in out.request.why
    assert out.request.kind == "positioning"
    assert out.request.evidence["pile_status"] == status
    assert one.now_ns <= 12.1e9


def test_without_a_pile_15_m_before_it_help_is_asked_for_at_once() -> None:
    one = bench(start=(5.0, 0.0, 0.0), change=lambda told: told._replace(pile=None))
    out = one.run(30.0, lambda said: said.request is not None)
    assert out.state == State.IDENTIFICATION  # 25 m before it: it goes on looking
    one.truth.state[0] = 18.0  # joint 13.7 m before the draw point
    out = one.run(1.0, lambda said: said.request is not None)
    assert out.state == State.POSITIONING_ASSISTANCE


def never(pedals: Pedals) -> Any:
    return shown(lambda s, n: Turn(pedals))


def replaced(name: str, controller: Any) -> Controllers:
    change: dict[str, Any] = {name: controller}
    return controllers()._replace(**change)


@pytest.mark.parametrize(
    ("broken", "state", "limit_s"),
    [
        ("charge", State.CHARGING, 15.0),
        ("dig", State.EXCAVATION, 30.0),
        ("shake", State.PULL_BACK, 60.0),
        ("weigh", State.WEIGHING, 20.0),
    ],
)
def test_what_does_not_end_is_one_for_an_operator_at_its_limit(broken: str, state: State, limit_s: float) -> None:
    one = bench(start=(12.0, 0.0, 0.0), controllers=replaced(broken, never(Pedals())))
    out = one.run(200.0, lambda said: said.request is not None)
    assert out.state == State.LOADING_ASSISTANCE
    assert out.request is not None
    assert out.request.during == state
    note = one.notes[-1][1]
    assert math.isclose(note.values["after_s"], limit_s, abs_tol=0.05)
    assert len(out.request.tried) >= 3


@pytest.mark.parametrize("broken", ["charge", "dig", "weigh"])
def test_a_controller_that_gives_up_is_one_for_an_operator(broken: str) -> None:
    fails = shown(lambda s, n: Turn(Pedals(), "stuck", (("failed", 1.0),)))
    one = bench(start=(12.0, 0.0, 0.0), controllers=replaced(broken, fails))
    out = one.run(200.0, lambda said: said.request is not None)
    assert out.state == State.LOADING_ASSISTANCE
    assert "stuck" in (out.request.why if out.request else "")


def test_help_at_the_pile_ends_with_a_weighing() -> None:
    """An operator finishes by hand: his bucket is weighed, and the rule is asked."""
    one = bench(
        start=(12.0, 0.0, 0.0),
        controllers=controllers()._replace(dig=never(Pedals())),
        operator=ScriptedOperator([Reply("loading", LOADED, 20.0)]),
    )
    out = one.run(200.0, over)
    assert states(one)[-5:] == [State.EXCAVATION, State.LOADING_ASSISTANCE, State.HELD, State.WEIGHING, State.DONE]
    assert (out.attempts, out.assists) == (1, 1)
    assert math.isclose(out.assist_s, 20.0, abs_tol=0.1)


def test_help_at_the_pile_may_send_it_back_to_weigh_and_try_again() -> None:
    calls = []

    def dig(s: object, n: int) -> Turn:
        calls.append(n)
        return Turn(Pedals(), "racked" if len(calls) > 2000 else "")

    one = bench(
        start=(12.0, 0.0, 0.0),
        controllers=controllers()._replace(dig=shown(dig)),
        operator=ScriptedOperator([Reply("loading", GO_ON, 5.0)]),
    )
    one.run(200.0, over)
    assert states(one)[4:] == [
        State.LOADING_ASSISTANCE, State.HELD, State.PULL_BACK, State.WEIGHING, State.DONE,
    ]  # fmt: skip


def test_an_operator_may_abort_and_one_who_is_silent_ends_it_as_well() -> None:
    for operator, seconds in ((ScriptedOperator([Reply("loading", ABORT, 5.0)]), 5.0), (ScriptedOperator([]), 50.0)):
        one = bench(
            start=(12.0, 0.0, 0.0),
            controllers=controllers()._replace(dig=never(Pedals())),
            operator=operator,
            settings=LoadingSettings(assist_s=50.0),
        )
        out = one.run(200.0, over)
        assert out.state == State.ABORTED
        assert math.isclose(out.assist_s, seconds, abs_tol=0.1)


def test_an_answer_to_another_request_is_dropped() -> None:
    one = bench(start=(12.0, 0.0, 0.0), controllers=controllers()._replace(dig=never(Pedals())))
    out = one.run(200.0, lambda said: said.request is not None)
    assert out.request is not None
    from lhdmap.loading.assistance import Answer

    for answer in (Answer(out.request.number + 1, GO_ON), Answer(out.request.number, "drive")):
        one.change = lambda told, answer=answer: told._replace(answer=answer)  # type: ignore[misc]
        assert one.run(0.1).state == State.LOADING_ASSISTANCE
        assert any(note.event == "answer" for _, note in one.notes)


def test_a_marked_pile_counts_where_none_is_found() -> None:
    drift = Drift()
    one = bench(
        drift=drift,
        start=(14.0, 0.0, 0.0),
        change=lambda told: told._replace(pile=None),
        operator=ScriptedOperator([Reply("positioning", GO_ON, 5.0, drift.snapshot(0).estimate)]),
    )
    out = one.run(200.0, over)
    assert out.state == State.DONE
    assert out.assists == 1


def test_a_takeover_is_an_assistance_and_the_seconds_count() -> None:
    def change(told: LoadingInput) -> LoadingInput:
        by_hand = 6e9 < told.now_ns < 10e9
        return told._replace(mode="teleoperated" if by_hand else "autonomous")

    one = bench(start=(5.0, 0.0, 0.0), change=change, operator=ScriptedOperator([Reply("positioning", GO_ON, 6.0)]))
    out = one.run(200.0, over)
    assert states(one)[2:4] == [State.POSITIONING_ASSISTANCE, State.HELD]
    assert out.state == State.DONE
    assert math.isclose(out.assist_s, 6.0, abs_tol=0.1)


def test_too_near_to_the_pile_no_charge_begins() -> None:
    one = bench(start=(26.5, 0.0, 0.0))
    out = one.run(60.0, lambda said: said.request is not None)
    assert out.state in ASSISTANCE
    assert "too near" in (out.request.why if out.request else "")


def test_a_wall_point_in_a_box_is_one_for_an_operator() -> None:
    def change(told: LoadingInput) -> LoadingInput:
        near = told.motion is not None and told.motion.x_m > 20.5
        return told._replace(walls_m=np.array([[2.0, 1.0]]) if near else told.walls_m)

    one = bench(start=(12.0, 0.0, 0.0), change=change)
    out = one.run(60.0, lambda said: said.request is not None)
    assert out.state == State.POSITIONING_ASSISTANCE
    assert "wall" in (out.request.why if out.request else "")


def test_an_approach_that_stands_is_one_for_an_operator_before_its_limit() -> None:
    one = bench(start=(8.0, 0.0, 0.0))
    one._follow = lambda directive, step_s: None  # type: ignore[method-assign]
    out = one.run(30.0, lambda said: said.request is not None)
    assert out.state == State.POSITIONING_ASSISTANCE
    assert "does not drive on" in (out.request.why if out.request else "")
    assert one.now_ns < 10e9


def test_a_pull_back_that_was_interrupted_goes_on_and_is_no_longer() -> None:
    """Disarmed for two seconds in its middle: together it is as far as without."""

    def change(told: LoadingInput) -> LoadingInput:
        return told._replace(armed=not 0 < told.now_ns - broke_ns < 2e9)

    ends = []
    for stops in (False, True):
        one, broke_ns = bench(start=(16.0, 0.0, 0.0)), 10**12
        one.run(120.0, lambda out, one=one: out.phase == "back" and one.truth.state[0] < 26.0)  # type: ignore[misc]
        broke_ns = one.now_ns if stops else 10**12
        one.change = change
        assert one.run(60.0, over).state == State.DONE
        ends.append(one.truth.state[0])
    assert abs(ends[0] - ends[1]) < 0.5


def test_a_single_wrong_point_in_a_box_is_waited_out() -> None:
    def change(told: LoadingInput) -> LoadingInput:
        at.append(told.now_ns)
        assert told.walls_m is not None
        return told._replace(walls_m=np.vstack([told.walls_m, [[2.0, 1.0]]])) if len(at) % 7 == 0 else told

    at: list[int] = []
    one = bench(start=(22.0, 0.3, 0.1), bend_rad=0.1, change=change)
    assert one.run(40.0, lambda out: out.state == State.CHARGING or out.request is not None).state == State.CHARGING


def test_the_same_run_says_the_same() -> None:
    runs = [bench(start=(12.0, 0.2, 0.05)) for _ in range(2)]
    for one in runs:
        one.run(60.0, over)
    assert runs[0].notes == runs[1].notes
