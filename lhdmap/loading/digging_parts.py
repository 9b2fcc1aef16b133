"""Charging, excavation and weighing as parts of the task: each steps a controller that is injected, and judges how it ended."""

from __future__ import annotations

import math
from collections.abc import Sequence
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


class Rule(Protocol):
    """Whether another attempt pays (`lhdmap.loading.attempts`)."""

    def __call__(self, fills: Sequence[float]) -> tuple[bool, str]:
        """Return whether to go on after attempts with these fills, the last one of now, and why."""
        ...


class Driven:
    """A part that is one controller; where it ends, `event`, or failure where it says so."""

    def __init__(self, controller: Controller, event: Event, lip_m: FloatArray) -> None:
        self._controller, self._event, self._lip_m = controller, event, lip_m
        self.phase = ""

    def begin(self, moment: Moment) -> None:
        """Begin the controller."""
        self._controller.begin(told_toe(moment, self._lip_m))

    def step(self, moment: Moment) -> Step:
        """Step the controller."""
        turn = self._controller.step(told_toe(moment, self._lip_m))
        event = None if not turn.ended else Event.FAILED if value_of(turn, FAILED) > 0.0 else self._event
        return Step("", event, turn.ended, pedals=turn.pedals, values=turn.values)


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
        again, why = self._rule(tuple(self.fills))
        return Step("", Event.AGAIN if again else Event.ENOUGH, why, pedals=pedals, values=turn.values)


def value_of(turn: Turn, name: str, default: float = 0.0) -> float:
    """Return a value of a turn by its name."""
    return next((value for one, value in turn.values if one == name), default)


def told_toe(moment: Moment, lip_m: FloatArray) -> Signals:
    """Return the signals with the way of the lip to the pile's toe, where the machine itself does not say it.

    `lip_m` (2,) in `base_link`; the way is along the machine's axis to the line through the limits.
    """
    signals = moment.signals
    if moment.target is None or math.isfinite(signals.toe_m):
        return signals
    return signals._replace(toe_m=_toe_m(moment.target, moment, lip_m))


def _toe_m(target: Target, moment: Moment, lip_m: FloatArray) -> float:
    right, left = target.limits_in(moment.motion)
    E = left - right
    if abs(E[1]) < 1e-6:
        return math.nan
    share = float(np.clip((lip_m[1] - right[1]) / E[1], 0.0, 1.0))
    return float(right[0] + share * E[0] - lip_m[0])
