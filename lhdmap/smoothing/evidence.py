"""What speaks for and against each closure, for the report and for `closures.json`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.smoothing.closures import ALIKE, SMOOTH, Closure, Refusal
from lhdmap.smoothing.robust import Judgement

CONTRADICTED, DOUBTFUL = "contradicts the odometry and the other closures", "two ways to solve the graph disagree on it"
_MOST_REFUSED = 2000
_FEWEST_OPEN = 10  # a few places alone are met on any drive


class Evidence(NamedTuple):
    """One place that was looked at: times of both keys, whether it is believed and why not, and the figures.

    `support`: share of hits that agree; `sigma_m`: deviation in the worse direction; `offset` (3,): of the current key in the
    earlier one's axes, NaN where none was measured; `chi2`: squared Mahalanobis distance in the solved graph, of three numbers.
    """

    earlier_ns: int
    current_ns: int
    accepted: bool
    reason: str
    support: float
    sigma_m: float
    offset: FloatArray
    chi2: float

    def to_json(self) -> dict[str, Any]:
        """Return the values of `closures.json`."""
        return self._asdict() | {"offset": self.offset.tolist()}


def evidence_of(
    keys: Sequence[KeyScan], found: Sequence[Closure], judgement: Judgement, refused: Sequence[Refusal]
) -> list[Evidence]:
    """Return what is known of all closures, in the order of time; of those refused early, the first two thousand."""
    rows = [
        Evidence(
            keys[one.earlier].time_ns,
            keys[one.current].time_ns,
            bool(kept),
            "" if kept else DOUBTFUL if doubtful else CONTRADICTED,
            one.support,
            one.sigma_m,
            one.pose_earlier_current,
            float(chi2),
        )
        for one, kept, doubtful, chi2 in zip(found, judgement.kept, judgement.doubtful, judgement.chi2, strict=True)
    ]
    nowhere = np.full(3, np.nan)
    rows += [
        Evidence(
            keys[one.earlier].time_ns,
            keys[one.current].time_ns,
            False,
            one.reason,
            one.support,
            one.sigma_m,
            nowhere,
            np.nan,
        )
        for one in refused[:_MOST_REFUSED]
    ]
    return sorted(rows, key=lambda row: row.current_ns)


def open_loops(evidence: Sequence[Evidence]) -> list[str]:
    """Return a remark where more places are left open than closed, because the walls do not tell which place it is."""
    left_open = sum(row.reason in (ALIKE, SMOOTH) for row in evidence)
    accepted = sum(row.accepted for row in evidence)
    if left_open < _FEWEST_OPEN or left_open <= accepted:
        return []
    return [
        f"loop closure: {left_open} places look like earlier ones, but the walls do not tell which; no loop was closed there"
    ]
