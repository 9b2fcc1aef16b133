"""The smoothing stage: key scans while the odometry runs, closures and the pose graph at the end, corrections between keys."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.smoothing.closures import Closure, Refusal, find_closures
from lhdmap.smoothing.evidence import Evidence, evidence_of
from lhdmap.smoothing.graph import chained, smoothed
from lhdmap.smoothing.keys import KeyScans
from lhdmap.smoothing.robust import Tie, judged
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.space import smoothed_in_space
from lhdmap.smoothing.steps import step_covariances

_PLANAR = [0, 1, 5]  # of a pose: x, y, heading
_BLOCK = 50_000  # poses moved at a time: what is needed on the way is ten times the poses


class Correction(NamedTuple):
    """Planar corrections of the odometry: `pose_map_odom` (N, 3) at `times_ns` (N,), and the number of closures behind them.

    `end_covariance` (3, 3): of the last key, in its axes, where closures were used; `raised_m` (N,): what the heights change by;
    `left` (N, 2): what a gyroscope leaves of the error of a step's heading: share of its variance, and what adds up with time
    (rad/s); `height_std_m`: of the last key, where loops were closed in space.
    """

    times_ns: npt.NDArray[np.int64]
    pose_map_odom: FloatArray
    closures: int
    end_covariance: FloatArray | None = None
    raised_m: FloatArray | None = None
    left: FloatArray | None = None
    height_std_m: float | None = None


class Smoother:
    """Collects key scans (`keys.update`); `correction` closes loops and solves the graph."""

    def __init__(self, settings: SmoothingSettings) -> None:
        self._settings = settings
        self.keys = KeyScans(settings)
        self.evidence: list[Evidence] = []  # of all places that were looked at, once `correction` was asked for

    def correction(
        self,
        moved: Sequence[Correction] = (),
        floor: Callable[[npt.NDArray[np.int64]], FloatArray] | None = None,
    ) -> Correction | None:
        """Return how the path is to be moved, or None where no place was seen twice.

        The path is the odometry's, as realignment and gyroscope have `moved` it, one after the other. `floor` tells height (m),
        roll and pitch (rad) at times (N,) as (N, 3), where an inclinometer does: then the graph is one in space.
        """
        keys = self._moved(moved)
        refused: list[Refusal] = []
        found = find_closures(keys, self._settings, refused) if self._settings.closures else []
        closures = self._believed(keys, found, refused)
        if not closures:
            return None
        times_ns = np.array([key.time_ns for key in keys], dtype=np.int64)
        raised, height_std_m = None, None
        if floor is None:
            poses, end = smoothed(keys, closures, self._settings)
        else:
            poses, raised, end, height_std_m = smoothed_in_space(keys, floor(times_ns), closures, self._settings)
        moves = np.array([se2.compose(pose, se2.inverse(key.pose)) for pose, key in zip(poses, keys, strict=True)])
        moves[:, 2] = np.unwrap(moves[:, 2])
        return Correction(times_ns, moves, len(closures), end, raised, height_std_m=height_std_m)

    def end_covariance(self, moved: Sequence[Correction]) -> FloatArray:
        """Return the covariance (3, 3) of the last key on the path as it was `moved`, without closures."""
        return chained(self._moved(moved)).covariance

    def _moved(self, moved: Sequence[Correction]) -> list[KeyScan]:
        keys = self.keys.keys
        for one in moved:
            keys = moved_keys(keys, one)
        return keys

    def _believed(self, keys: list[KeyScan], found: list[Closure], refused: list[Refusal]) -> list[Closure]:
        """Return the closures that agree with odometry and each other, and note what speaks for and against each."""
        poses = np.array([key.pose for key in keys]).reshape(-1, 3)
        ties = [Tie(one.earlier, one.current, one.pose_earlier_current, one.covariance) for one in found]
        judgement = judged(poses, step_covariances(keys, self._settings), ties)
        self.evidence = evidence_of(keys, found, judgement, refused)
        return [closure for closure, kept in zip(found, judgement.kept, strict=True) if kept]


def corrected(poses: FloatArray, times_ns: npt.NDArray[np.int64], correction: Correction) -> FloatArray:
    """Return poses (N, 6: x, y, z, roll, pitch, heading) at `times_ns` moved by the correction, blended between keys.

    Blending the keys' moves about the origin would swing far poses: each pose is moved by both neighbours and the results mixed.
    """
    out = poses.copy()
    for first in range(0, len(poses), _BLOCK):
        rows = slice(first, first + _BLOCK)
        out[rows][:, _PLANAR] = _planar(poses[rows], times_ns[rows], correction)
    if correction.raised_m is not None:
        since = (times_ns - correction.times_ns[0]).astype(float)
        out[:, 2] += np.interp(since, (correction.times_ns - correction.times_ns[0]).astype(float), correction.raised_m)
    return out


def _planar(poses: FloatArray, times_ns: npt.NDArray[np.int64], correction: Correction) -> FloatArray:
    """Return x, y, heading (N, 3) of the moved poses."""
    at = np.clip(np.searchsorted(correction.times_ns, times_ns, side="right") - 1, 0, len(correction.times_ns) - 1)
    after = np.minimum(at + 1, len(correction.times_ns) - 1)
    span = np.maximum((correction.times_ns[after] - correction.times_ns[at]).astype(float), 1.0)
    share = np.clip((times_ns - correction.times_ns[at]).astype(float) / span, 0.0, 1.0)[:, None]
    planar = poses[:, _PLANAR]
    return (1.0 - share) * _moved(correction.pose_map_odom[at], planar) + share * _moved(
        correction.pose_map_odom[after], planar
    )


def moved_keys(keys: list[KeyScan], correction: Correction) -> list[KeyScan]:
    """Return the keys as a correction moves them, with what it leaves of their errors."""
    poses = np.zeros((len(keys), 6))
    poses[:, [0, 1, 5]] = np.array([key.pose for key in keys]).reshape(-1, 3)
    times_ns = np.array([key.time_ns for key in keys], dtype=np.int64)
    moved = corrected(poses, times_ns, correction)[:, [0, 1, 5]]
    out = [key._replace(pose=pose) for key, pose in zip(keys, moved, strict=True)]
    if correction.left is None:
        return out
    at = np.searchsorted(correction.times_ns, times_ns).clip(max=len(correction.left) - 1)
    step_s = np.diff(times_ns, prepend=times_ns[:1]) * 1e-9
    left = correction.left[at]
    return [
        key._replace(error=key.error.steadied(share, rate_rps * dt_s))
        for key, (share, rate_rps), dt_s in zip(out, left.tolist(), step_s.tolist(), strict=True)
    ]


def _moved(T: FloatArray, planar: FloatArray) -> FloatArray:
    c, s = np.cos(T[:, 2]), np.sin(T[:, 2])
    x = T[:, 0] + c * planar[:, 0] - s * planar[:, 1]
    y = T[:, 1] + s * planar[:, 0] + c * planar[:, 1]
    return np.column_stack([x, y, planar[:, 2] + T[:, 2]])
