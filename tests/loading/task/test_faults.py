"""Each signal missing, frozen or late in each step of a cycle: a stop at once where it is needed, then help."""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Callable
from typing import Any

import pytest
from lhdmap.driving.motion import Motion
from lhdmap.loading.follows import Follows
from lhdmap.loading.health import NEEDS, LoadingHealth
from lhdmap.loading.moment import LoadingInput
from lhdmap.loading.signals import Pedals, Signals
from lhdmap.loading.states import ASSISTANCE, State
from lhdmap.loading.task import limits_s
from lhdmap.loading.task_settings import LoadingSettings

from tests.loading.task.bench import SECOND_NS, Bench, bench

SETTINGS = LoadingSettings(hold_s=5.0, frozen_s=1.0)
PHASES = [
    (State.POSITIONING, "approach"), (State.POSITIONING, "align"), (State.POSITIONING, "lower"), (State.CHARGING, ""),
    (State.EXCAVATION, ""), (State.PULL_BACK, "rack"), (State.PULL_BACK, "back"), (State.PULL_BACK, "shake"),
    (State.WEIGHING, ""),
]  # fmt: skip
Change = Callable[[LoadingInput], LoadingInput]


@functools.cache
def begun() -> dict[tuple[State, str], Bench]:
    """The bench at the first call of each step of a cycle; the second one begins bent, so that its joint has to be corrected."""
    found: dict[tuple[State, str], Bench] = {}
    for one in (
        bench(start=(16.0, 0.0, 0.0), settings=SETTINGS),
        bench(start=(22.0, 0.3, 0.1), bend_rad=0.1, settings=SETTINGS),
    ):
        for _ in range(1500):
            out = one.run(0.04)
            key = out.state, out.phase
            if key in PHASES and key not in found:
                found[key] = copy.deepcopy(one)
            if len(found) == len(PHASES) or out.state == State.DONE:
                break
    assert set(found) == set(PHASES)
    return found


def broken(step: tuple[State, str], change: Change) -> tuple[Bench, int]:
    """A bench of which something is broken from a step on; when it broke."""
    one = copy.deepcopy(begun()[step])
    one.change = change
    return one, one.now_ns


def nan(field: str) -> Change:
    def broken_so(told: LoadingInput) -> LoadingInput:
        assert told.signals is not None
        change: dict[str, Any] = {field: math.nan}
        return told._replace(signals=told.signals._replace(**change))

    return broken_so


def frozen(field: str) -> Change:
    kept: list[float] = []

    def broken_so(told: LoadingInput) -> LoadingInput:
        assert told.signals is not None
        kept.append(getattr(told.signals, field))
        change: dict[str, Any] = {field: kept[0]}
        return told._replace(signals=told.signals._replace(**change))

    return broken_so


def late(told: LoadingInput) -> LoadingInput:
    assert told.signals is not None
    return told._replace(signals=told.signals._replace(now_ns=told.now_ns - SECOND_NS))


def late_motion(told: LoadingInput) -> LoadingInput:
    assert told.motion is not None
    return told._replace(motion=told.motion._replace(stamp_ns=told.now_ns - SECOND_NS))


def jumped_joint(told: LoadingInput) -> LoadingInput:
    assert told.motion is not None
    return told._replace(motion=told.motion._replace(x_m=math.nan))


ALL: dict[str, Change] = {
    "no signals": lambda told: told._replace(signals=None),
    "no motion": lambda told: told._replace(motion=None),
    "signals late": late,
    "motion late": late_motion,
    "motion not a number": jumped_joint,
    "pose not trusted": lambda told: told._replace(pose_good=False),
}


@pytest.mark.parametrize("fault", ALL)
@pytest.mark.parametrize("step", PHASES, ids=lambda step: f"{step[0].value}-{step[1]}")
def test_without_what_all_need_it_stands_at_once_and_asks(step: tuple[State, str], fault: str) -> None:
    one, broke_ns = broken(step, ALL[fault])
    out = one.run(0.05)
    assert out.state == State.HELD
    assert out.directive is None
    assert out.pedals is None
    out = one.run(10.0, lambda said: said.request is not None)
    assert out.state in ASSISTANCE
    assert (one.now_ns - broke_ns) * 1e-9 < SETTINGS.hold_s + 0.2
    before = step[0] == State.POSITIONING
    assert out.state == (State.POSITIONING_ASSISTANCE if before else State.LOADING_ASSISTANCE)


NEEDED = [(step, field) for step, fields in NEEDS.items() for field in fields]


@pytest.mark.parametrize(("step", "field"), NEEDED, ids=lambda one: "-".join(one) if isinstance(one, tuple) else one)
def test_a_needed_signal_that_is_not_a_number_stops_the_step(step: tuple[State, str], field: str) -> None:
    one, broke_ns = broken(step, nan(field))
    assert one.run(0.05).state == State.HELD
    calls = len(one.said)
    out = one.run(200.0, lambda said: said.request is not None or said.state == State.DONE)
    if field == "articulation_rad":  # it cannot be validated without the joint
        assert out.state in ASSISTANCE
    assert out.state in ASSISTANCE or out.state == State.DONE or step[0] in (State.CHARGING, State.EXCAVATION)
    assert (one.now_ns - broke_ns) * 1e-9 < sum(
        limits_s(SETTINGS)[state] for state in (State.HELD, State.PULL_BACK)
    ) + 80.0
    entered = [said.state for said in one.said[calls:]]
    assert step[0] not in entered or step[0] in (State.POSITIONING, State.PULL_BACK, State.WEIGHING)


PRESSURES = [(step, field) for step, field in NEEDED if field.endswith("_bar")]


@pytest.mark.parametrize(("step", "field"), PRESSURES, ids=lambda one: "-".join(one) if isinstance(one, tuple) else one)
def test_a_frozen_pressure_is_found_or_the_step_ends_within_its_limit(step: tuple[State, str], field: str) -> None:
    one, broke_ns = broken(step, frozen(field))
    one.run(200.0, lambda said: said.state != step[0] or said.phase != step[1])
    assert (one.now_ns - broke_ns) * 1e-9 < limits_s(SETTINGS)[step[0]] + 0.1


@pytest.mark.parametrize("field", ["tilt_bar"])
def test_a_bucket_whose_pressure_is_frozen_is_not_pressed_on_and_on(field: str) -> None:
    one, broke_ns = broken((State.POSITIONING, "lower"), frozen(field))
    out = one.run(60.0, lambda said: said.state == State.HELD)
    assert out.state == State.HELD
    assert (one.now_ns - broke_ns) * 1e-9 < SETTINGS.frozen_s + 0.2


def test_scan_odometry_that_stops_ends_the_charge() -> None:
    def change(told: LoadingInput) -> LoadingInput:
        assert told.signals is not None
        return told._replace(signals=told.signals._replace(scan_ns=broke_ns))

    one = copy.deepcopy(begun()[State.CHARGING, ""])
    broke_ns, one.change = one.now_ns, change
    out = one.run(5.0, lambda said: said.state == State.HELD)
    assert out.state == State.HELD
    assert (one.now_ns - broke_ns) * 1e-9 < SETTINGS.scan_age_s + 0.1


def test_without_wall_points_nothing_is_corrected() -> None:
    one, _ = broken((State.POSITIONING, "align"), lambda told: told._replace(walls_m=None))
    assert one.run(0.05).state == State.HELD


@pytest.mark.parametrize("step", PHASES, ids=lambda step: f"{step[0].value}-{step[1]}")
@pytest.mark.parametrize("gap", ["late", "backwards"])
def test_a_task_that_is_not_called_stops(step: tuple[State, str], gap: str) -> None:
    one = copy.deepcopy(begun()[step])
    one.now_ns += SECOND_NS if gap == "late" else -SECOND_NS
    one.now_ns -= one.now_ns % 40_000_000
    assert one.run(0.03).state == State.HELD


@pytest.mark.parametrize("step", PHASES, ids=lambda step: f"{step[0].value}-{step[1]}")
@pytest.mark.parametrize("way", ["disarmed", "emergency", "idle"])
def test_after_a_stop_it_does_not_go_on_from_where_it_was(step: tuple[State, str], way: str) -> None:
    """Disarmed for two seconds, then armed: at rest for the time of validation, then from the beginning of what fits."""
    changes: dict[str, Change] = {
        "disarmed": lambda told: told._replace(armed=False),
        "emergency": lambda told: told._replace(emergency=True, armed=False),
        "idle": lambda told: told._replace(mode="idle"),
    }
    one, _ = broken(step, changes[way])
    out = one.run(2.0)
    assert out.state == (State.EMERGENCY if way == "emergency" else State.HELD)
    one.change = lambda told: told
    out = one.run(SETTINGS.valid_s - 0.2)
    assert out.directive is None
    assert out.pedals is None
    out = one.run(1.0, lambda said: said.state != State.HELD)
    if way == "emergency":
        assert out.state in ASSISTANCE
    else:
        free = step[0] == State.POSITIONING
        assert out.state in ((State.IDENTIFICATION, State.POSITIONING) if free else (State.PULL_BACK,))


def test_a_bucket_that_is_asked_and_does_not_follow_ends_the_dig() -> None:
    """The dig of the bench asks for half of the tilt for 3 s: frozen, that is seen after 1 s at full pedal."""
    one, broke_ns = broken((State.EXCAVATION, ""), frozen("bucket_rad"))
    out = one.run(5.0, lambda said: said.state == State.HELD)
    assert out.state == State.HELD
    assert (one.now_ns - broke_ns) * 1e-9 == pytest.approx(2.0 * SETTINGS.follows_s, abs=0.2)
    assert "bucket_rad does not follow" in one.notes[-1][1].cause
    one.run(3.0)
    assert one.said[-1].state == State.HELD  # nothing is moved by a reading that is old


def test_short_lifts_of_a_frozen_boom_count_together_and_a_change_ends_it() -> None:
    boom, quiet = Follows(1.0), Signals(0, 0.0, 0.0, 0, 0.0, 0.1, -0.5, 0.0, 200.0, 50.0, 20.0)
    found = {}
    for k in range(300):  # 0.2 s of lift each second
        found[k] = boom.update(k * 20_000_000, quiet, Pedals(lift=float(k % 50 < 10)))
    first = min(k for k, names in found.items() if names)
    assert found[first] == ("boom_rad does not follow",)
    assert 4.9 < 0.02 * first < 5.3
    assert boom.update(6 * SECOND_NS, quiet._replace(boom_rad=0.1001), Pedals(lift=1.0)) == ()
    assert not any(boom.update((7 + k) * SECOND_NS, quiet, Pedals()) for k in range(9))


@pytest.mark.parametrize(("tacho_mps", "held"), [(0.7, True), (0.0, False)])
def test_wheels_that_say_the_same_are_frozen_unless_they_stand(tacho_mps: float, held: bool) -> None:
    health = LoadingHealth(SETTINGS)
    found: tuple[str, ...] = ()
    for k in range(60):
        now_ns = k * 40_000_000
        bars = (200.0 + 0.1 * k, 50.0 + 0.1 * k, 20.0 + 0.1 * k)
        signals = Signals(now_ns, tacho_mps, 0.7, now_ns, 0.0, 0.1, -0.5, 0.0, *bars)
        motion = Motion(now_ns, 0.0, 0.0, 0.0, 0.7, 0.0, 0.0)
        found = health.check(LoadingInput(now_ns, signals, motion), State.CHARGING, "")
    assert found == (("tacho_mps is frozen",) if held else ())
