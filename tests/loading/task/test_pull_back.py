"""How far a machine pulls back from its pile: the set way, less where it came round a bend before it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from lhdmap.driving.motion import Motion
from lhdmap.loading.moment import Moment, Target
from lhdmap.loading.pull_back import PullBack, Trail
from lhdmap.loading.signals import Pedals, Signals, Turn
from lhdmap.loading.task_settings import LoadingSettings

from tests.guidance.tunnels import BODIES, MODEL

LIP_M = float(BODIES.front_box_m[1, 0])
SETTINGS = LoadingSettings()


class NoShake:
    def begin(self, signals: Signals) -> None:
        pass

    def step(self, signals: Signals) -> Turn:
        return Turn(Pedals(), "shaken")


def came(straight_m: float, bend_rad: float) -> Iterator[Motion]:
    """Yield how it came to x = 0 along x: with the joint bent up to `straight_m` before, round a circle."""
    radius = 8.0
    for k in range(80, -1, -1):
        back_m = 0.25 * k
        if back_m <= straight_m:
            yield Motion(0, -back_m, 0.0, 0.0, 0.0, 1.0, 0.0)
        else:
            turn = (back_m - straight_m) / radius
            yield Motion(
                0, -straight_m - radius * math.sin(turn), radius * (1.0 - math.cos(turn)), -turn, bend_rad, 1.0, 0.0
            )


def stop_of(straight_m: float, deep_m: float) -> float:
    """Return how far it is driven back; `deep_m`: of the lip in the pile."""
    trail = Trail()
    for motion in came(straight_m, 0.4):
        trail.add(motion)
    now = trail.motions[-1]._replace(speed_mps=0.0)
    ends = np.array([[LIP_M - deep_m, -2.2], [LIP_M - deep_m, 2.2]])
    target = Target(ends, ends.mean(axis=0), 0.0, 0)
    signals = Signals(0, 0.0, 0.0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    moment = Moment(0, signals, now, np.zeros((0, 2)), None, None, None, target, 0)
    one = PullBack(MODEL, BODIES, SETTINGS, NoShake(), trail)
    one.begin(moment)
    step = one.step(moment)
    assert step.directive is not None
    path = step.directive.path
    begin = float(path[int(np.hypot(path[:, 0] + MODEL.wheelbase_m, path[:, 1]).argmin()), -1])
    return step.directive.stop_m - begin


@pytest.mark.parametrize(
    ("straight_m", "deep_m", "back_m"),
    [
        (15.0, 2.5, SETTINGS.pull_back_m),  # a straight way in: as set
        (6.5, 2.5, 6.5),  # no farther than it came straight
        (3.0, 2.5, 2.5 + SETTINGS.charge_from_m + 0.5),  # but so far that another charge may begin
        (3.0, 9.0, SETTINGS.pull_back_m),  # and never farther than set
    ],
)
def test_it_stops_before_the_bend_that_it_came_by(straight_m: float, deep_m: float, back_m: float) -> None:
    """What was: 8 m back, in the midst of the bend into a draw point, it had no room to turn the other way out of it."""
    assert stop_of(straight_m, deep_m) == pytest.approx(back_m, abs=0.4)
