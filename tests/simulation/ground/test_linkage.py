"""Boom and bucket in the plane: one convention for controllers, bodies and the side view."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.simulation.ground.linkage import floor_angle, lip, lip_rates
from lhdmap.simulation.ground.rig import bucket_for, rig_of
from lhdmap.simulation.vehicle.bodies import bucket_outline

from tests.simulation.ground.digs import MACHINE

RIG = rig_of(MACHINE)[0]


@pytest.mark.parametrize("boom", [0.0, 0.2, 0.5, 1.2])
@pytest.mark.parametrize("bucket", [0.0, -0.3, -0.83, -2.0])
def test_the_lip_is_where_the_bodies_have_it(boom: float, bucket: float) -> None:
    assert lip(RIG, boom, bucket) == pytest.approx(bucket_outline(MACHINE.linkage, boom, bucket)[1], abs=1e-12)


def test_the_papers_stops() -> None:
    linkage = MACHINE.linkage
    assert (linkage.boom_min_rad, linkage.bucket_max_rad) == (0.0, 0.0)  # α = 0: fully racked, β = 0: down
    assert floor_angle(RIG, 0.0, 0.0) == pytest.approx(0.8)
    level = bucket_for(MACHINE, 0.0)
    assert level == pytest.approx(-0.8, abs=0.01)
    assert floor_angle(RIG, 0.0, level) == pytest.approx(0.0, abs=0.01)
    assert bucket_for(MACHINE, -0.022) == pytest.approx(-0.814, abs=0.01)  # pressed
    pin = bucket_outline(linkage, 0.5, 0.0)[0] - bucket_outline(linkage, 0.0, 0.0)[0]
    assert pin[1] == pytest.approx(1.06, abs=0.01)  # β_max lifts the pin by 1.06 m


@pytest.mark.parametrize("height", [-0.05, 0.0, 0.15, 0.6])
def test_the_bucket_for_a_height_of_the_lip(height: float) -> None:
    assert lip(RIG, 0.0, bucket_for(MACHINE, height))[1] == pytest.approx(height, abs=1e-12)


def test_it_dumps_at_the_upper_stops() -> None:
    assert floor_angle(RIG, MACHINE.linkage.boom_max_rad, MACHINE.linkage.bucket_min_rad) < math.radians(-40.0)


def test_rates_are_derivatives() -> None:
    rng = np.random.default_rng(1)
    for boom, bucket, boom_rps, bucket_rps in rng.uniform(
        (0.0, -1.5, -0.2, -0.3), (1.0, 0.0, 0.2, 0.3), (30, 4)
    ).tolist():
        step = 1e-6
        ahead = np.array(lip(RIG, boom + step * boom_rps, bucket + step * bucket_rps))
        behind = np.array(lip(RIG, boom - step * boom_rps, bucket - step * bucket_rps))
        assert lip_rates(RIG, boom, bucket, boom_rps, bucket_rps) == pytest.approx(
            (ahead - behind) / (2 * step), abs=1e-7
        )
