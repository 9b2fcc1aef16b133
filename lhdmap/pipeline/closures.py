"""What the report shows of loop closures: evidence of the smoother, at the final poses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lhdmap.geometry import se2
from lhdmap.pipeline.track import TrackRows, resample
from lhdmap.report.data import ClosureRow
from lhdmap.smoothing.evidence import Evidence

_PLANAR = [0, 1, 5]  # of a pose: x, y, heading


def closure_rows(evidence: Sequence[Evidence], rows: TrackRows) -> list[ClosureRow]:
    """Return places that were taken for ones seen before, where they are on the final path `rows`; those believed first.

    What a closure measured is set against the final poses; NaN where nothing was measured.
    """
    if not evidence:
        return []
    earlier, current = (
        resample(rows, np.array(times_ns, dtype=np.int64)).poses
        for times_ns in ([one.earlier_ns for one in evidence], [one.current_ns for one in evidence])
    )
    found = []
    for one, first, later in zip(evidence, earlier, current, strict=True):
        apart = se2.between(first[_PLANAR], later[_PLANAR]) - one.offset
        information = 1.0 / one.sigma_m**2 if one.sigma_m > 0.0 else float("nan")
        residual_m = float(np.linalg.norm(apart[:2]))
        found.append(ClosureRow(first[:3], later[:3], one.accepted, residual_m, information, one.reason))
    return sorted(found, key=lambda row: not row.accepted)
