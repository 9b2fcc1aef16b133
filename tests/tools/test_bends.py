"""Which bends can be driven: swept widths against the findings, the rule against the search."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tools.evaluate.bends import RULE_M, bend_of, on_the_map, searched_m, swept_m

from tests.guidance.tunnels import MODEL


def middle_m(bend_deg: float) -> float:
    """Radius of the middle of the band that is swept with the joint at an angle."""
    bend = math.radians(bend_deg)
    axle = (MODEL.front_m * math.cos(bend) + MODEL.rear_m) / math.sin(bend)
    inner, outer = axle - 1.225, math.hypot(axle + 1.225, 3.2)
    return 0.5 * (inner + outer)


@pytest.mark.parametrize(("bend_deg", "width_m"), [(10.0, 2.70), (20.0, 2.91), (30.0, 3.10), (38.0, 3.23)])
def test_the_swept_width_is_that_of_the_findings(bend_deg: float, width_m: float) -> None:
    assert swept_m(middle_m(bend_deg)) == pytest.approx(width_m, abs=0.03)


def test_a_bend_tighter_than_the_machine_has_none() -> None:
    assert swept_m(4.0) == math.inf
    assert not on_the_map(4.0, math.radians(90.0), 8.0)


@pytest.mark.parametrize("seed", [0, 3])
def test_the_rule_is_a_little_more_careful_than_the_search(seed: int) -> None:
    one = bend_of(seed)
    assert 0.0 < one.rule_m - one.search_m < 0.2


def test_a_wide_bend_is_driven_without_a_search_for_it() -> None:
    needed = searched_m(20.0, math.radians(60.0), np.random.default_rng(0))
    assert needed < swept_m(20.0) + RULE_M
    assert on_the_map(20.0, math.radians(60.0), needed + 1.0)
