"""Charging, excavation and weighing as parts of the task: each steps a controller that is injected, and judges how it ended."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np

from lhdmap.loading.moment import Moment, Step, Target
from lhdmap.loading.signals import Controller, Signals, Turn
from lhdmap.loading.states import Event
from lhdmap.messages import FloatArray

FAILED, FILL, FILL_STD = "failed", "fill", "fill_std"
"""Names in `Turn.values`: not 0 where a controller gives up; what weighing found, as share of a full bucket."""


class Controllers(NamedTuple):
    """What digs: begun and stepped by the task through one protocol."""

    charge: Controller
    dig: Controller
    shake: Controller
    weigh: Controller


class Decision(Protocol):
    """What a rule says: whether to go on, why, and the figures of that."""

    @property
    def go_on(self) -> bool:
        """Whether there is to be another attempt."""
        ...

    @property
    def text(self) -> str:
        """Why, in a sentence."""
        ...

    @property
    def values(self) -> tuple[tuple[str, float], ...]:
        """The figures of that sentence."""
        ...


class Rule(Protocol):
    """Whether another attempt pays."""

    def decide(self, fill: float, fill_std: float, attempt: int) -> Decision:
        """Return what to do after the `attempt`-th attempt (1 is the first) with a fill as weighed."""
        ...


class Driven:
    """A part that is one controller; where it ends, `event`, or failure where it says so."""

    phase = ""

    def __init__(self, controller: Controller, event: Event, lip_m: FloatArray, toe_std_m: float) -> None:
        self._controller, self._event, self._lip_m, self._toe_std_m = controller, event, lip_m, toe_std_m

    def begin(self, moment: Moment) -> None:
        """Begin the controller."""
        self._controller.begin(self._told(moment))

    def step(self, moment: Moment) -> Step:
        """Step the controller."""
        turn = self._controller.step(self._told(moment))
        event = None if not turn.ended else Event.FAILED if value_of(turn, FAILED) > 0.0 else self._event
        return Step("", event, turn.ended, pedals=turn.pedals, values=turn.values)

    def _told(self, moment: Moment) -> Signals:
        """Return the signals with the way of the lip to the toe along the machine's axis, where they do not say it."""
        signals = moment.signals
        if moment.target is None or math.isfinite(signals.toe_m):
            return signals
        return signals._replace(toe_m=toe_m(moment.target, moment, self._lip_m), toe_std_m=self._toe_std_m)


class Weighing:
    """Weighs, and asks the rule; a weight that is no number is a failure."""

    phase = ""

    def __init__(self, controller: Controller, rule: Rule) -> None:
        self._controller, self._rule = controller, rule
        self.fills: list[float] = []

    def begin(self, moment: Moment) -> None:
        """Begin to weigh."""
        self._controller.begin(moment.signals)

    def step(self, moment: Moment) -> Step:
        """Return what is to be done now; at the end whether there is another attempt."""
        turn = self._controller.step(moment.signals)
        pedals = turn.pedals._replace(propel=0.0, brake=True)
        if not turn.ended:
            return Step("", pedals=pedals)
        fill = value_of(turn, FILL, math.nan)
        if value_of(turn, FAILED) > 0.0 or not math.isfinite(fill):
            return Step("", Event.FAILED, turn.ended, pedals=pedals, values=turn.values)
        self.fills.append(fill)
        said = self._rule.decide(fill, value_of(turn, FILL_STD, math.nan), len(self.fills))
        values = tuple(dict([*turn.values, *said.values]).items())
        return Step("", Event.AGAIN if said.go_on else Event.ENOUGH, said.text, pedals=pedals, values=values)


def value_of(turn: Turn, name: str, default: float = 0.0) -> float:
    """Return a value of a turn by its name."""
    return next((value for one, value in turn.values if one == name), default)


def toe_m(target: Target, moment: Moment, lip_m: FloatArray) -> float:
    """Return the way (m) of the lip (2,), in `base_link`, straight ahead to the line through the limits; NaN: there is none."""
    right, left = target.limits_in(moment.motion)
    E = left - right
    if abs(E[1]) < 1e-6:
        return math.nan
    share = float(np.clip((lip_m[1] - right[1]) / E[1], 0.0, 1.0))
    return float(right[0] + share * E[0] - lip_m[0])
