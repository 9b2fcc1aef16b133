"""Sweeps on their way into the cloud: held until the path reaches beyond them, then integrated in a thread of its own."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace

from lhdmap.config import Settings
from lhdmap.integration.beams import sweep_stamps_ns
from lhdmap.integration.cloud import Cloud
from lhdmap.integration.integrator import Integrator
from lhdmap.integration.project import SweepPoses
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, LaserScan, PointCloud
from lhdmap.pipeline.mounts import Mounts
from lhdmap.pipeline.track import FinalTrack, Track
from lhdmap.proprioception.wheels import WheelOdometry

ScanSink = Callable[[str, int, FloatArray], None]
_MOST_PENDING = 64  # sweeps handed over and not yet done: bounds the memory


class SweepIntegration:
    """Holds sweeps of all scanners; `advance` integrates those that the track covers, in order."""

    def __init__(self, settings: Settings, machine: Machine | None, mounts: Mounts, on_sweep: ScanSink | None) -> None:
        bodies = machine if machine is not None else replace(Machine(), bodies={})
        self.integrator = Integrator(settings.integration, (), bodies)
        self._mounts = mounts
        self._on_sweep = on_sweep
        self._held: dict[str, deque[tuple[int, LaserScan | PointCloud]]] = {}
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="integration")
        self._pending: deque[Future[None]] = deque()

    def hold(self, role: str, time_ns: int, sweep: LaserScan | PointCloud) -> None:
        """Keep a sweep until the track has passed it; `time_ns` is its stamp made rising."""
        self._held.setdefault(role, deque()).append((time_ns, sweep))

    def advance(self, track: Track, wheels: WheelOdometry) -> None:
        """Hand over the sweeps that end before the newest pose."""
        last_ns = track.last_ns
        if last_ns is None:
            return
        for role, held in self._held.items():
            while held and held[0][0] + _length_ns(held[0][1]) <= last_ns:
                self._hand_over(role, *held.popleft(), track, wheels)

    def finish(self, track: Track, wheels: WheelOdometry) -> None:
        """Integrate all that is held, its motion carried on after the last pose, and wait for the worker."""
        for role, held in self._held.items():
            while held and len(track):
                self._hand_over(role, *held.popleft(), track, wheels)
        self.wait()

    def add_final(
        self, role: str, time_ns: int, sweep: LaserScan | PointCloud, track: FinalTrack, wheels: WheelOdometry
    ) -> None:
        """Integrate a sweep at once: the path is known to its end."""
        self._hand_over(role, time_ns, sweep, track, wheels)

    def wait(self) -> None:
        """Wait until all that was handed over is in the cloud."""
        while self._pending:
            self._pending.popleft().result()
        self._worker.shutdown()

    def cloud(self) -> Cloud:
        """Return the cloud with normals and curvature; after `finish`."""
        return self.integrator.cloud()

    def _hand_over(
        self, role: str, time_ns: int, sweep: LaserScan | PointCloud, track: Track | FinalTrack, wheels: WheelOdometry
    ) -> None:
        if not self.integrator.knows(sweep.frame_id):
            self.integrator.add_mount(self._mounts.of(sweep.frame_id, role))
        length_ns = _length_ns(sweep)
        T_start, angle = track.matrix_at(time_ns), wheels.articulation_at(time_ns) or 0.0
        poses = SweepPoses(T_start, T_start, angle, angle)
        if length_ns != 0:
            end_ns = time_ns + length_ns
            poses = SweepPoses(T_start, track.matrix_at(end_ns), angle, wheels.articulation_at(end_ns) or 0.0)
        self._pending.append(self._worker.submit(self._integrate, role, sweep, poses))
        while len(self._pending) > _MOST_PENDING:
            self._pending.popleft().result()

    def _integrate(self, role: str, sweep: LaserScan | PointCloud, poses: SweepPoses) -> None:
        done = self.integrator.update(sweep, poses)
        if self._on_sweep is not None:
            self._on_sweep(role, sweep.stamp_ns, done.points_map)


def _length_ns(sweep: LaserScan | PointCloud) -> int:
    start_ns, end_ns = sweep_stamps_ns(sweep)
    return end_ns - start_ns
