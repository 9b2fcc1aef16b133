"""What the pipeline keeps of each scan for tables and curves: a few numbers, never the scan."""

from __future__ import annotations

import math
import sys

import numpy as np
import numpy.typing as npt

from lhdmap.mapfolder import Diagnostics
from lhdmap.messages import FloatArray
from lhdmap.report.data import AngleSeries, SpeedSeries


class ScanRecords:
    """One row a scan of the front scanner (stamp, time) and one row a processed scan (diagnostics)."""

    def __init__(self) -> None:
        self.stamps_ns: list[int] = []
        self.times_ns: list[int] = []
        self._rows: list[tuple[float, ...]] = []
        self._processed_ns: list[int] = []
        self._substitutes: list[str] = []
        self._wheels: list[str] = []
        self._lost: list[bool] = []
        self._curves: list[tuple[int, float, float, float]] = []

    def add_scan(self, stamp_ns: int, time_ns: int) -> None:
        """Count a scan; `time_ns` is its stamp made rising."""
        self.stamps_ns.append(stamp_ns)
        self.times_ns.append(time_ns)

    def add_processed(
        self,
        stamp_ns: int,
        match: tuple[float, float],
        information: FloatArray,
        substitute: str,
        flags: tuple[bool, bool],
        wheels: tuple[str, float],
    ) -> None:
        """Add a processed scan: match (residual m, support), information (3,), flags (degenerate, lost), wheels (use, slip)."""
        self._processed_ns.append(stamp_ns)
        self._rows.append((*match, *(float(v) for v in information), float(flags[0]), wheels[1]))
        self._substitutes.append(sys.intern(substitute))
        self._wheels.append(sys.intern(str(wheels[0])))
        self._lost.append(flags[1])

    def add_motion(
        self, time_ns: int, speed_mps: float, wheel_mps: float | None, articulation_rad: float | None
    ) -> None:
        """Add speed, wheel speed and articulation of a processed scan."""
        nan = math.nan
        self._curves.append(
            (
                time_ns,
                speed_mps,
                nan if wheel_mps is None else wheel_mps,
                nan if articulation_rad is None else articulation_rad,
            )
        )

    @property
    def processed(self) -> int:
        """Number of processed scans."""
        return len(self._rows)

    @property
    def lost_stretches(self) -> int:
        """Number of runs of scans that could not be placed."""
        lost = np.array([False, *self._lost])
        return int(np.count_nonzero(lost[1:] & ~lost[:-1]))

    @property
    def all_lost(self) -> bool:
        """Whether none of the scans after the first could be placed."""
        return len(self._lost) > 1 and all(self._lost[1:])

    @property
    def degenerate_share(self) -> float:
        """Share of processed scans with an unobserved direction."""
        return float(np.mean([row[5] for row in self._rows])) if self._rows else 0.0

    def diagnostics(self) -> Diagnostics:
        """Return the table of the map folder."""
        table = np.array(self._rows, dtype=float).reshape(-1, 7)
        stamps = np.array(self._processed_ns, dtype=np.int64)
        return Diagnostics(
            stamps,
            table[:, 0],
            table[:, 1],
            table[:, 2],
            table[:, 3],
            table[:, 4],
            table[:, 5] > 0.5,
            self._substitutes,
            table[:, 6],
            self._wheels,
        )

    def speed(self) -> SpeedSeries | None:
        """Return the odometry's speed."""
        return self._speed(1)

    def tachometer(self) -> SpeedSeries | None:
        """Return the wheels' speed, or None where the log has none."""
        return self._speed(2)

    def articulation(self) -> AngleSeries | None:
        """Return the articulation angle, or None where the log has none."""
        times, values = self._series(3)
        return AngleSeries(times, values) if len(times) else None

    def _speed(self, column: int) -> SpeedSeries | None:
        times, values = self._series(column)
        return SpeedSeries(times, values) if len(times) else None

    def _series(self, column: int) -> tuple[npt.NDArray[np.int64], FloatArray]:
        times = np.array([row[0] for row in self._curves], dtype=np.int64)
        values = np.array([row[column] for row in self._curves], dtype=float)
        known = np.isfinite(values)
        return times[known], values[known]
