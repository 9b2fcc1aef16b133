"""The integration stage: sweeps with known poses in, one voxelised cloud out (paper, Section 3.2 and Fig. 9)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.integration.batch import BatchMaker, BatchPoses, BatchRoom, Scans, alike, project_scans, size_of
from lhdmap.integration.beams import sweep_stamps_ns, table_of
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.normals import estimate_normals
from lhdmap.integration.project import BeamCounts, Limits, SweepPoses, project_cloud
from lhdmap.integration.self_filter import Rig, rig_of
from lhdmap.integration.voxel_grid import VoxelGrid
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, LaserScan, Mount, PointCloud
from lhdmap.settings import setting


@dataclass(frozen=True, slots=True)
class IntegrationSettings:
    """Integration of scans into the cloud: which returns are taken, the voxel grid, and normals."""

    voxel_size_m: tuple[float, float, float] = setting(
        (0.2, 0.2, 0.1), unit="m", source="paper, Fig. 9", minimum=0.01, maximum=10.0, doc="Size of a voxel in x, y, z."
    )
    range_min_m: float = setting(0.3, unit="m", minimum=0.0, doc="Returns nearer than this are left out.")
    range_max_m: float = setting(
        50.0, unit="m", minimum=0.5, doc="Returns farther than this are left out: 0.05 deg of tilt is 4 cm there."
    )
    body_margin_m: float = setting(
        0.1, unit="m", minimum=0.0, maximum=2.0, doc="The boxes of both bodies are grown by this for the self-filter."
    )
    stray_m: float = setting(
        0.1, unit="m", source="measured: docs/integration.md", minimum=0.0,
        doc="A return that is nearer than all of the four beams around it by more than this is dust; inf keeps all.",
    )  # fmt: skip
    stray_share: float = setting(
        0.02, unit="m/m", source="measured: docs/integration.md", minimum=0.0,
        doc="The same, for each metre of its range; both add up.",
    )  # fmt: skip
    min_hits: int = setting(
        2,
        unit="hits",
        minimum=1,
        doc="Voxels with fewer hits stay only if their neighbours have hits: dust, mixed pixels.",
    )
    min_neighbour_hits: int = setting(
        3, unit="hits", minimum=0, doc="Hits that the 26 neighbours of such a voxel must hold together; 0: keep all."
    )
    normal_radius_m: float = setting(
        0.75, unit="m", source="paper, Fig. 9", minimum=0.02, maximum=20.0, doc="Radius for normals and curvature."
    )
    normal_min_neighbours: int = setting(
        5, unit="points", minimum=3, doc="Points with fewer neighbours in that radius get no normal (zero)."
    )


class Integrated(NamedTuple):
    """One sweep in `map`: points, shape (N, 3), metres (a view that the next update overwrites), and its counts."""

    points_map: FloatArray
    counts: BeamCounts


@dataclass(slots=True)
class IntegrationTotals:
    """What became of all beams so far."""

    sweeps: int = 0
    kept: int = 0
    no_return: int = 0
    self_hits: int = 0
    strays: int = 0
    refused_sweeps: int = 0


class Integrator:
    """Puts sweeps into the map. The work is done without the interpreter's lock: it may run beside the odometry."""

    def __init__(self, settings: IntegrationSettings, mounts: Iterable[Mount], machine: Machine) -> None:
        self.settings = settings
        self.grid = VoxelGrid(settings.voxel_size_m)
        self.totals = IntegrationTotals()
        self._machine = machine
        self._rigs: dict[str, Rig] = {}
        self._maker = BatchMaker()
        for mount in mounts:
            self.add_mount(mount)

    def add_mount(self, mount: Mount) -> None:
        """Tell where a sensor sits; raises InputError where that is on neither body or no rigid motion."""
        self._rigs[mount.child_frame] = rig_of(mount, self._machine, self.settings.body_margin_m)

    def knows(self, frame_id: str) -> bool:
        """Return whether the mount of this sensor frame is known."""
        return frame_id in self._rigs

    def update(self, message: LaserScan | PointCloud, poses: SweepPoses) -> Integrated:
        """Add one sweep; `poses` are those of the machine at `sweep_stamps_ns(message)`.

        A sweep whose poses are not finite is refused and counted in `totals.refused_sweeps`.

        Raises:
            InputError: the sensor's frame has no mount.
        """
        return self.update_all([message], BatchPoses.of([poses]))[0]

    def update_all(self, messages: Sequence[LaserScan | PointCloud], poses: BatchPoses) -> list[Integrated]:
        """Add many sweeps, in this order, as `update` does one; most of the work is one call for each scanner."""
        room, finite = self._maker.room(messages), poses.finite()
        for group in alike(messages, np.flatnonzero(finite).tolist()):
            self._project(messages, np.array(group), poses, room)
        rows = room.starts, np.ascontiguousarray(room.counts[:, 0])
        self.grid.add_sweeps(room.points_map, room.stamps_ns, rows, room.viewpoints_map)
        self._count(int(np.count_nonzero(finite)), len(messages), BeamCounts(*room.counts.sum(axis=0).tolist()))
        found = zip(room.starts.tolist(), room.counts.tolist(), strict=True)
        return [Integrated(room.points_map[start : start + count[0]], BeamCounts(*count)) for start, count in found]

    def cloud(self) -> GridCloud:
        """Return the map so far with normals and curvature, stray voxels left out."""
        chosen = self.settings
        cloud = self.grid.cloud(chosen.min_hits, chosen.min_neighbour_hits)
        found = estimate_normals(
            cloud.points_m, chosen.normal_radius_m, cloud.viewpoints_m, min_neighbours=chosen.normal_min_neighbours
        )
        return cloud.with_normals(found.normals, found.curvature)

    def forget(self) -> None:
        """Begin with an empty map: the memory of this one is given back."""
        self.grid = VoxelGrid(self.settings.voxel_size_m)

    def _rig(self, frame_id: str) -> Rig:
        try:
            return self._rigs[frame_id]
        except KeyError:
            known = ", ".join(sorted(self._rigs)) or "none"
            raise InputError(
                f"frame '{frame_id}': the sensor has no mount (known: {known}); "
                "a transform on /tf_static or a mount in the dataset or machine file was wanted"
            ) from None

    def _project(
        self,
        messages: Sequence[LaserScan | PointCloud],
        places: npt.NDArray[np.int64],
        poses: BatchPoses,
        room: BatchRoom,
    ) -> None:
        """Project a group (`batch.alike`) into the map."""
        group = [messages[place] for place in places]
        message, rig, limits = group[0], self._rig(group[0].frame_id), self._limits(group[0])
        spans = [sweep_stamps_ns(one) for one in group]
        if isinstance(message, LaserScan):
            ranges = np.array([one.ranges_m for one in group if isinstance(one, LaserScan)], dtype=np.float32)
            scans = Scans(places, ranges, np.array(spans, dtype=np.int64))
            project_scans(scans, table_of(message), limits, poses, rig, room)
            return
        place = int(places[0])
        cloud, offsets = _readonly(message.points_m), _readonly(message.time_offsets_s)
        out = room.of_sweep(place, size_of(message))
        room.counts[place] = project_cloud(cloud, offsets, limits, spans[0], poses.at(place), rig, out)

    def _limits(self, message: LaserScan | PointCloud) -> Limits:
        s = self.settings
        if not isinstance(message, LaserScan):
            return Limits(s.range_min_m, s.range_max_m)
        low_m, high_m = max(s.range_min_m, float(message.range_min_m)), min(s.range_max_m, float(message.range_max_m))
        return Limits(low_m, high_m, s.stray_m, s.stray_share)

    def _count(self, taken: int, given: int, counts: BeamCounts) -> None:
        totals = self.totals
        totals.sweeps += taken
        totals.refused_sweeps += given - taken
        totals.kept += counts.kept
        totals.no_return += counts.no_return
        totals.self_hits += counts.self_hits
        totals.strays += counts.strays


def _readonly(array: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return a read-only float32 view (or copy), so that each kernel is compiled for one kind of array only."""
    view = np.ascontiguousarray(array, dtype=np.float32).view()
    view.flags.writeable = False
    return view
