"""What the loading task is told at a moment, what it says, and the form that its parts share."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from lhdmap.driving.motion import Motion
from lhdmap.executor.notes import Note
from lhdmap.geometry import se2
from lhdmap.guidance.directive import Directive
from lhdmap.loading.assistance import Answer, Request
from lhdmap.loading.signals import Pedals, Signals
from lhdmap.loading.states import Event, State
from lhdmap.messages import FloatArray
from lhdmap.pile.result import PileEstimate, Snapshot

OPERATED = ("teleoperated", "manual", "assisted")
AUTONOMOUS = "autonomous"


class Mission(NamedTuple):
    """What is wanted: one full bucket. `number`: another one is another mission; `draw_point_m` (2,) in `odom`, where known."""

    number: int
    draw_point_m: tuple[float, float] | None = None


class LoadingInput(NamedTuple):
    """All that the task is told; a new one each 20 to 100 ms.

    Attributes:
        now_ns: time of now.
        signals: of the machine; None where there are none.
        motion: pose in `odom`, joint, speed; None where it is not known.
        pile: last estimate of perception in `odom`, its status decided; None where there is none.
        walls_m: scan points around the machine (N, 2) in `base_link`; None where there are none.
        mode: as in `/operation/mode`.
        armed: whether the executor is armed.
        answer: what the operator answers.
        emergency: an emergency stop is asked for.
        mission: what is wanted; None: nothing.
        approach: what navigation drives until the pile is identified; None: it stands.
        pose_good: whether localization and executor trust the pose.
        evidence: names of what an operator may look at, such as ("cloud", "run.mcap@12.3").
    """

    now_ns: int
    signals: Signals | None = None
    motion: Motion | None = None
    pile: Snapshot | None = None
    walls_m: FloatArray | None = None
    mode: str = AUTONOMOUS
    armed: bool = True
    answer: Answer | None = None
    emergency: bool = False
    mission: Mission | None = None
    approach: Directive | None = None
    pose_good: bool = True
    evidence: tuple[tuple[str, str], ...] = ()


class LoadingOutput(NamedTuple):
    """What the task says: state, and a directive for guidance, or pedals, or neither (it stands, on the brake).

    `request`: the open request; `notes`: for the journal; `fill`: of the last weighing (NaN: none yet); `target`: the pile, whose
    hits are no obstacle (`lhdmap.loading.identification.at_pile`): the bucket is in them when it is pulled back.
    """

    state: State
    phase: str = ""
    directive: Directive | None = None
    pedals: Pedals | None = None
    request: Request | None = None
    notes: tuple[Note, ...] = ()
    attempts: int = 0
    fill: float = float("nan")
    assists: int = 0
    assist_s: float = 0.0
    target: Target | None = None


class Target(NamedTuple):
    """The pile as the task knows it, in `odom`: limits (2, 2) E_R, E_L; centre (2,); heading into it (rad); when it was seen."""

    limits_m: FloatArray
    center_m: FloatArray
    heading_rad: float
    stamp_ns: int

    def limits_in(self, motion: Motion) -> FloatArray:
        """Return the limits (2, 2) in `base_link`."""
        pose = np.array([motion.x_m, motion.y_m, motion.heading_rad])
        found: FloatArray = se2.transform(se2.inverse(pose), self.limits_m)
        return found


class Moment(NamedTuple):
    """An input whose signals and motion are there, with what the task remembers."""

    now_ns: int
    signals: Signals
    motion: Motion
    walls_m: FloatArray
    pile: Snapshot | None
    approach: Directive | None
    draw_point_m: tuple[float, float] | None
    target: Target | None
    touched_ns: int
    marked: PileEstimate | None = None
    face_m: float = float("nan")


class Step(NamedTuple):
    """What a part of the task says at a moment: the event by which it ends (None: it goes on), and what is driven until then."""

    phase: str
    event: Event | None = None
    cause: str = ""
    directive: Directive | None = None
    pedals: Pedals | None = None
    target: Target | None = None
    values: tuple[tuple[str, float], ...] = ()


class Part(Protocol):
    """A state that moves the machine."""

    phase: str

    def begin(self, moment: Moment) -> None:
        """Begin; what was before is forgotten."""
        ...

    def step(self, moment: Moment) -> Step:
        """Return what is to be done now."""
        ...


def pose_of(motion: Motion) -> FloatArray:
    """Return the pose (3,) of `base_link` in `odom`."""
    return np.array([motion.x_m, motion.y_m, motion.heading_rad])
