"""Sweeps on their way into the cloud: held until the path reaches beyond them, then integrated in a thread of its own."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lhdmap.config import Settings
from lhdmap.integration.batch import BatchPoses, size_of
from lhdmap.integration.beams import sweep_stamps_ns
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.integrator import Integrator
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, LaserScan, PointCloud
from lhdmap.pipeline.mounts import SensorMounts
from lhdmap.pipeline.track import FinalTrack, Track
from lhdmap.proprioception.wheels import WheelOdometry

ScanSink = Callable[[str, int, FloatArray], None]
_BATCH_POINTS = 40_000  # sweeps are handed over together: switching between threads costs more than a small sweep
_MOST_HELD = 6000  # sweeps of a scanner that wait for poses: two minutes at 50 Hz, after which none will come
_BEYOND_NS = 200_000_000  # after the last pose the motion is carried on for as long
_MOST_PENDING = 24  # batches handed over and not yet done: bounds the memory; realigned poses come many metres at once


class _Sweep(NamedTuple):
    """A sweep on its way, with the times at which its poses are wanted."""

    role: str
    start_ns: int
    end_ns: int
    message: LaserScan | PointCloud


class SweepIntegration:
    """Holds sweeps of all scanners; `advance` integrates those that the track covers, in order."""

    def __init__(
        self,
        settings: Settings,
        machine: Machine | None,
        mounts: SensorMounts,
        on_sweep: ScanSink | None,
        worker: Executor | None = None,
    ) -> None:
        """Args: `worker`: what integrates, in order; a thread of its own by default."""
        bodies = machine if machine is not None else replace(Machine(), bodies={})
        self.integrator = Integrator(settings.integration, (), bodies)
        self._mounts = mounts
        self._on_sweep = on_sweep
        self._held: dict[str, deque[_Sweep]] = {}
        self._batch: list[_Sweep] = []
        self._points = 0
        self._without_pose: Counter[str] = Counter()
        self._without_angle = 0
        self._worker = worker or ThreadPoolExecutor(max_workers=1, thread_name_prefix="integration")
        self._owned = worker is None
        self._pending: deque[Future[None]] = deque()

    def hold(self, role: str, time_ns: int, message: LaserScan | PointCloud) -> None:
        """Keep a sweep until the track has passed it; `time_ns` is its stamp made rising."""
        held = self._held.setdefault(role, deque())
        if len(held) < _MOST_HELD:
            held.append(_sweep(role, time_ns, message))
        else:
            self._without_pose[role] += 1

    def advance(self, track: Track, wheels: WheelOdometry) -> None:
        """Hand over the sweeps that end before the newest pose."""
        last_ns = track.last_ns
        if last_ns is None:
            return
        for held in self._held.values():
            while held and held[0].end_ns <= last_ns:
                self._add(held.popleft(), track, wheels)

    def finish(self, track: Track, wheels: WheelOdometry) -> None:
        """Integrate what is held, its motion carried on for a moment after the last pose, and wait for the worker."""
        last_ns = track.last_ns
        for role, held in self._held.items():
            while held and last_ns is not None and held[0].start_ns <= last_ns + _BEYOND_NS:
                self._add(held.popleft(), track, wheels)
            self._without_pose[role] += len(held)
            held.clear()
        self.wait(track, wheels)

    def add_final(
        self, role: str, time_ns: int, message: LaserScan | PointCloud, track: FinalTrack, wheels: WheelOdometry
    ) -> None:
        """Integrate a sweep soon: the path is known to its end; one without a pose is left out."""
        if not track.covers(time_ns):
            self._without_pose[role] += 1
            return
        self._add(_sweep(role, time_ns, message), track, wheels)

    def wait(self, track: Track | FinalTrack, wheels: WheelOdometry) -> None:
        """Wait until all that was given is in the cloud."""
        self._hand_over(track, wheels)
        while self._pending:
            self._pending.popleft().result()
        self.close()

    def close(self) -> None:
        """Let go of the worker; what it has not begun is given up. Sweeps that come after that are refused."""
        for waiting in self._pending:
            waiting.cancel()
        if self._owned:
            self._worker.shutdown()

    @property
    def warnings(self) -> list[str]:
        """What was left out, in words."""
        refused, grid = self.integrator.totals.refused_sweeps, self.integrator.grid
        told = [
            f"integration: {count} sweeps of {role} at times without a pose of the machine left out"
            for role, count in self._without_pose.items()
            if count
        ]
        if self._without_angle:
            told.append(
                f"integration: {self._without_angle} sweeps of the rear body left out: no angle of the joint is known there"
            )
        if refused:
            told.append(f"integration: {refused} sweeps without a finite pose left out")
        if grid.refused:
            told.append(
                f"integration: {grid.refused} points left out: not finite, or over a million voxels from the map's origin"
            )
        return told

    def cloud(self) -> GridCloud:
        """Return the cloud with normals and curvature; after `finish`."""
        return self.integrator.cloud()

    def forget(self) -> None:
        """Give the memory of the map back, once it is no longer asked for."""
        self.integrator.forget()

    def _add(self, sweep: _Sweep, track: Track | FinalTrack, wheels: WheelOdometry) -> None:
        frame = sweep.message.frame_id
        if not self.integrator.knows(frame):
            self.integrator.add_mount(self._mounts.of(frame, sweep.role))
        self._batch.append(sweep)
        self._points += size_of(sweep.message)
        if self._points >= _BATCH_POINTS:
            self._hand_over(track, wheels)

    def _hand_over(self, track: Track | FinalTrack, wheels: WheelOdometry) -> None:
        """Give the batch to the worker, with the poses at the ends of its sweeps."""
        batch, self._batch, self._points = self._batch, [], 0
        if not batch:
            return
        ends = np.array([(sweep.start_ns, sweep.end_ns) for sweep in batch], dtype=np.int64)
        angles = wheels.articulations_at(ends.ravel()).reshape(-1, 2)
        known = np.isfinite(angles).all(axis=1) | np.array([not self._turns(sweep) for sweep in batch])
        self._without_angle += int(np.count_nonzero(~known))
        batch, ends = [sweep for sweep, placed in zip(batch, known, strict=True) if placed], ends[known]
        if not batch:
            return
        poses = BatchPoses(track.matrices_at(ends.ravel()).reshape(-1, 2, 4, 4), np.nan_to_num(angles[known]))
        self._pending.append(self._worker.submit(self._integrate, batch, poses))
        while len(self._pending) > _MOST_PENDING:
            self._pending.popleft().result()

    def _turns(self, sweep: _Sweep) -> bool:
        """Return whether the scanner is on the rear body: where that is, the joint's angle tells."""
        return self._mounts.of(sweep.message.frame_id, sweep.role).parent_frame == "rear_link"

    def _integrate(self, batch: list[_Sweep], poses: BatchPoses) -> None:
        done = self.integrator.update_all([sweep.message for sweep in batch], poses)
        if self._on_sweep is not None:
            for sweep, integrated in zip(batch, done, strict=True):
                self._on_sweep(sweep.role, sweep.message.stamp_ns, integrated.points_map)


def _sweep(role: str, time_ns: int, message: LaserScan | PointCloud) -> _Sweep:
    start_ns, end_ns = sweep_stamps_ns(message)
    return _Sweep(role, time_ns, time_ns + end_ns - start_ns, message)
