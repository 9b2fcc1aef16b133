"""The task driven at random: faults, stops, takeovers, answers in any order, on the bench; what must hold after every call."""

from __future__ import annotations

from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from lhdmap.loading.assistance import ANSWERS, Answer
from lhdmap.loading.moment import LoadingInput, LoadingOutput, Mission
from lhdmap.loading.states import ASSISTANCE, MOVING, RESTING, State
from lhdmap.loading.task import limits_s
from lhdmap.loading.task_settings import LoadingSettings

from tests.loading.task.bench import Bench, Until, bench

SETTINGS = LoadingSettings(hold_s=6.0, assist_s=20.0, assists=3, holds=3, valid_s=0.5)
LIMITS_S = limits_s(SETTINGS)
_CALL_S = 0.045
_BLIND = ("signals", "motion")


class Loading(RuleBasedStateMachine):
    """A bench whose inputs are disturbed."""

    def __init__(self) -> None:
        super().__init__()
        self.wrong: dict[str, Any] = {}
        self.told: list[tuple[LoadingInput, LoadingOutput]] = []
        self.answered = ""
        self.looked = 0

    @initialize(x=st.floats(8.0, 22.0), y=st.floats(-0.4, 0.4), heading=st.floats(-0.1, 0.1), fill=st.floats(0.3, 1.0))
    def begin(self, x: float, y: float, heading: float, fill: float) -> None:
        self.one: Bench = bench(start=(x, y, heading), fill=fill, rule=Until(0.8, 3), settings=SETTINGS)
        self.one.change = self._told
        update = self.one.task.update

        def watched(told: LoadingInput) -> LoadingOutput:
            out = update(told)
            self.told.append((told, out))
            return out

        self.one.task.update = watched  # type: ignore[method-assign]

    def _told(self, told: LoadingInput) -> LoadingInput:
        asked = self.one.said[-1].request if self.one.said else None
        if self.answered and asked is not None:
            told = told._replace(answer=Answer(asked.number, self.answered))
            self.answered = ""
        return told._replace(**self.wrong)

    @rule(seconds=st.sampled_from((0.3, 1.0, 4.0, 12.0)))
    def goes_on(self, seconds: float) -> None:
        self.one.run(seconds)

    @rule(name=st.sampled_from(("armed", "emergency", "idle", "teleoperated", "pile", "walls_m", "pose_good", *_BLIND)))
    def breaks(self, name: str) -> None:
        values: dict[str, dict[str, Any]] = {
            "armed": {"armed": False},
            "emergency": {"emergency": True, "armed": False},
            "idle": {"mode": "idle"},
            "teleoperated": {"mode": "teleoperated"},
            "pose_good": {"pose_good": False},
        }
        self.wrong |= values.get(name, {name: None})
        self.one.run(0.2)

    @precondition(lambda self: self.wrong)
    @rule()
    def mends(self) -> None:
        self.wrong = {}
        self.one.run(0.3)

    @rule(kind=st.sampled_from(ANSWERS))
    def is_answered(self, kind: str) -> None:
        self.answered = kind
        self.one.run(0.2)
        self.answered = ""

    @precondition(lambda self: self.told and self.told[-1][1].state in RESTING)
    @rule()
    def another_mission(self) -> None:
        number = max(one.mission.number for one, _ in self.told if one.mission is not None) + 1
        self.wrong["mission"] = Mission(number, (30.0, 0.0))
        self.one.run(0.2)

    @invariant()
    def all_calls_are_right(self) -> None:
        for k in range(max(self.looked, 1), len(self.told)):
            self._right(k)
        self.looked = len(self.told)

    def _right(self, k: int) -> None:
        told, out = self.told[k]
        moves = out.directive is not None or out.pedals is not None
        blind = told.signals is None or told.motion is None or not told.pose_good
        if blind or not told.armed or told.mode != "autonomous" or told.emergency:
            assert not moves
            assert out.state not in MOVING
        assert not (out.directive is not None and out.pedals is not None)
        assert not moves or out.state in MOVING
        assert (out.request is not None) == (out.state in ASSISTANCE)
        if told.emergency:
            assert out.state == State.EMERGENCY
        before = self.told[k - 1][1].state
        if out.state == State.DONE and before != State.DONE:
            assert before == State.WEIGHING
        if before not in MOVING and out.state in MOVING:
            assert before == State.HELD or before in RESTING - {State.EMERGENCY}
            self._was_valid(k, held=before == State.HELD)

    def _was_valid(self, k: int, *, held: bool) -> None:
        """What goes on after a stop was ready, and at rest, for all of the time of validation."""
        now_ns = self.told[k][0].now_ns
        for told, _ in reversed(self.told[: k + 1]):
            if now_ns - told.now_ns > SETTINGS.valid_s * 1e9:
                return
            assert told.armed
            assert told.mode == "autonomous"
            assert told.motion is not None
            assert not held or abs(told.motion.speed_mps) < SETTINGS.standing_mps

    def teardown(self) -> None:
        """No state lasts longer than its limit; each charge is weighed before the next one, or the mission ends in help."""
        since_ns, state, charged = 0, State.IDLE, False
        for told, out in self.told:
            if out.state != state:
                since_ns, state = told.now_ns, out.state
                assert not (charged and state in (State.IDENTIFICATION, State.POSITIONING, State.DONE))
                charged = (charged or state == State.CHARGING) and state not in (
                    State.WEIGHING,
                    State.ABORTED,
                    State.IDLE,
                )
            if state in LIMITS_S:
                assert (told.now_ns - since_ns) * 1e-9 <= LIMITS_S[state] + _CALL_S


TestLoading = Loading.TestCase
TestLoading.settings = settings(
    max_examples=6, stateful_step_count=20, deadline=None, suppress_health_check=list(HealthCheck)
)
