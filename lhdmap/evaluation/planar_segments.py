"""Errors over all segments of one length, for planar poses: each error as a vector, where `metrics.segments` gives means."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.errors import UsageError
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray

_START_STEP_M = 0.5  # as `metrics.SEGMENT_START_STEP_M`: closer starts give nearly the same segments again


class SegmentErrors(NamedTuple):
    """Errors of all segments of one length.

    Attributes:
        vectors: (M, 3), estimated minus true end seen from the true end (m, m, rad).
        spans: (M, 2), rows at which the segments start and stop.
        length_m: how long they are.
    """

    vectors: FloatArray
    spans: FloatArray
    length_m: float

    @property
    def translations_m(self) -> FloatArray:
        """Translation errors, metres, (M,)."""
        return np.hypot(self.vectors[:, 0], self.vectors[:, 1])

    @property
    def translation_pct(self) -> float:
        """Mean translation error, per cent of the length."""
        return float(self.translations_m.mean() / self.length_m * 100.0)

    @property
    def worst_pct(self) -> float:
        """Largest translation error, per cent of the length."""
        return float(self.translations_m.max() / self.length_m * 100.0)

    @property
    def rotation_deg_per_m(self) -> float:
        """Mean rotation error per metre."""
        return float(np.degrees(np.abs(self.vectors[:, 2])).mean() / self.length_m)


def planar_segments(estimate: FloatArray, truth: FloatArray, length_m: float = 10.0) -> SegmentErrors:
    """Return the errors over all segments of `length_m`; they start each half metre of the true path.

    Args:
        estimate: planar poses (N, 3).
        truth: the true poses (N, 3) at the same times.
        length_m: length of the segments along the true path.

    Raises:
        UsageError: the path is shorter than one segment.
    """
    along_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(truth[:, :2], axis=0).T))])
    starts = np.unique(np.searchsorted(along_m, np.arange(0.0, along_m[-1] - length_m, _START_STEP_M)))
    stops = np.searchsorted(along_m, along_m[starts] + length_m)
    keep = stops < len(along_m)
    if not keep.any():
        raise UsageError(f"the path is {along_m[-1]:.1f} m long: segments of {length_m:g} m do not fit")
    vectors = [
        se2.between(se2.between(truth[i], truth[j]), se2.between(estimate[i], estimate[j]))
        for i, j in zip(starts[keep], stops[keep], strict=True)
    ]
    return SegmentErrors(np.array(vectors), np.column_stack([starts[keep], stops[keep]]), length_m)
