"""What speaks for and against each closure, for the report and for `closures.json`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.smoothing.closures import Closure, Refusal
from lhdmap.smoothing.robust import Judgement

CONTRADICTED, DOUBTFUL = "contradicts the odometry and the other closures", "two ways to solve the graph disagree on it"
_MOST_REFUSED = 2000


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
            one.T_earlier_current,
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
