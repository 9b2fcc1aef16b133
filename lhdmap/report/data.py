"""What the report is made from: plain data, filled by the pipeline; what is None is said in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.evaluation.trajectory import TrajectoryEvaluation
from lhdmap.integration.cloud import Cloud
from lhdmap.mapfolder import Diagnostics
from lhdmap.messages import FloatArray
from lhdmap.pile.result import PileReport
from lhdmap.trajectory import Trajectory


class TopicRow(NamedTuple):
    """One topic of the log: number of messages, mean rate, and a remark (what it is used as, gaps)."""

    topic: str
    type_name: str
    messages: int | None
    rate_hz: float | None
    remark: str = ""


class SpeedSeries(NamedTuple):
    """A speed over time: `stamps_ns` (M,) and signed `speed_mps` (M,)."""

    stamps_ns: npt.NDArray[np.int64]
    speed_mps: FloatArray


class AngleSeries(NamedTuple):
    """A joint angle over time: `stamps_ns` (M,) and `angle_rad` (M,)."""

    stamps_ns: npt.NDArray[np.int64]
    angle_rad: FloatArray


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
    cloud: Cloud | None = None
    diagnostics: Diagnostics | None = None
    odometry_speed: SpeedSeries | None = None
    tachometer_speed: SpeedSeries | None = None
    articulation: AngleSeries | None = None
    has_inclinometer: bool = True
    pile: PileReport | None = None
    warnings: Sequence[str] = ()
    settings_text: str = ""
    provenance: Mapping[str, str] = field(default_factory=dict)
