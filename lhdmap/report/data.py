"""What the report is made from: plain data, filled by the pipeline; what is None is said in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.evaluation.trajectory import TrajectoryEvaluation
from lhdmap.mapfolder import Diagnostics
from lhdmap.messages import Float32Array, FloatArray
from lhdmap.trajectory import Trajectory


class TopicRow(NamedTuple):
    """One topic of the log: number of messages, mean rate, and a remark (what it is used as, gaps)."""

    topic: str
    type_name: str
    messages: int | None
    rate_hz: float | None
    remark: str = ""


class CloudData(NamedTuple):
    """The integrated cloud in map: `points_m` (N, 3), float32; `normals` (N, 3) and `curvature` (N,) where known."""

    points_m: Float32Array
    normals: Float32Array | None = None
    curvature: Float32Array | None = None


class SpeedSeries(NamedTuple):
    """A speed over time: `stamps_ns` (M,) and signed `speed_mps` (M,)."""

    stamps_ns: npt.NDArray[np.int64]
    speed_mps: FloatArray


@dataclass(frozen=True, slots=True)
class Summary:
    """The headline figures; the names are those of `build-map --json`."""

    scans: int
    scans_processed: int
    duration_s: float
    distance_m: float
    wall_s: float | None = None
    realtime_factor: float | None = None
    peak_memory_mib: float | None = None
    degenerate_share: float | None = None
    lost_stretches: int = 0
    closures: int = 0


@dataclass(frozen=True, slots=True)
class ReportData:
    """All that the HTML page shows; each part that is None or empty is said in words."""

    title: str
    summary: Summary
    topics: Sequence[TopicRow]
    trajectory: Trajectory
    odometry: Trajectory | None = None
    evaluation: TrajectoryEvaluation | None = None
    cloud: CloudData | None = None
    diagnostics: Diagnostics | None = None
    odometry_speed: SpeedSeries | None = None
    tachometer_speed: SpeedSeries | None = None
    has_inclinometer: bool = True
    warnings: Sequence[str] = ()
    settings_text: str = ""
    provenance: Mapping[str, str] = field(default_factory=dict)
