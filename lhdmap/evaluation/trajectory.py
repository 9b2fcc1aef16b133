"""Evaluation of a trajectory against the truth: one call, one result; knows nothing of files or plots."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from lhdmap.errors import UsageError
from lhdmap.evaluation import metrics
from lhdmap.evaluation.alignment import ALIGNMENTS, Alignment, align, aligned
from lhdmap.evaluation.association import IndexArray, associate
from lhdmap.evaluation.ordering import in_order_of_drive
from lhdmap.evaluation.poses import Poses, distances_along, flattened
from lhdmap.evaluation.two_clocks import clock_offset_ns, shifted
from lhdmap.messages import FloatArray
from lhdmap.settings import setting
from lhdmap.trajectory import Trajectory

HOLE_FACTOR = 3.0
SMALLEST_HOLE_NS = 500_000_000


@dataclass(frozen=True, slots=True)
class TrajectoryEvaluationSettings:
    """How a trajectory is compared with the truth."""

    alignment: str = setting("origin", choices=ALIGNMENTS, doc="How the estimate is brought into the truth's frame.")
    tolerance_s: float = setting(0.02, unit="s", minimum=0.0, doc="Largest distance between the stamps of a pair.")
    segments_m: tuple[float, ...] = setting(
        (5.0, 10.0, 20.0, 50.0, 100.0), unit="m", minimum=0.0, source="KITTI, shortened", doc="Lengths of the segments."
    )
    rpe_delta: float = setting(1.0, minimum=0.0, doc="Distance between the poses of a relative error.")
    rpe_unit: str = setting("m", choices=("m", "frames"), doc="Unit of that distance.")
    planar: bool = setting(False, doc="Compare x, y and heading only.")


class Profile(NamedTuple):
    """Arrays for plots: aligned paths and errors (along, across, height) over the true distance; N pairs."""

    distance_m: FloatArray
    truth_m: FloatArray
    estimate_m: FloatArray
    errors_m: FloatArray


@dataclass(frozen=True, slots=True)
class TrajectoryEvaluation:
    """What `evaluate_trajectory` found; `reach` is a share, `end_pct` per cent of the distance, `heading_drift_deg` over 100 m."""

    alignment: str
    pairs: int
    distance_m: float
    ape_m: metrics.Statistics
    rpe: metrics.RelativeErrors
    segments: tuple[metrics.Segment, ...]
    reach: float
    end_pct: float | None
    components: metrics.Components
    heading_drift_deg: float | None
    profile: Profile
    motion: Alignment
    warnings: tuple[str, ...]

    def truth_in_estimate_frame_m(self) -> FloatArray:
        """Return the true positions (N, 3) moved into the frame of the estimate, for plots beside its own data."""
        return (self.profile.truth_m - self.motion.t_m) @ self.motion.R

    def to_json(self) -> dict[str, Any]:
        """Return the result under the names of the public contract."""
        translation = metrics.statistics(self.rpe.translation_m)
        rotation = metrics.statistics(self.rpe.rotation_deg)
        rpe: dict[str, Any] = translation._asdict() if translation else dict.fromkeys(metrics.Statistics._fields)
        rpe |= {"delta": self.rpe.delta, "unit": self.rpe.unit, "pairs": len(self.rpe.translation_m)}
        rpe["rotation_deg"] = rotation._asdict() if rotation else None
        return {
            "alignment": self.alignment,
            "pairs": self.pairs,
            "distance_m": self.distance_m,
            "ape_m": self.ape_m._asdict(),
            "rpe": rpe,
            "segments": [segment._asdict() for segment in self.segments],
            "reach": self.reach,
            "end_pct": self.end_pct,
            **self.components._asdict(),
            "heading_drift_deg_per_100m": self.heading_drift_deg,
            "warnings": list(self.warnings),
        }


def evaluate_trajectory(
    estimate: Trajectory, truth: Trajectory, settings: TrajectoryEvaluationSettings | None = None
) -> TrajectoryEvaluation:
    """Compare `estimate` with `truth`, both poses of the same body in frames with z up.

    Raises:
        InputError: fewer than two stamps match.
        UsageError: an option has no meaning.
    """
    chosen = settings or TrajectoryEvaluationSettings()
    if not chosen.segments_m:
        raise UsageError("no segment length was given: at least one was wanted, e.g. 5,10,20")
    estimate, of_estimate = in_order_of_drive(estimate)
    truth, of_truth = in_order_of_drive(truth)
    offset_ns = clock_offset_ns(estimate, truth)
    if offset_ns is not None:
        estimate = shifted(estimate, offset_ns)
    pairs = associate(estimate, truth, round(chosen.tolerance_s * 1e9))
    sides = (flattened(pairs.estimate), flattened(pairs.truth)) if chosen.planar else (pairs.estimate, pairs.truth)
    reach = metrics.reach(pairs.stamps_ns, truth.stamps_ns, truth.positions_m, _hole_ns(pairs.stamps_ns))
    remarks = [f"the {name}: {text}" for name, text in (("estimate", of_estimate), ("truth", of_truth)) if text]
    if offset_ns is not None:
        remarks.append(
            f"the stamps are of two clocks: the estimate's were moved by {offset_ns / 1e9:.3f} s, to where both move alike"
        )
    along_m = distances_along(sides[1].positions_m, pairs.stamps_ns)
    return _compared(*sides, along_m, reach, chosen, remarks)


def _compared(
    estimate: Poses,
    truth: Poses,
    along: FloatArray,
    reach: float,
    settings: TrajectoryEvaluationSettings,
    remarks: list[str],
) -> TrajectoryEvaluation:
    alignment = align(estimate, truth, settings.alignment)
    moved = aligned(estimate, alignment)
    distance_m = float(along[-1])
    errors = metrics.error_components(moved, truth)
    ape = metrics.statistics(metrics.absolute_errors(moved, truth))
    assert ape is not None, "association gives at least two pairs"  # noqa: S101
    segments = metrics.segments(estimate, truth, settings.segments_m, along)
    hints = (alignment.warning, _planar_hint(estimate, truth), _no_segment(segments, distance_m))
    return TrajectoryEvaluation(
        alignment=alignment.used,
        pairs=len(along),
        distance_m=distance_m,
        ape_m=ape,
        rpe=metrics.relative_errors(estimate, truth, settings.rpe_delta, settings.rpe_unit, along),
        segments=segments,
        reach=reach,
        end_pct=100.0 * metrics.end_error_m(estimate, truth) / distance_m if distance_m > 0 else None,
        components=metrics.Components(*(float(value) for value in np.abs(errors).mean(axis=0))),
        heading_drift_deg=metrics.heading_drift_deg(estimate, truth, along),
        profile=Profile(along, truth.positions_m, moved.positions_m, errors),
        motion=alignment,
        warnings=(*remarks, *(text for text in hints if text)),
    )


def _hole_ns(stamps_ns: IndexArray) -> int:
    """Return how far from a pair the true path still counts as covered: a few usual steps, at least half a second."""
    steps = np.abs(np.diff(stamps_ns))
    return int(max(SMALLEST_HOLE_NS, HOLE_FACTOR * float(np.median(steps))))


def _planar_hint(estimate: Poses, truth: Poses) -> str:
    flat = float(np.ptp(estimate.positions_m[:, 2])) == 0.0
    climb = float(np.ptp(truth.positions_m[:, 2]))
    if not flat or climb < 0.1:
        return ""
    return f"the estimate is planar, the truth climbs {climb:.1f} m: --planar compares x, y and heading only"


def _no_segment(segments: tuple[metrics.Segment, ...], distance_m: float) -> str:
    missing = [f"{segment.length_m:g}" for segment in segments if segment.n == 0]
    if not missing:
        return ""
    return f"no segment of {', '.join(missing)} m: the compared path is {distance_m:.1f} m long"
