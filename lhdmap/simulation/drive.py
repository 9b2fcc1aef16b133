"""`simulate_drift`: a scenario in, a log with its truth out. One drive on one screen: world, motion, sensors, files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lhdmap.errors import UsageError
from lhdmap.geometry import se3
from lhdmap.messages import Record
from lhdmap.outputs import OutputFiles
from lhdmap.simulation.history import Column
from lhdmap.simulation.pile_facts import PileTruth
from lhdmap.simulation.pile_files import write_pile_truth
from lhdmap.simulation.pile_truth import pile_truth
from lhdmap.simulation.scanner import beams_of, sweep_ns
from lhdmap.simulation.scenario import DriftScenario, scenario_toml
from lhdmap.simulation.sensing.faults import with_faults
from lhdmap.simulation.sensing.sensor import Beat, Sensor, read_all
from lhdmap.simulation.sensing.suite import sensors_of
from lhdmap.simulation.world import DriftWorld
from lhdmap.trajectory import Trajectory, write_tum

Progress = Callable[[Iterator[Record], float], Iterator[Record]]


@dataclass(frozen=True, slots=True)
class SimulatedDrive:
    """What `simulate_drift` wrote: files, truth at each front scan's stamp, and what was driven."""

    log: Path
    truth_file: Path
    scenario_file: Path
    mesh_file: Path | None
    truth: Trajectory
    scans: int
    messages: int
    duration_s: float
    distance_m: float
    pile_file: Path | None = None
    pile: PileTruth | None = None


def simulate_drift(
    scenario: DriftScenario,
    path: Path,
    *,
    mesh_path: Path | None = None,
    progress: Progress | None = None,
    force: bool = False,
) -> SimulatedDrive:
    """Simulate the drive of `scenario` into the log `path`, with `.truth.tum` and `.scenario.toml` beside it.

    A drive to a pile has `.pile.json` as well: the truth about it.

    `mesh_path` takes the drift's mesh (PLY, in `map`). `progress(records, duration_s)` wraps the records on their
    way into the log. The files get their names together, when all are complete; with `force` over those of an earlier run.

    Raises:
        UsageError: a file to be written exists already (without `force`), or the log's name does not end in .mcap.
        InputError: the scenario's machine file cannot be read.
    """
    if path.suffix != ".mcap":
        raise UsageError(f"{path}: logs are written as MCAP, so a name that ends in .mcap was wanted")
    truth_file, scenario_file = path.with_suffix(".truth.tum"), path.with_suffix(".scenario.toml")
    pile_file = path.with_suffix(".pile.json") if scenario.pile is not None else None
    with OutputFiles(truth_file, scenario_file, mesh_path, pile_file, path, force=force) as files:
        world = DriftWorld(scenario)
        files.at(scenario_file).write_text(scenario_toml(scenario), encoding="utf-8")
        truth = truth_of(world)
        write_tum(files.at(truth_file), truth)
        if mesh_path is not None:
            world.write_mesh(files.at(mesh_path))
        pile = pile_truth(world) if world.pile is not None else None
        if pile is not None and pile_file is not None:
            write_pile_truth(files.at(pile_file), pile, truth)
        messages = _write_log(world, files.at(path), progress)
    scans = len(truth.stamps_ns)
    return SimulatedDrive(
        path,
        truth_file,
        scenario_file,
        mesh_path,
        truth,
        scans,
        messages,
        world.history.last_s,
        world.distance_m,
        pile_file,
        pile,
    )


def _write_log(world: DriftWorld, path: Path, progress: Progress | None) -> int:
    """Write the log of a drive; return how many messages are in it."""
    from lhdmap.logs.writer import LogWriter

    stream, messages = records(world), 0
    with LogWriter(path) as writer:
        for record in progress(stream, world.history.last_s) if progress else stream:
            writer.write(record.topic, record.message, record.log_time_ns)
            messages += 1
    return messages


def records(world: DriftWorld) -> Iterator[Record]:
    """Yield all messages of the drive in the order of their log time."""
    return read_all(drift_sensors(world), world.history, world)


def drift_sensors(world: DriftWorld) -> list[Sensor]:
    """Return the sensors of the machine in the drift, with the scenario's faults."""
    scenario, seed = world.scenario, world.sensor_seed
    sensors = sensors_of(
        world.machine, scenario.sensors, seed=seed, true_mounts=world.true_mounts, truth=scenario.truth
    )
    return with_faults(sensors, scenario.faults, seed=seed)


def truth_of(world: DriftWorld) -> Trajectory:
    """Return the exact poses of `base_link` in `map` at the stamps of the front scans."""
    stamps = _front_stamps(world)
    rows = np.array([world.history.state(stamp) for stamp in stamps]).reshape(len(stamps), -1)
    quaternions = se3.quaternions_from_rpy(rows[:, Column.ROLL], rows[:, Column.PITCH], rows[:, Column.YAW])
    return Trajectory(np.array(stamps, dtype=np.int64), rows[:, :3].copy(), quaternions)


def _front_stamps(world: DriftWorld) -> list[int]:
    """Return the stamps of the front scans that are complete when the drive ends."""
    settings = world.scenario.scanner
    beat, last_ns, stamps = Beat(settings.rate_hz), world.history.last_ns - sweep_ns(beams_of(settings).times_s), []
    while beat.stamp_ns <= last_ns:
        stamps.append(beat.stamp_ns)
        beat.advance()
    return stamps
