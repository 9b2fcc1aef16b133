"""What a simulated drive is: typed sections, read from and written to TOML; same scenario, same log to the bit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lhdmap.errors import ConfigError
from lhdmap.settings import figure, read_toml, setting
from lhdmap.settings_tree import part, tree_from, tree_toml
from lhdmap.simulation.pile_sections import MountingSettings, SimulatedPileSettings
from lhdmap.simulation.sections import DriftSettings, DriveSettings
from lhdmap.simulation.sensing.faults import FaultSettings
from lhdmap.simulation.sensing.sections import (
    CloudSettings,
    ImuSettings,
    InclinometerSettings,
    PressureSettings,
    ScannerSettings,
    SensorSettings,
    WheelSettings,
)

ROUGHNESS_M = {"rough": 0.12, "moderate": 0.03, "smooth": 0.005}
NEAREST_M = 4.0  # how near base_link may come to a pile: the bucket is in front of it
_PLANAR_MESH_M = 0.03  # upright walls need few triangles


@dataclass(frozen=True, slots=True)
class DriftScenario:
    """A drive through a drift: everything that the simulator needs to know.

    `planar` makes a 2D world: level scanners, flat floor, walls alike at all heights. `truth` writes the topic
    `/ground_truth/odometry`. `machine` is a machine file, or empty for the default. `pile` and `mounting` make it a
    scenario of the kind 'pile': the drift ends in a pile, and the front scanner hangs as its mounting says. `faults` are
    those of sensors.
    """

    seed: int = setting(0, doc="Seed of all that is random.")
    planar: bool = setting(False, doc="A 2D world: level scanners, a flat floor, walls alike at all heights.")
    truth: bool = setting(True, doc="Whether the topic /ground_truth/odometry is written.")
    machine: str = setting("", doc="Machine file; empty for the default.")
    drift: DriftSettings = part(DriftSettings)
    drive: DriveSettings = part(DriveSettings)
    scanner: ScannerSettings = part(ScannerSettings)
    inclinometer: InclinometerSettings = part(InclinometerSettings)
    imu: ImuSettings = part(ImuSettings)
    wheels: WheelSettings = part(WheelSettings)
    pressures: PressureSettings = part(PressureSettings)
    cloud: CloudSettings = part(CloudSettings)
    faults: tuple[FaultSettings, ...] = part(tuple, key="fault")
    pile: SimulatedPileSettings | None = None
    mounting: MountingSettings | None = None

    @property
    def kind(self) -> str:
        """Kind of the scenario: `drift` or `pile`."""
        return "drift" if self.pile is None else "pile"

    @property
    def sensors(self) -> SensorSettings:
        """Settings of all sensors."""
        return SensorSettings(self.scanner, self.inclinometer, self.imu, self.wheels, self.pressures, self.cloud)

    def __post_init__(self) -> None:
        """Check what the sections cannot; raises ConfigError."""
        if self.seed < 0:
            raise ConfigError(f"seed = {self.seed}: zero or a positive number was wanted")
        if self.pile is None:
            return
        if self.planar:
            raise ConfigError("planar = true: a pile needs a world with heights")
        if self.drive.distance_m > self.pile.toe_m - NEAREST_M:
            raise ConfigError(
                f"drive.distance_m = {figure(self.drive.distance_m)}: the pile begins at {figure(self.pile.toe_m)} m, and the "
                f"machine must stop {NEAREST_M:g} m before it"
            )


SECTIONS: dict[str, type[Any]] = {
    "drift": DriftSettings,
    "drive": DriveSettings,
    "scanner": ScannerSettings,
    "inclinometer": InclinometerSettings,
    "imu": ImuSettings,
    "wheels": WheelSettings,
    "pressures": PressureSettings,
    "cloud": CloudSettings,
}
_OF_A_PILE = ("pile", "mounting")


def load_scenario(path: Path) -> DriftScenario:
    """Read a scenario file; what it leaves out keeps its default.

    Raises:
        InputError: the file cannot be read or is not TOML.
        ConfigError: a key or a value in it is wrong.
    """
    table = read_toml(path, "scenario file")
    try:
        return scenario_from(table)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error


def scenario_from(table: Mapping[str, Any]) -> DriftScenario:
    """Build a scenario from the tables of a TOML file.

    Raises:
        ConfigError: a key or a value is wrong.
    """
    kind = table.get("scenario", "drift")
    if kind not in ("drift", "pile"):
        raise ConfigError(f"scenario = {kind!r}: 'drift' or 'pile' was wanted")
    given = {key: value for key, value in table.items() if key != "scenario"}
    if kind == "drift":
        return tree_from(DriftScenario, given, without=_OF_A_PILE)
    return tree_from(DriftScenario, {key: {} for key in _OF_A_PILE} | given)


def scenario_toml(scenario: DriftScenario) -> str:
    """Print a scenario as a TOML file that `load_scenario` reads back, each value with meaning, unit and source."""
    return f'scenario = "{scenario.kind}"\n{tree_toml(scenario)}'


def flattened(scenario: DriftScenario) -> DriftScenario:
    """Return what a planar scenario means: no grade, a flat floor, upright box walls, no shaking."""
    if not scenario.planar:
        return scenario
    level = tuple((length, radius, 0.0) for length, radius, _ in scenario.drift.pieces)
    mesh_m = min(scenario.drift.mesh_m, _PLANAR_MESH_M)
    drift = replace(scenario.drift, pieces=level, profile="box", mesh_m=mesh_m)
    drift = replace(drift, floor_undulation_m=0.0, floor_roughness_m=0.0)
    return replace(scenario, drift=drift, drive=replace(scenario.drive, vibration_deg=0.0))
