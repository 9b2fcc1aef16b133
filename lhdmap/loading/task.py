"""The loading task: one object that is told what is, and says what is to be done. Time is an input; nothing else is read.

inputs -> what is wrong -> facts -> event -> state -> directive, pedals or stand
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lhdmap.driving.bodies import Bodies
from lhdmap.driving.model import DriveModel
from lhdmap.executor.notes import Note
from lhdmap.loading.assistance import LOADED, Answer
from lhdmap.loading.digging_parts import Controllers, Driven, Rule, Weighing
from lhdmap.loading.health import LoadingHealth
from lhdmap.loading.helping import Help
from lhdmap.loading.identification import Identification
from lhdmap.loading.memory import Memory
from lhdmap.loading.moment import AUTONOMOUS, OPERATED, LoadingInput, LoadingOutput, Moment, Part, Step
from lhdmap.loading.positioning_steps import Positioning
from lhdmap.loading.pull_back import PullBack, Trail
from lhdmap.loading.seen_again import face_behind_m
from lhdmap.loading.signals import Pedals
from lhdmap.loading.states import ASSISTANCE, MOVING, RESTING, TABLE, Event, Facts, State, event_of
from lhdmap.loading.task_settings import LoadingSettings

_NO_POINTS = np.zeros((0, 2))
_MOST_EVENTS = 4  # of one call


class LoadingTask:
    """Fig. 6 with its parts. `update` each 20 to 100 ms."""

    def __init__(
        self, model: DriveModel, bodies: Bodies, controllers: Controllers, rule: Rule, settings: LoadingSettings
    ) -> None:
        self._settings, self._health, self._help = settings, LoadingHealth(settings), Help()
        self._memory, self._trail = Memory(), Trail()
        lip = np.array([bodies.front_box_m[1, 0], 0.0])
        self._weighing = Weighing(controllers.weigh, rule)
        self._parts: dict[State, Part] = {
            State.IDENTIFICATION: Identification(model, settings),
            State.POSITIONING: Positioning(model, bodies, settings),
            State.CHARGING: Driven(controllers.charge, Event.COLLISION, lip, settings.toe_std_m),
            State.EXCAVATION: Driven(controllers.dig, Event.DUG, lip, settings.toe_std_m),
            State.PULL_BACK: PullBack(model, bodies, settings, controllers.shake, self._trail),
            State.WEIGHING: self._weighing,
        }
        self._notes: list[Note] = []
        self._asked: Pedals | None = None

    @property
    def state(self) -> State:
        """The state of now."""
        return self._memory.state

    def update(self, told: LoadingInput) -> LoadingOutput:
        """Return what is to be done now."""
        memory = self._memory
        self._count(told)
        answer = self._help.taken(told.answer)
        if self._help.refused:
            self._notes.append(Note("answer", cause=self._help.refused))
        step = Step("")
        for _ in range(_MOST_EVENTS):
            wrong = self._health.check(told, memory.state, self._phase(), self._asked)
            moment = self._moment(told)
            facts = self._facts(told, wrong, answer)
            event = event_of(memory.state, facts)
            step = Step(self._phase(), cause="; ".join(wrong))
            if event is None and memory.state in MOVING and moment is not None:
                step = self._parts[memory.state].step(moment)
                memory.target = step.target or memory.target
                late = self._late(told.now_ns)
                event = event_of(memory.state, facts._replace(outcome=step.event, expired=late))
            if event is None:
                break
            self._go(event, step, told, answer)
            answer = None
        notes, self._notes = tuple(self._notes), []
        moves = memory.state in MOVING and step.event is None
        self._asked = step.pedals if moves else None
        fills = self._weighing.fills
        return LoadingOutput(
            memory.state,
            step.phase,
            step.directive if moves else None,
            step.pedals if moves else None,
            self._help.request,
            notes,
            len(fills),
            fills[-1] if fills else math.nan,
            self._help.count,
            self._help.seconds,
            memory.target,
        )

    def _count(self, told: LoadingInput) -> None:
        """Count the seconds of assistance, and keep the way that the machine comes by."""
        memory = self._memory
        if memory.last_ns is not None and memory.state in ASSISTANCE:
            self._help.seconds += max(told.now_ns - memory.last_ns, 0) * 1e-9
        memory.last_ns = told.now_ns
        if told.motion is not None and memory.state in MOVING - {State.PULL_BACK}:
            self._trail.add(told.motion)

    def _phase(self) -> str:
        part = self._parts.get(self._memory.state)
        return part.phase if part is not None else ""

    def _moment(self, told: LoadingInput) -> Moment | None:
        memory = self._memory
        if told.signals is None or told.motion is None:
            return None
        walls = _NO_POINTS if told.walls_m is None else told.walls_m
        walls = walls[np.isfinite(walls).all(axis=1)]
        place = memory.mission.draw_point_m if memory.mission is not None else None
        return Moment(
            told.now_ns, told.signals, told.motion, walls, told.pile, told.approach, place, memory.target,
            memory.seen_ns, memory.marked, memory.face_m,
        )  # fmt: skip

    def _facts(self, told: LoadingInput, wrong: tuple[str, ...], answer: Answer | None) -> Facts:
        """Return what decides, but for what the state's part says."""
        memory = self._memory
        moving = memory.state in MOVING
        facts = Facts(
            told.emergency,
            told.armed,
            told.mode == AUTONOMOUS,
            told.mode in OPERATED,
            not wrong,
            self._wanted(told),
            not moving and self._late(told.now_ns),
            touched=memory.touched,
            loaded=memory.loaded,
            answer="" if answer is None else answer.kind,
        )
        return facts._replace(valid=memory.state in _VALIDATED and self._valid(told, facts))

    def _wanted(self, told: LoadingInput) -> bool:
        """Return whether there is a mission; at rest: another one than the last."""
        memory = self._memory
        last = None if memory.mission is None else memory.mission.number
        if told.mission is None:
            return False
        same = told.mission.number == last
        return same and memory.active if memory.state not in _AT_REST else not same

    def _valid(self, told: LoadingInput, facts: Facts) -> bool:
        """Return whether all that re-validation asks for has held for a while: ready, at rest, joint agrees, on the trail.

        A mission may begin while the machine rolls: there being ready is enough.
        """
        memory, settings = self._memory, self._settings
        good = facts.ready and told.motion is not None and told.signals is not None
        held = memory.state == State.HELD
        if good and held and told.motion is not None and told.signals is not None:
            good = abs(told.motion.speed_mps) < settings.standing_mps
            good &= abs(told.motion.articulation_rad - told.signals.articulation_rad) <= _JOINT_RAD
            if memory.touched and not memory.loaded:
                good &= self._trail.off_m(told.motion) < settings.off_trail_m
        if not good:
            memory.valid_ns = None
            return False
        memory.valid_ns = told.now_ns if memory.valid_ns is None else memory.valid_ns
        return told.now_ns - memory.valid_ns >= round(settings.valid_s * 1e9)

    def _late(self, now_ns: int) -> bool:
        """Return whether the state's time is over."""
        memory = self._memory
        limit_s = limits_s(self._settings).get(memory.state, math.inf)
        if memory.state == State.HELD and memory.holds > self._settings.holds:
            return True
        if memory.state in ASSISTANCE and self._help.count > self._settings.assists:
            return True
        return now_ns - memory.since_ns > limit_s * 1e9

    def _go(self, event: Event, step: Step, told: LoadingInput, answer: Answer | None) -> None:
        """Go where an event leads."""
        memory = self._memory
        before, after = memory.state, TABLE[memory.state, event]
        cause = f"{event.value}: {step.cause}" if step.cause else event.value
        since_ns = memory.since_ns or told.now_ns  # the first state has no beginning
        values: dict[str, Any] = {**dict(step.values), "after_s": (told.now_ns - since_ns) * 1e-9}
        self._notes.append(Note("state", before.value, after.value, cause, values))
        memory.state, memory.since_ns, memory.valid_ns = after, told.now_ns, None
        if before not in RESTING and before not in ASSISTANCE:
            memory.note(f"{before.value}: {cause}")
        if before in (State.CHARGING, State.EXCAVATION):
            memory.seen_ns = told.now_ns  # from now on the pile is another one
        if before in ASSISTANCE:
            self._help.close()
            memory.loaded |= answer is not None and answer.kind == LOADED
            memory.touched |= memory.loaded
            memory.marked = answer.pile if answer is not None else None
        self._enter(event, told)
        if after in ASSISTANCE:
            self._help.ask(after, before, cause, tuple(memory.tried), told)

    def _enter(self, event: Event, told: LoadingInput) -> None:
        """Set what the state of now begins with."""
        memory = self._memory
        if event == Event.MISSION and told.mission is not None:
            memory.begin(told.mission)
            self._help.begin()
            self._trail.forget()
            self._weighing.fills.clear()
        if event in (Event.AGAIN, Event.ENOUGH):
            memory.touched, memory.marked = False, None
        if memory.state == State.CHARGING:
            memory.touched = True
            memory.face_m = self._face_m(told)
        if memory.state == State.WEIGHING:
            memory.loaded = False
        memory.holds += memory.state == State.HELD
        memory.active &= memory.state not in _AT_REST
        if memory.state in MOVING:
            moment = self._moment(told)
            assert moment is not None  # noqa: S101  # no event leads to a moving state while signals are missing
            self._parts[memory.state].begin(moment)

    def _face_m(self, told: LoadingInput) -> float:
        """Return how far behind the toe the scan hits the face now; NaN where it does not."""
        target = self._memory.target
        if target is None or told.walls_m is None or told.motion is None:
            return math.nan
        return face_behind_m(told.walls_m, target.limits_in(told.motion))


_JOINT_RAD = math.radians(2.0)
_AT_REST = RESTING - {State.EMERGENCY}
_VALIDATED = _AT_REST | {State.HELD}


def limits_s(settings: LoadingSettings) -> dict[State, float]:
    """Return the time limits of the states; a state that is not in it rests."""
    return {
        State.IDENTIFICATION: settings.identify_s,
        State.POSITIONING: settings.position_s,
        State.CHARGING: settings.charge_s,
        State.EXCAVATION: settings.dig_s,
        State.PULL_BACK: settings.pull_back_s,
        State.WEIGHING: settings.weigh_s,
        State.HELD: settings.hold_s,
        State.POSITIONING_ASSISTANCE: settings.assist_s,
        State.LOADING_ASSISTANCE: settings.assist_s,
    }
