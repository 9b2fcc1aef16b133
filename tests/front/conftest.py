"""A short simulated drive, and its map by the front door; made once."""

from __future__ import annotations

import shutil
from pathlib import Path

import lhdmap
import pytest
from lhdmap.simulation.drive import SimulatedDrive, simulate_drift
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriftSettings, DriveSettings

SCENARIO = DriftScenario(
    seed=11,
    drift=DriftSettings(pieces=((14.0, 0.0, -6.0), (8.0, 10.0, 0.0), (12.0, 0.0, 4.0)), mesh_m=0.08),
    drive=DriveSettings(distance_m=15.0, speed_kmh=10.0, standstill_s=0.5),
)


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> SimulatedDrive:
    folder = tmp_path_factory.mktemp("drive")
    return simulate_drift(SCENARIO, folder / "drive.mcap", mesh_path=folder / "mesh.ply")


@pytest.fixture(scope="session")
def built(drive: SimulatedDrive, tmp_path_factory: pytest.TempPathFactory) -> lhdmap.Map:
    return lhdmap.build_map(str(drive.log), out=str(tmp_path_factory.mktemp("built") / "map"))


@pytest.fixture
def beside_the_log(drive: SimulatedDrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder with `drive.mcap` in it, as the working folder."""
    shutil.copy(drive.log, tmp_path / "drive.mcap")
    monkeypatch.chdir(tmp_path)
    return tmp_path
