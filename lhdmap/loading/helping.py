"""The open request of a mission, the answers to it, and the seconds that operators spent."""

from __future__ import annotations

import math
from collections.abc import Mapping

from lhdmap.loading.assistance import ANSWERS, Answer, Request
from lhdmap.loading.moment import LoadingInput
from lhdmap.loading.states import State

_ASKS = {
    State.POSITIONING_ASSISTANCE: "put the machine before the pile, or mark the pile, then go on; or load by hand; or abort",
    State.LOADING_ASSISTANCE: "free the machine and go on, or finish the loading by hand; it is weighed then; or abort",
}


class Help:
    """Counts, asks, and takes answers to the request that is open, no others."""

    def __init__(self) -> None:
        self.request: Request | None = None
        self.count, self.seconds = 0, 0.0
        self.refused = ""

    def begin(self) -> None:
        """Begin a mission."""
        self.request, self.count, self.seconds = None, 0, 0.0

    def ask(self, state: State, during: State, why: str, tried: tuple[str, ...], told: LoadingInput) -> Request:
        """Open a request; the one before is closed."""
        self.count += 1
        kind = "positioning" if state == State.POSITIONING_ASSISTANCE else "loading"
        self.request = Request(self.count, told.now_ns, kind, during.value, why, tried, evidence_of(told), _ASKS[state])
        return self.request

    def close(self) -> None:
        """Close the open request."""
        self.request = None

    def taken(self, answer: Answer | None) -> Answer | None:
        """Return an answer that counts; `refused` says why another one does not."""
        self.refused = ""
        if answer is None:
            return None
        if self.request is None or answer.number != self.request.number:
            self.refused = f"answer to request {answer.number}, which is not open"
        elif answer.kind not in ANSWERS:
            self.refused = f"unknown answer '{answer.kind}'"
        else:
            return answer
        return None


def evidence_of(told: LoadingInput) -> Mapping[str, str | float]:
    """Return what an operator may look at: names of cloud and pile, values of all signals that are numbers."""
    evidence: dict[str, str | float] = dict(told.evidence)
    if told.pile is not None:
        estimate = told.pile.estimate
        evidence["pile_ns"] = str(told.pile.stamp_ns)
        evidence["pile_status"] = str(estimate.status)
        evidence["pile_reason"] = estimate.reason
        evidence["pile_inclination_deg"] = estimate.inclination_deg
        evidence["pile_width_m"] = estimate.width_m
    if told.motion is not None:
        evidence |= {
            f"motion_{name}": float(value) for name, value in told.motion._asdict().items() if name != "stamp_ns"
        }
    if told.signals is not None:
        values = told.signals._asdict()
        evidence |= {name: float(value) for name, value in values.items() if name not in ("now_ns", "scan_ns")}
    return {name: value for name, value in evidence.items() if isinstance(value, str) or math.isfinite(value)}
