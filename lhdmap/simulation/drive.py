"""`simulate_drift`: a scenario in, a log with its truth out. One drive on one screen: world, motion, sensors, files."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.errors import UsageError
from lhdmap.geometry import se3
from lhdmap.messages import Float32Array, FloatArray, GroundTruth, LaserScan, Mount, Record
from lhdmap.outputs import OutputFiles
from lhdmap.roles import recorded
from lhdmap.simulation import sensors
from lhdmap.simulation.pile_facts import PileTruth
from lhdmap.simulation.pile_files import write_pile_truth
from lhdmap.simulation.pile_truth import pile_truth
from lhdmap.simulation.scanner import Beams, Rig, measured, obstructed, rays_of
from lhdmap.simulation.scenario import DriftScenario, scenario_toml
from lhdmap.simulation.world import DriftWorld
from lhdmap.trajectory import Trajectory, write_tum

BATCH_SCANS = 25
_REAR_PHASE = 0.37  # the rear scanner is not synchronised with the front one: share of a sweep that it is behind
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


class ScannerStream(NamedTuple):
    """One scanner of the simulated machine: topic, frame, beams, rig, stamps and its own sources of chance."""

    role: str
    frame_id: str
    beams: Beams
    rig: Rig
    stamps_ns: npt.NDArray[np.int64]
    seed: tuple[int, int]


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
        truth = truth_at(world, front_stamps(world))
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
        world.motion.duration_s,
        world.motion.distance_m,
        pile_file,
        pile,
    )


def _write_log(world: DriftWorld, path: Path, progress: Progress | None) -> int:
    """Write the log of a drive; return how many messages are in it."""
    from lhdmap.logs.writer import LogWriter

    stream, messages = records(world), 0
    with LogWriter(path) as writer:
        for record in progress(stream, world.motion.duration_s) if progress else stream:
            writer.write(record.topic, record.message, record.log_time_ns)
            messages += 1
    return messages


def records(world: DriftWorld) -> Iterator[Record]:
    """Yield all messages of the drive in the order of their log time."""
    scenario, motion, clock = world.scenario, world.motion, world.clock
    streams = [mounts(world), sensors.mode_messages(motion, clock), scans(world, scanner_stream(world, "front"))]
    if scenario.scanner.rear:
        streams.append(scans(world, scanner_stream(world, "rear")))
    if scenario.inclinometer.enabled:
        streams.append(sensors.inclinations(scenario.inclinometer, motion, clock, world.rng("inclinometer")))
    if scenario.wheels.enabled:
        streams.append(sensors.joint_readings(scenario.wheels, motion, clock, world.rng("joints")))
        streams.append(sensors.tachometer_readings(scenario.wheels, motion, clock, world.rng("tachometer")))
        streams.append(sensors.pressure_readings(motion, clock, world.rng("pressure")))
    if scenario.truth:
        streams.append(truth_messages(truth_at(world, front_stamps(world))))
    return heapq.merge(*streams, key=lambda record: record.log_time_ns)


def mounts(world: DriftWorld) -> Iterator[Record]:
    """Yield the static transforms of the sensors that the log has."""
    used = {"lidar_front", *(("lidar_rear",) if world.scenario.scanner.rear else ())}
    used |= {"inclinometer"} if world.scenario.inclinometer.enabled else set()
    stamp = world.clock.start_ns
    for name, mount in world.machine.mounts.items():
        if name in used:
            yield recorded("tf_static", stamp, Mount(stamp, mount.parent, name, mount.T_parent_sensor))


def front_stamps(world: DriftWorld) -> npt.NDArray[np.int64]:
    """Return the stamps of the front scans, shape (N,), ns."""
    return world.clock.stamps_ns(world.motion.duration_s, world.scenario.scanner.rate_hz)


def scanner_stream(world: DriftWorld, side: str) -> ScannerStream:
    """Return the stream of the scanner on `side`, `front` or `rear`."""
    settings, rear = world.scenario.scanner, side == "rear"
    offset_s = _REAR_PHASE / settings.rate_hz if rear else 0.0
    stamps_ns = world.clock.stamps_ns(world.motion.duration_s, settings.rate_hz, offset_s)
    name = f"lidar_{side}"
    return ScannerStream(side, name, world.beams, world.rig(name), stamps_ns, (world.scenario.seed, 100 + rear))


def scans(world: DriftWorld, stream: ScannerStream) -> Iterator[Record]:
    """Yield the scans of one scanner, cast in batches."""
    settings = world.scenario.scanner
    duration_ns = round(stream.beams.times_s[-1] * 1e9)
    for first in range(0, len(stream.stamps_ns), BATCH_SCANS):
        stamps_ns = stream.stamps_ns[first : first + BATCH_SCANS]
        rng = np.random.default_rng([*stream.seed, first])
        exact = obstructed(exact_ranges(world, stream, stamps_ns), world.clock.seconds(stamps_ns), settings)
        ranges = measured(exact, settings, world.dust(stamps_ns), rng)
        for stamp, row in zip(stamps_ns.tolist(), ranges, strict=True):
            yield recorded(
                stream.role, stamp + duration_ns, _scan(stream, settings.min_range_m, settings.max_range_m, stamp, row)
            )


def exact_ranges(world: DriftWorld, stream: ScannerStream, stamps_ns: npt.NDArray[np.int64]) -> Float32Array:
    """Return exact ranges, shape (S, N), metres, inf for none, of the scans at `stamps_ns`."""
    time_s = world.clock.seconds(stamps_ns)
    surface = world.surface.near(world.place_m(float(np.mean(time_s))))
    rays, blocked = rays_of(world.motion.table, time_s, stream.beams, stream.rig, surface.origin_m)
    return np.minimum(surface.cast(rays), blocked).reshape(len(stamps_ns), -1)


def _scan(stream: ScannerStream, low_m: float, high_m: float, stamp_ns: int, ranges_m: Float32Array) -> LaserScan:
    beams = stream.beams
    return LaserScan(
        stamp_ns,
        stream.frame_id,
        float(beams.angles_rad[0]),
        beams.increment_rad,
        beams.time_increment_s,
        low_m,
        high_m,
        ranges_m,
    )


def truth_at(world: DriftWorld, stamps_ns: npt.NDArray[np.int64]) -> Trajectory:
    """Return the exact poses of `base_link` in `map` at `stamps_ns`."""
    rows: FloatArray = world.motion.at(world.clock.seconds(stamps_ns))
    return Trajectory(stamps_ns, rows[:, :3], se3.quaternions_from_rpy(rows[:, 3], rows[:, 4], rows[:, 5]))


def truth_messages(truth: Trajectory) -> Iterator[Record]:
    """Yield the truth as messages."""
    for stamp, position, quaternion in zip(
        truth.stamps_ns.tolist(), truth.positions_m, truth.quaternions_xyzw, strict=True
    ):
        yield recorded("ground_truth", stamp, GroundTruth(stamp, position, quaternion))
