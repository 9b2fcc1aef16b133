"""Guidance's process: no faster down a ramp than the executor's brake allows."""

from __future__ import annotations

import numpy as np
import pytest
from lhdmap.executor.limits import speed_bound
from lhdmap.guidance.directive import SPEED, Directive, path_of
from lhdmap.guidance.planner import Guidance, method_of
from lhdmap.guidance.settings import GuidanceSettings
from lhdmap.replay.processes.guide import within_brakes

from tests.guidance.planar_drive import EYES_M
from tests.guidance.tunnels import BODIES, MODEL

SETTINGS = GuidanceSettings()
GUIDANCE = Guidance(MODEL, BODIES, EYES_M, SETTINGS, method_of(SETTINGS))
STEEP_MPS2 = 9.81 * 0.14


def asked(gear: int, speed_mps: float) -> Directive:
    line = np.column_stack([np.arange(0.0, 60.0, 0.5), np.zeros(120)])
    path = path_of(line, speed_mps)
    return Directive(0, gear, path, float(path[-1, -1]))


@pytest.mark.parametrize(("gear", "pull_mps2"), [(1, 0.0), (1, -STEEP_MPS2), (-1, STEEP_MPS2), (-1, 0.3)])
def test_level_and_uphill_it_is_as_fast_as_asked(gear: int, pull_mps2: float) -> None:
    directive = asked(gear, 3.3)
    assert within_brakes(directive, GUIDANCE, pull_mps2) is directive


@pytest.mark.parametrize("gear", [1, -1])
def test_downhill_a_full_brake_ends_within_the_plan(gear: int) -> None:
    """What was: planned at 12 km/h, a loaded machine braked fully each three seconds down a ramp of 1 in 8."""
    directive = asked(gear, 3.3)
    slow = within_brakes(directive, GUIDANCE, gear * STEEP_MPS2)
    most = float(slow.path[:, SPEED].max())
    assert 0.5 < most < 0.85 * speed_bound(MODEL, SETTINGS.stages * SETTINGS.stage_s, 0.0, STEEP_MPS2)
    assert directive.path[:, SPEED].max() == 3.3  # the one that was asked for stays as it is
    crept = asked(gear, 0.4)
    assert within_brakes(crept, GUIDANCE, gear * STEEP_MPS2) is crept
