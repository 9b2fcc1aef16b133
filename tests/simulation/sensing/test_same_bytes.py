"""A known motion read in one go, and the same motion row by row, give the same messages to the byte; with faults as well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lhdmap.logs.ros_messages import serialized
from lhdmap.messages import Record
from lhdmap.simulation.drive import drift_sensors, records
from lhdmap.simulation.history import Column, History
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriftSettings, DriveSettings
from lhdmap.simulation.sensing.faults import SENSOR_KINDS, FaultSettings, with_faults
from lhdmap.simulation.sensing.sections import (
    CloudSettings,
    ImuSettings,
    InclinometerSettings,
    ScannerSettings,
    WheelSettings,
)
from lhdmap.simulation.sensing.sensor import Due, Sensor, read_all
from lhdmap.simulation.sensing.suite import sensors_of
from lhdmap.simulation.world import DriftWorld

SCENARIO = DriftScenario(
    seed=7,
    drift=DriftSettings(pieces=((12.0, 0.0, -8.0), (6.0, 9.0, 0.0), (9.0, -12.0, 6.0)), mesh_m=0.15),
    drive=DriveSettings(distance_m=14.0, speed_kmh=14.0, standstill_s=0.3),
    scanner=ScannerSettings(beams=91, sweep=True, dust_share=0.03, mixed_pixel_share=0.5, drop_out_share=0.01),
    imu=ImuSettings(gyro=True, accelerometer=True),
    wheels=WheelSettings(slip=True, slip_every_s=3.0),
    cloud=CloudSettings(enabled=True, rings=4, columns=60),
)
# Sweeps that end on a row (half a turn at 25 Hz takes 20 ms), sweeps without a length, a lag that is a delay, odd rates.
VARIANTS = {
    "all": SCENARIO,
    "half a turn": replace(SCENARIO, scanner=replace(SCENARIO.scanner, field_of_view_deg=180.0)),
    "at once": replace(SCENARIO, scanner=ScannerSettings(beams=91, rate_hz=30.0)),
    "delay": replace(SCENARIO, inclinometer=InclinometerSettings(lag_kind="delay", lag_s=0.137, rate_hz=33.0)),
}
TARGETS = ("/lidar/front/scan", "/inclinometer", "/machine/joints", "/lidar/points")


@pytest.fixture(scope="module")
def worlds() -> dict[str, DriftWorld]:
    return {name: DriftWorld(scenario) for name, scenario in VARIANTS.items()}


def at_rate(rows: np.ndarray, rate_hz: float) -> np.ndarray:
    return np.ascontiguousarray(rows[:: round(1000.0 / rate_hz)])


def stepped(sensors: list[Sensor], rows: np.ndarray, rate_hz: float, world: DriftWorld) -> list[Record]:
    """Return what sensors say while the history grows; it forgets all but the last 0.5 s."""
    due, growing, said = Due(sensors), History(rate_hz, keep_s=0.5), []
    for row in rows:
        growing.append(row)
        said += list(due.read(growing, world))
    return said


def as_bytes(said: list[Record]) -> list[tuple[str, int, bytes]]:
    return [(record.topic, record.log_time_ns, serialized(record.message)[1]) for record in said]


def sensors(world: DriftWorld, faults: tuple[FaultSettings, ...] = ()) -> list[Sensor]:
    made = sensors_of(
        world.machine, world.scenario.sensors, seed=3, node=lambda _, state: f"{state[Column.X]:.1f}", truth=True
    )
    return with_faults(made, faults, seed=3)


@pytest.mark.parametrize("rate_hz", [100.0, 1000.0])
@pytest.mark.parametrize("variant", VARIANTS)
def test_a_stepped_run_gives_the_bytes_of_a_batch(worlds: dict[str, DriftWorld], variant: str, rate_hz: float) -> None:
    world = worlds[variant]
    rows = at_rate(world.history.rows, rate_hz)
    batch = as_bytes(list(read_all(sensors(world), History(rate_hz, rows), world)))
    assert as_bytes(stepped(sensors(world), rows, rate_hz, world)) == batch
    assert {topic for topic, _, _ in batch} >= {
        *TARGETS,
        "/lidar/rear/scan",
        "/operation/node",
        "/machine/pressure/lift",
    }


def test_so_do_faulty_sensors(worlds: dict[str, DriftWorld]) -> None:
    faults = tuple(
        FaultSettings(at_s=0.5 + 0.7 * k, kind=kind, target=target, duration_s=0.6, size=0.3)
        for target in TARGETS
        for k, kind in enumerate(SENSOR_KINDS)
    )
    world = worlds["all"]
    rows = at_rate(world.history.rows, 100.0)
    batch = as_bytes(list(read_all(sensors(world, faults), History(100.0, rows), world)))
    assert as_bytes(stepped(sensors(world, faults), rows, 100.0, world)) == batch
    assert batch != as_bytes(list(read_all(sensors(world), History(100.0, rows), world)))


def test_a_drive_is_the_batch_of_its_sensors(worlds: dict[str, DriftWorld]) -> None:
    world = worlds["all"]
    again = stepped(drift_sensors(world), world.history.rows, 1000.0, world)
    assert as_bytes(list(records(world))) == as_bytes(again)


def test_a_sensor_less_leaves_the_others_as_they_are(worlds: dict[str, DriftWorld]) -> None:
    world = worlds["all"]
    fewer = [one for one in sensors(world) if one.name not in ("rear", "points", "joints")]
    kept = as_bytes(list(read_all(fewer, world.history, world)))
    gone = ("/lidar/rear/scan", "/lidar/points", "/machine/joints")
    assert kept == [one for one in as_bytes(list(read_all(sensors(world), world.history, world))) if one[0] not in gone]
