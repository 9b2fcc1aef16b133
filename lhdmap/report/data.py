"""What the report is made from: plain data, filled by the pipeline; what is None is said in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.evaluation.trajectory import TrajectoryEvaluation
from lhdmap.integration.cloud import GridCloud
from lhdmap.landmarks.model import Landmarks
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.mapfolder import Diagnostics
from lhdmap.messages import FloatArray
from lhdmap.pile.result import PileReport
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.sheet import Sheet
from lhdmap.trajectory import Trajectory

STANDS_MPS = 0.2
"""What is slower, machine and wheels, is taken to stand."""


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


class SlipSeries(NamedTuple):
    """Slip over time: `stamps_ns` (M,) and `share` (M,), NaN where nothing moves or it is not known."""

    stamps_ns: npt.NDArray[np.int64]
    share: FloatArray


class ClosureRow(NamedTuple):
    """A place that was taken for one seen before: `from_m` and `to_m` (3,) are where base_link was in `map`, first and later.

    `accepted`: whether the map was closed there; `residual_m`: between what was measured there and the final map, NaN where
    nothing was; `information`: what the match says in its weakest direction, 1/m²; `reason`: why it was refused.
    """

    from_m: FloatArray
    to_m: FloatArray
    accepted: bool
    residual_m: float
    information: float
    reason: str = ""


class Picture(NamedTuple):
    """A picture that is drawn already: a data URI (`charts.svg_uri`) and its caption."""

    uri: str
    caption: str


class Difference(NamedTuple):
    """What is different from the version before: the values of `difference.json`, and a picture of each level."""

    table: Mapping[str, Any]
    pictures: Sequence[Picture] = ()


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
    compile_s: float | None = None
    expected_error: Mapping[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class ReportData:
    """All that the HTML page shows; each part that is None or empty is said in words.

    `witness`: which sensors told of the motion beside the scans (empty: none); `poses`: where given poses came from (empty: the
    path is that of the odometry); `pile_reason`: why no pile was looked for. `sheets`: free space of the levels of `topology`;
    `closures`: places recognised, also those refused; `landmarks` of its nodes; `difference`: from the map's version before;
    `drives`: how many were joined to it.
    """

    title: str
    summary: Summary
    topics: Sequence[TopicRow]
    trajectory: Trajectory
    odometry: Trajectory | None = None
    evaluation: TrajectoryEvaluation | None = None
    cloud: GridCloud | None = None
    diagnostics: Diagnostics | None = None
    odometry_speed: SpeedSeries | None = None
    tachometer_speed: SpeedSeries | None = None
    articulation: AngleSeries | None = None
    has_inclinometer: bool = True
    pile: PileReport | None = None
    pile_reason: str = ""
    topology: TopologicalMap | None = None
    sheets: Sequence[Sheet] = ()
    closures: Sequence[ClosureRow] = ()
    landmarks: Landmarks | None = None
    landmark_settings: LandmarkSettings = field(default_factory=LandmarkSettings)
    difference: Difference | None = None
    witness: str = ""
    poses: str = ""
    warnings: Sequence[str] = ()
    settings_text: str = ""
    provenance: Mapping[str, str] = field(default_factory=dict)
    drives: int = 1

    def slip(self) -> SlipSeries | None:
        """Return the slip where wheels or machine move: at a stand it is noise over nothing. None: it is not known at all."""
        if self.diagnostics is None:
            return None
        stamps_ns = np.asarray(self.diagnostics.stamp_ns)
        fastest = np.zeros(len(stamps_ns))
        for speed in (self.odometry_speed, self.tachometer_speed):
            if speed is not None and len(speed.stamps_ns):
                fastest = np.maximum(fastest, np.abs(np.interp(stamps_ns, speed.stamps_ns, speed.speed_mps)))
        share = np.where(fastest >= STANDS_MPS, np.asarray(self.diagnostics.slip, dtype=float), np.nan)
        return SlipSeries(stamps_ns, share) if np.isfinite(share).any() else None
