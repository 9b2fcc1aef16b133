"""Teaching drives that topologies are measured on: of the plans that ship and of small ones with what is hard, kept in files.

A drive is simulated once: the pipeline's odometry and loop closure run on it, and what the topology needs of it is kept: views,
its own final poses, the true ones, and the truth of the plan. Making the topology again then takes a second.
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from lhdmap.config import Settings, settings_from
from lhdmap.geometry import se3
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.messages import GroundTruth, LaserScan, Message, PointCloud
from lhdmap.mine.make_network import make_network
from lhdmap.mine.plan import MinePlan, find_plan, load_plan
from lhdmap.mine.topology import topology_json
from lhdmap.pipeline.driven import ways_of
from lhdmap.pipeline.inputs import ROLES_READ
from lhdmap.pipeline.mapping import MappingPipeline, feed
from lhdmap.pipeline.topology import seen_of
from lhdmap.pipeline.track import TrackRows
from lhdmap.roles import ROLES
from lhdmap.simulation.mine_drive import MineDrive, MineDriveSettings
from lhdmap.simulation.sensing.sections import ScannerSettings, SensorSettings
from lhdmap.topology.build import Seen

PLANS = Path(__file__).resolve().parents[2] / "tests" / "topology" / "plans"
SHIPPED = ("ring", "level", "decline", "narrow")
OWN = ("pillars", "bays", "bends", "slim", "parked", "crossing", "oblique")
ROUGHNESS_M = (0.12, 0.15, 0.15, 0.2, 0.3)
"""Roughness of the walls in the worlds 1 to 5; `narrow`, whose clearance is what it is about, keeps its own."""
RATE_HZ = 12.5
_SETTINGS = {"pile.method": "off"}


@dataclass(frozen=True)
class TopologyDrive:
    """What is kept of a drive: `own` and `true` are what it saw along its own final poses and along the true ones."""

    name: str
    roughness_m: float
    seed: int
    own: Seen
    true: Seen
    closures: int
    truth: Mapping[str, Any]


class _Pipeline(MappingPipeline):
    """The pipeline without the cloud, which no topology is made of."""

    def _hold(self, role: str, time_ns: int, sweep: LaserScan | PointCloud) -> None:
        pass


def drive_of(name: str, seed: int, folder: Path) -> TopologyDrive:
    """Return a drive, simulated where the folder does not have it; `seed` 1 to 5."""
    file = folder / f"{name}.{seed}.pickle"
    if not file.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(".partial")
        partial.write_bytes(pickle.dumps(_simulated(name, seed)))
        partial.replace(file)
    found = pickle.loads(file.read_bytes())  # noqa: S301  # our own file
    assert isinstance(found, TopologyDrive)
    return found


def log_views(log: Path, folder: Path) -> Seen:
    """Return what a real log saw along its own final poses, kept as `drive_of` keeps."""
    file = folder / f"{log.name}.pickle"
    if not file.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        pipeline = _Pipeline(settings_from(_SETTINGS))
        with LogSource([log], {}) as source:
            feed(pipeline, source.messages([role for role in ROLES_READ if role in source.roles]))
        file.write_bytes(pickle.dumps(seen_of(pipeline, ways_of(pipeline, None).rows)))
    found = pickle.loads(file.read_bytes())  # noqa: S301
    assert isinstance(found, Seen)
    return found


def plan_of(name: str, seed: int) -> MinePlan:
    """Return a plan with the walls of one world."""
    plan = load_plan(PLANS / f"{name}.toml" if name in OWN else find_plan(name))
    walls = plan.walls if name == "narrow" else replace(plan.walls, roughness_m=ROUGHNESS_M[seed - 1])
    return replace(plan, seed=plan.seed + 100 * seed, walls=walls)


def _simulated(name: str, seed: int) -> TopologyDrive:
    plan, machine = plan_of(name, seed), Machine()
    network = make_network(plan)
    sensors = SensorSettings(scanner=ScannerSettings(rate_hz=RATE_HZ, max_range_m=60.0))
    drive = MineDrive(network, machine, MineDriveSettings(seed=seed, names=True, sensors=sensors))
    pipeline, roles = _pipeline(machine), {role.topic: key for key, role in ROLES.items()}
    truth: list[GroundTruth] = []
    with pipeline:
        for record in drive.records():
            role = roles.get(record.topic, "")
            if isinstance(record.message, GroundTruth):
                truth.append(record.message)
            elif role in ROLES_READ:
                pipeline.update(role, _message(record.message))
        pipeline.finish()
        ways = ways_of(pipeline, None)
    own, true = seen_of(pipeline, ways.rows), seen_of(pipeline, _rows(truth))
    return TopologyDrive(name, plan.walls.roughness_m, seed, own, true, ways.closures, topology_json(network, machine))


def _pipeline(machine: Machine) -> _Pipeline:
    settings: Settings = settings_from(_SETTINGS)
    return _Pipeline(settings, machine)


def _message(message: Any) -> Message:
    found: Message = message
    return found


def _rows(truth: list[GroundTruth]) -> TrackRows:
    rpy = se3.rpy_from_quaternions(np.array([one.quaternion_xyzw for one in truth]))
    rpy[:, 2] = np.unwrap(rpy[:, 2])
    positions = np.array([one.position_m for one in truth])
    return TrackRows(np.array([one.stamp_ns for one in truth], dtype=np.int64), np.column_stack([positions, rpy]))
