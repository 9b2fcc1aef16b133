"""The paths that were driven: by odometry alone, and the final one, loops closed or poses given."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.messages import FloatArray
from lhdmap.pipeline.heading import gyro_correction
from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.pipeline.track import FinalTrack, TrackRows, resample, trajectory_of
from lhdmap.smoothing.smoother import Correction, corrected
from lhdmap.trajectory import Trajectory

_FLOOR = [2, 3, 4]  # of a pose: height, roll, pitch


class DrivenPaths(NamedTuple):
    """The path by odometry alone and the final one, at the scans; the final `rows`, whether they `moved`, closed loops.

    `end_covariance` (3, 3) and `end_height_std_m`: of the last key scan once loops were closed.
    """

    odometry: Trajectory
    final: Trajectory
    rows: TrackRows
    moved: bool
    closures: int
    end_covariance: FloatArray | None = None
    end_height_std_m: float | None = None


def odometry_of(pipeline: MappingPipeline) -> Trajectory:
    """Return the path by odometry alone."""
    stamps, times = moments_of(pipeline)
    return trajectory_of(resample(pipeline.track.rows(), times), stamps)


def ways_of(pipeline: MappingPipeline, given: TrackRows | None) -> DrivenPaths:
    """Close loops and return both paths; with `given` poses these are final.

    Raises:
        InputError: no scan was taken at a time of the given poses.
    """
    stamps, times = moments_of(pipeline)
    rows = pipeline.path.final.rows() if given is None else given
    steadied = None if given is not None else gyro_correction(pipeline, rows)
    if steadied is not None:
        rows = TrackRows(rows.times_ns, corrected(rows.poses, rows.times_ns, steadied))
    correction = None if given is not None else _correction(pipeline, rows, steadied)
    if given is not None and not any(map(FinalTrack(given).covers, times.tolist())):
        raise InputError(
            f"the given poses are of {given.times_ns[0] / 1e9:.3f} to {given.times_ns[-1] / 1e9:.3f} s, "
            f"the scans of {times[0] / 1e9:.3f} to {times[-1] / 1e9:.3f} s: none has a pose"
        )
    if correction is not None:
        rows = TrackRows(rows.times_ns, corrected(rows.poses, rows.times_ns, correction))
    final = trajectory_of(resample(rows, times), stamps)
    moved = given is not None or correction is not None or steadied is not None
    if correction is not None:
        end: tuple[int, FloatArray | None, float | None] = (
            correction.closures, correction.end_covariance, correction.height_std_m
        )  # fmt: skip
    else:
        end = 0, None if steadied is None else pipeline.evidence.smoother.end_covariance([steadied]), None
    return DrivenPaths(odometry_of(pipeline), final, rows, moved, *end)


def _correction(pipeline: MappingPipeline, rows: TrackRows, steadied: Correction | None) -> Correction | None:
    """Return how closed loops move the path; heights close where an inclinometer tells them."""

    def floor(times_ns: npt.NDArray[np.int64]) -> FloatArray:
        return resample(rows, times_ns).poses[:, _FLOOR]

    moved = [one for one in (pipeline.path.correction(), steadied) if one is not None]
    return pipeline.evidence.smoother.correction(moved, floor if pipeline.has_inclinometer else None)


def moments_of(pipeline: MappingPipeline) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return the stamps of the front scans and the times of their poses, shape (N,)."""
    records = pipeline.records
    return records.stamps_ns, records.times_ns
