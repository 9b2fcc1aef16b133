"""A short simulated drive, its log with and without the truth in it, and its map; made once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from lhdmap.pipeline.build import BuildRequest, BuildResult, build_map
from lhdmap.simulation.drive import SimulatedDrive, simulate_drift
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriftSettings, DriveSettings
from lhdmap.simulation.sensing.sections import ScannerSettings

SCENARIO = DriftScenario(
    seed=5,
    drift=DriftSettings(pieces=((14.0, 0.0, -6.0), (8.0, 10.0, 0.0), (12.0, 0.0, 4.0)), mesh_m=0.08),
    drive=DriveSettings(distance_m=15.0, speed_kmh=10.0, standstill_s=0.5),
    scanner=ScannerSettings(beams=381, rate_hz=25.0, sweep=True),
)


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> SimulatedDrive:
    folder = tmp_path_factory.mktemp("drive")
    return simulate_drift(SCENARIO, folder / "with_truth.mcap", mesh_path=folder / "mesh.ply")


@pytest.fixture(scope="session")
def untold(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same log without the truth in it."""
    path = tmp_path_factory.mktemp("untold") / "drive.mcap"
    return simulate_drift(replace(SCENARIO, truth=False), path).log


@pytest.fixture(scope="session")
def built(drive: SimulatedDrive, tmp_path_factory: pytest.TempPathFactory) -> BuildResult:
    return build_map(BuildRequest([drive.log], tmp_path_factory.mktemp("built") / "map"))
