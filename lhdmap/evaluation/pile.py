"""Width, inclination and status of piles against the truth, as in Table 6 of the autonomous loading paper.

The paper's own rows give 0.58 m and 1.7 deg; its truth was set by hand on the same registered clouds (n = 6), so the errors
of odometry and inclinometer, which move cloud and truth alike, are not in them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lhdmap.errors import LhdmapError
from lhdmap.evaluation.pile_truth import Attempt, Measured, PileTruth
from lhdmap.pile.result import STATUSES

if TYPE_CHECKING:
    from lhdmap.pile.result import PileEstimate, PileReport

Runner = Callable[[Path], "PileReport"]
WITHIN_STD = 2.0
"""Errors up to this many standard deviations are called covered (95 % nominal)."""


class PileRow(NamedTuple):
    """One attempt with what was found.

    `judged`: whether a status was looked for; `problem`: why a log could not be run (empty: it could); `reason`: why there is
    no status (empty: there is one).
    """

    attempt: Attempt
    found: Measured
    judged: bool = True
    problem: str = ""
    reason: str = ""

    @property
    def width_error_m(self) -> float | None:
        """Predicted minus true width, metres."""
        return _difference(self.found.width_m, self.attempt.truth.width_m)

    @property
    def inclination_error_deg(self) -> float | None:
        """Predicted minus true inclination, degrees."""
        return _difference(self.found.inclination_deg, self.attempt.truth.inclination_deg)

    @property
    def identified(self) -> bool:
        """Whether the pile was identified; "none" and a pile without figures are not."""
        return self.found.width_m is not None and self.found.inclination_deg is not None

    def to_json(self) -> dict[str, Any]:
        """Return the row as plain values; standard deviations have the names of `pile.json` and those of the truth file."""
        truth, found = self.attempt.truth, self.found
        return {
            "attempt": self.attempt.name,
            "log": self.attempt.log,
            "gt_width_m": truth.width_m,
            "gt_inclination_deg": truth.inclination_deg,
            "gt_status": truth.status,
            "pred_width_m": found.width_m,
            "pred_inclination_deg": found.inclination_deg,
            "pred_status": found.status,
            "width_std_m": found.width_std_m,
            "inclination_std_deg": found.inclination_std_deg,
            "pred_width_std_m": found.width_std_m,
            "pred_inclination_std_deg": found.inclination_std_deg,
            "width_error_m": self.width_error_m,
            "inclination_error_deg": self.inclination_error_deg,
            "problem": self.problem or None,
            "reason": self.reason or None,
        }


class ErrorSummary(NamedTuple):
    """Absolute errors of one quantity in its unit; `within_std`: share within 2 standard deviations. None: no such row."""

    n: int
    mae: float | None
    median: float | None
    p90: float | None
    max: float | None
    within_std: float | None


class PileEvaluation(NamedTuple):
    """All rows, and whether their predictions came from running the logs."""

    rows: tuple[PileRow, ...]
    was_run: bool

    @property
    def width(self) -> ErrorSummary:
        """Errors of the width, metres."""
        return _summary([(row.width_error_m, row.found.width_std_m) for row in self.rows])

    @property
    def inclination(self) -> ErrorSummary:
        """Errors of the inclination, degrees."""
        return _summary([(row.inclination_error_deg, row.found.inclination_std_deg) for row in self.rows])

    @property
    def status(self) -> StatusSummary:
        """How often the status was right."""
        return status_summary(self.rows)

    @property
    def identified(self) -> int:
        """How many rows have a width and an inclination."""
        return sum(row.identified for row in self.rows)

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain values with the names of the contract."""
        return {
            "rows": [row.to_json() for row in self.rows],
            "n": len(self.rows),
            "identified": self.identified,
            "was_run": self.was_run,
            **_summary_json("width", "m", self.width),
            **_summary_json("inclination", "deg", self.inclination),
            **self.status.to_json(),
        }


class StatusSummary(NamedTuple):
    """Status of the rows with a true one: accuracy, its mean over the true statuses, and counts of (true, found)."""

    n: int
    accuracy: float | None
    macro_accuracy: float | None
    called_loadable: float | None
    counts: dict[tuple[str, str], int]

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain values."""
        table: dict[str, dict[str, int]] = {}
        for (true, found), count in self.counts.items():
            table.setdefault(true, {})[found] = count
        return {
            "status_accuracy": self.accuracy,
            "status_macro_accuracy": self.macro_accuracy,
            "status_n": self.n,
            "falsely_loadable_share": self.called_loadable,
            "status_counts": table,
        }


def evaluate_pile(truth: PileTruth, run: Runner | None = None, *, at_decision: bool = False) -> Iterator[PileRow]:
    """Yield one row an attempt: from its prediction in the file, or by running its log where it has none.

    Args:
        truth: what was read.
        run: identifies the pile in a log. An error of lhdmap ends the row, not the evaluation; the row says why.
        at_decision: take the estimate of the moment of decision, not the last one (which is what `pile.json` holds).
    """
    for attempt in truth.attempts:
        if run is None or not truth.is_run(attempt):
            yield PileRow(attempt, attempt.predicted, judged=truth.has_statuses)
            continue
        try:
            report = run(truth.log_path(attempt))
            reason = report.estimate.reason
            yield PileRow(attempt, measured(report, at_decision=at_decision), judged=not reason, reason=reason)
        except LhdmapError as error:
            yield PileRow(attempt, Measured(), judged=False, problem=str(error))


def measured(report: PileReport, *, at_decision: bool = False) -> Measured:
    """Return what a report says; nothing where the pile was not identified, but for the status `none`."""
    snapshot = report.decision if at_decision or report.decision is None else report.last
    if report.decision is None or snapshot is None:
        last = report.last.estimate.status if report.last is not None else None
        return Measured(status=last if last == "none" else None)
    estimate: PileEstimate = snapshot.estimate
    return Measured(
        _finite(estimate.width_m),
        _finite(estimate.inclination_deg),
        estimate.status,
        _finite(estimate.width_std_m),
        _finite(estimate.inclination_std_deg),
    )


def status_summary(rows: Iterable[PileRow]) -> StatusSummary:
    """Count statuses; a pile that was not identified counts as `none`; what has no status for a reason does not count."""
    counts = Counter(
        (row.attempt.truth.status, row.found.status or "none")
        for row in rows
        if row.attempt.truth.status is not None and row.judged
    )
    return _status_of({(true, found): count for (true, found), count in counts.items() if true is not None})


def _status_of(counts: dict[tuple[str, str], int]) -> StatusSummary:
    totals = {true: sum(n for (t, _), n in counts.items() if t == true) for true in STATUSES}
    totals = {true: n for true, n in totals.items() if n}
    n = sum(totals.values())
    if not n:
        return StatusSummary(0, None, None, None, {})
    right = {true: counts.get((true, true), 0) for true in totals}
    others = n - totals.get("loadable", 0)
    falsely = sum(count for (true, found), count in counts.items() if found == "loadable" != true)
    macro = float(np.mean([right[true] / totals[true] for true in totals]))
    return StatusSummary(n, sum(right.values()) / n, macro, falsely / others if others else None, counts)


def _summary(pairs: list[tuple[float | None, float | None]]) -> ErrorSummary:
    errors = np.abs([error for error, _ in pairs if error is not None])
    if not len(errors):
        return ErrorSummary(0, None, None, None, None, None)
    covered = [abs(error) <= WITHIN_STD * std for error, std in pairs if error is not None and std is not None]
    return ErrorSummary(
        len(errors),
        float(errors.mean()),
        float(np.median(errors)),
        float(np.percentile(errors, 90)),
        float(errors.max()),
        float(np.mean(covered)) if covered else None,
    )


def _summary_json(name: str, unit: str, found: ErrorSummary) -> dict[str, Any]:
    return {
        f"{name}_n": found.n,
        f"{name}_mae_{unit}": found.mae,
        f"{name}_median_error_{unit}": found.median,
        f"{name}_p90_error_{unit}": found.p90,
        f"{name}_max_error_{unit}": found.max,
        f"{name}_within_2_std": found.within_std,
    }


def _difference(found: float | None, true: float | None) -> float | None:
    return None if found is None or true is None else found - true


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
