"""Small simulated worlds, made once."""

from __future__ import annotations

from dataclasses import replace

import pytest
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriftSettings, DriveSettings
from lhdmap.simulation.world import DriftWorld

COARSE = DriftSettings(pieces=((18.0, 0.0, -10.0), (10.0, 9.0, 0.0), (10.0, -12.0, 6.0)), mesh_m=0.1)
SHORT = DriveSettings(distance_m=25.0, speed_kmh=12.0, standstill_s=0.4)


@pytest.fixture(scope="session")
def scenario() -> DriftScenario:
    """A short drive in a coarse, rough drift with bends to both sides and grades."""
    return DriftScenario(seed=4, drift=COARSE, drive=SHORT)


@pytest.fixture(scope="session")
def world(scenario: DriftScenario) -> DriftWorld:
    return DriftWorld(scenario)


@pytest.fixture(scope="session")
def plain_world(scenario: DriftScenario) -> DriftWorld:
    """A level, straight, smooth planar drift: ranges in it are known in closed form."""
    drift = replace(COARSE, pieces=((100.0, 0.0, 0.0),), roughness_m=0.0)
    drive = replace(SHORT, wander_m=0.0)
    return DriftWorld(replace(scenario, planar=True, drift=drift, drive=drive))
