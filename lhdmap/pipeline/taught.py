"""A map folder as another drive is joined to it: path, views, free space, topology, cloud."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lhdmap.errors import unmark_kept
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.cloud_io import read_cloud
from lhdmap.interrupts import before_interrupt
from lhdmap.mapfolder import MapFolder
from lhdmap.messages import FloatArray
from lhdmap.pipeline.topology import each_step
from lhdmap.pipeline.track import TrackRows
from lhdmap.pipeline.update_files import later
from lhdmap.topology.files import read_topology
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.sheet import Sheet, read_sheets
from lhdmap.topology.views import View
from lhdmap.topology.views_file import read_views
from lhdmap.trajectory import Trajectory
from lhdmap.update import fit, merge

_PAUSE_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class TaughtMap:
    """What is read of a map folder; `later_ns`: by how much its times were moved."""

    folder: MapFolder
    trajectory: Trajectory
    views: list[View]
    sheets: list[Sheet]
    topology: TopologicalMap
    cloud: GridCloud
    later_ns: int = 0

    @classmethod
    def read(cls, path: Path) -> TaughtMap:
        """Read a map folder; raises InputError where something is missing that `build-map` writes today."""
        folder = MapFolder.open(path)
        return cls(
            folder,
            folder.trajectory(),
            read_views(folder.file("views.npz")),
            read_sheets(folder.file("free_space.npz")),
            read_topology(path),
            read_cloud(folder.file("cloud.ply")),
        )

    def after(self, other: Trajectory) -> TaughtMap:
        """Return this map with its times moved behind those of another path, where both overlap: each time has one pose."""
        first, last = (int(self.trajectory.stamps_ns[row]) for row in (0, -1))
        if first > int(other.stamps_ns[-1]) or last < int(other.stamps_ns[0]):
            return self
        by_ns = int(other.stamps_ns[-1]) + _PAUSE_NS - first
        stamps = None if self.cloud.stamps_ns is None else self.cloud.stamps_ns + by_ns
        return replace(
            self,
            trajectory=later(self.trajectory, by_ns),
            views=[view._replace(time_ns=view.time_ns + by_ns) for view in self.views],
            cloud=replace(self.cloud, stamps_ns=stamps),
            later_ns=by_ns,
        )

    @property
    def seen(self) -> fit.Seen:
        """Views and their poses."""
        return fit.Seen(self.views, merge.view_poses(self.trajectory, self.views))


def path_of(trajectory: Trajectory) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return a trajectory each quarter metre: poses (M, 4: x, y, z, heading) and times (M,)."""
    rows = TrackRows(trajectory.stamps_ns, merge.poses_of(trajectory))
    chosen = each_step(rows)
    return rows.poses[chosen][:, merge.PLANAR_AND_HEIGHT], rows.times_ns[chosen]


@contextlib.contextmanager
def scratch() -> Iterator[Path]:
    """Give a folder that is gone afterwards, whatever happens; nothing in it counts as kept."""
    with tempfile.TemporaryDirectory(prefix="lhdmap_drive_") as name:
        folder = Path(name)
        try:
            with before_interrupt(lambda: shutil.rmtree(folder, ignore_errors=True)):
                yield folder
        except BaseException as error:
            unmark_kept(error, folder)
            raise
