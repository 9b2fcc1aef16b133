"""A short simulated drive to be sent, and the map of it; made once."""

from __future__ import annotations

from pathlib import Path

import pytest
from lhdmap.config import Settings, settings_from
from lhdmap.pipeline.build import BuildRequest, build_map
from lhdmap.simulation.drive import simulate_drift
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriftSettings, DriveSettings
from lhdmap.simulation.sensing.sections import ScannerSettings

SETTINGS: Settings = settings_from({"recording.scan_interval_s": 5.0})
LIGHT: Settings = settings_from({"recording.scan_interval_s": 5.0, "pile.method": "off", "topology.method": "off"})
DISTANCE_M = 6.0
SCENARIO = DriftScenario(
    seed=5,
    truth=False,
    drift=DriftSettings(pieces=((14.0, 0.0, -6.0), (8.0, 10.0, 0.0), (12.0, 0.0, 4.0)), mesh_m=0.08),
    drive=DriveSettings(distance_m=DISTANCE_M, speed_kmh=10.0, standstill_s=0.3),
    scanner=ScannerSettings(beams=181, rate_hz=20.0, sweep=True),
)


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulate_drift(SCENARIO, tmp_path_factory.mktemp("sent") / "drive.mcap").log


@pytest.fixture(scope="session")
def mapped(drive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_map(BuildRequest([drive], tmp_path_factory.mktemp("mapped") / "map", SETTINGS)).folder
