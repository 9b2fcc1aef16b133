"""How nodes of the path were moved, packed: there is one each 0.2 m, hundred thousands in a shift."""

from __future__ import annotations

from array import array
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

_PLANAR = 3


class Moves:
    """A list of (time, `pose_map_odom` (3,)) in the order of time."""

    def __init__(self) -> None:
        self._times, self._moves = array("q"), array("d")

    def __len__(self) -> int:
        return len(self._times)

    def __iter__(self) -> Iterator[tuple[int, FloatArray]]:
        times_ns, pose_map_odom = self.since(0)
        return zip(times_ns.tolist(), pose_map_odom, strict=True)

    @property
    def last_ns(self) -> int:
        """Time of the last node."""
        return self._times[-1]

    def append(self, time_ns: int, pose_map_odom: FloatArray) -> None:
        """Add a node."""
        self._times.append(time_ns)
        self._moves.extend(pose_map_odom.tolist())

    def since(self, first: int) -> tuple[npt.NDArray[np.int64], FloatArray]:
        """Return times (N,) and moves (N, 3) from number `first` on, copied."""
        times_ns = np.array(self._times[first:], dtype=np.int64)
        return times_ns, np.array(self._moves[_PLANAR * first :], dtype=float).reshape(-1, _PLANAR)
