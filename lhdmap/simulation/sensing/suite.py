"""All sensors of a machine."""

from __future__ import annotations

import math
from collections.abc import Mapping

from lhdmap.errors import ConfigError
from lhdmap.machine import Machine, SensorMount
from lhdmap.messages import FloatArray
from lhdmap.simulation.scanner import Rig, rig_of
from lhdmap.simulation.sensing.encoders import (
    JointEncoders,
    PressureGauge,
    drive_line_speed,
    lift_bar,
    tilt_bar,
    transmission_bar,
    true_pose,
)
from lhdmap.simulation.sensing.inclinometer import Inclinometer
from lhdmap.simulation.sensing.scans import CloudScanner, Scanner
from lhdmap.simulation.sensing.sections import SensorSettings
from lhdmap.simulation.sensing.sensor import Beat, Sampled, Sensor
from lhdmap.simulation.sensing.told import Mounts, Told, Words

_REAR_PHASE = 0.37  # the rear scanner is not synchronised with the front one: share of a sweep that it is behind
_TACHOMETER_S, _PRESSURE_S = 0.003, 0.007  # nor are these with the scanners
_MODE_HZ, _NODE_HZ = 1.0, 10.0
_GAUGES = {"transmission": transmission_bar, "lift": lift_bar, "tilt": tilt_bar}


def by_hand(stamp_ns: int, state: FloatArray) -> str:
    """Return the mode of a machine that a person drives."""
    return "manual"


def sensors_of(
    machine: Machine,
    settings: SensorSettings,
    *,
    seed: int,
    true_mounts: Mapping[str, SensorMount] | None = None,
    mode: Told = by_hand,
    node: Told | None = None,
    truth: bool = True,
) -> list[Sensor]:
    """Return the sensors of a machine; where readings are due at the same time, those of the first come first.

    `true_mounts` are mounts of scanners that the log does not know: they hang otherwise than it says. `mode` and `node` tell
    the texts of `/operation/mode` (once a second) and `/operation/node` (ten times). `truth`: the pose at the front scans.

    Raises:
        ConfigError: the machine lacks the mount of a sensor.
    """
    mounts = _mounts(machine, settings)
    rigs = _rigs(machine, {**mounts, **(true_mounts or {})}, occlusion=settings.scanner.occlusion)
    front = Scanner("front", settings.scanner, rigs["lidar_front"], seed)
    sensors: list[Sensor] = [Mounts(mounts), Sampled("mode", Beat(_MODE_HZ), Words(mode), seed)]
    sensors += [Sampled("node", Beat(_NODE_HZ), Words(node), seed)] if node is not None else []
    sensors.append(front)
    if settings.scanner.rear:
        sensors.append(Scanner("rear", settings.scanner, rigs["lidar_rear"], seed, phase=_REAR_PHASE))
    if settings.cloud.enabled:
        sensors.append(CloudScanner(settings.cloud, rigs["lidar_points"], seed))
    if settings.inclinometer.enabled:
        mount = mounts.get("inclinometer", SensorMount())
        sensors.append(Inclinometer(settings.inclinometer, settings.imu, mount, seed))
    sensors += _encoders(settings, seed)
    if truth:
        beat = Beat(settings.scanner.rate_hz)
        sensors.append(Sampled("ground_truth", beat, true_pose, seed, delay_ns=front.sweep_ns))
    return sensors


def _mounts(machine: Machine, settings: SensorSettings) -> dict[str, SensorMount]:
    """Return the mounts of the sensors that there are, in the machine's order."""
    at = {"lidar_points": SensorMount("base_link", settings.cloud.position_m), **machine.mounts}
    wanted = {"lidar_front": True, "lidar_rear": settings.scanner.rear, "lidar_points": settings.cloud.enabled}
    for name, used in wanted.items():
        if used and name not in at:
            raise ConfigError(f"machine '{machine.name}' has no [mount.{name}]: the simulator needs one")
    wanted["inclinometer"] = settings.inclinometer.enabled
    return {name: mount for name, mount in at.items() if wanted.get(name, False)}


def _rigs(machine: Machine, mounts: Mapping[str, SensorMount], *, occlusion: bool) -> dict[str, Rig]:
    return {name: rig_of(machine, mount, occlusion=occlusion) for name, mount in mounts.items()}


def _encoders(settings: SensorSettings, seed: int) -> list[Sensor]:
    """Return what is measured in the machine."""
    wheels, pressures = settings.wheels, settings.pressures
    if not wheels.enabled:
        return []
    joints = JointEncoders(math.radians(wheels.articulation_noise_deg))
    speed = drive_line_speed(wheels, seed)
    sensors: list[Sensor] = [Sampled("joints", Beat(wheels.rate_hz), joints, seed)]
    sensors.append(Sampled("tachometer", Beat(wheels.rate_hz, _TACHOMETER_S), speed, seed))
    if pressures.enabled:
        for name, bar_of in _GAUGES.items():
            beat = Beat(pressures.rate_hz, _PRESSURE_S)
            sensors.append(Sampled(f"{name}_pressure", beat, PressureGauge(bar_of, pressures), seed))
    return sensors
