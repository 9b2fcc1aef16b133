"""Where a drive was weak or lost, and why: its rows put together to stretches."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from lhdmap.localization.rows import CANDIDATE, LOST, TRACKING, UNKNOWN, LocalizationRow

WEAK = "weak"
_WEAK_ALONG_M, _WEAK_ACROSS_M = 0.1, 0.05
_SHORT_NS, _GAP_NS = 200_000_000, 500_000_000
_WHY = {
    UNKNOWN: "no place was sure enough yet",
    CANDIDATE: "a place was on trial",
    LOST: "the place was given up",
}
_NO_MATCH_SHARE = 0.5


class Episode(NamedTuple):
    """A stretch of time in which a drive was `weak`, `lost`, `unknown` or had but a `candidate`, and `why`.

    `from_ns`, `to_ns`; `node` and `rho_m` where it began (empty, NaN: not known), `at_m` (x, y; NaN: not known).
    """

    kind: str
    from_ns: int
    to_ns: int
    node: str
    rho_m: float
    at_m: tuple[float, float]
    why: str


def episodes(rows: Sequence[LocalizationRow], reasons: Sequence[tuple[int, str]]) -> list[Episode]:
    """Return the stretches in the order of time; `reasons`: when a place was given up, and why."""
    times = [at_ns for at_ns, _ in reasons]
    found = []
    for kind, own in _runs(rows):
        first = own[0]
        why = _weak_for(own) if kind == WEAK else _WHY[kind]
        given_up = bisect_right(times, first.stamp_ns) - 1
        if kind in (LOST, UNKNOWN) and given_up >= 0:
            why = reasons[given_up][1]
        at_m = (first.x_m, first.y_m)
        found.append(Episode(kind, first.stamp_ns, own[-1].stamp_ns, first.node, first.rho_m, at_m, why))
    return found


def _runs(rows: Sequence[LocalizationRow]) -> Iterator[tuple[str, list[LocalizationRow]]]:
    """Yield rows of one kind that follow each other, those that track well left out; weak ones may have short gaps."""
    kind, run = "", list[LocalizationRow]()
    for row in rows:
        now = row.status if row.status != TRACKING else WEAK if _is_weak(row) else ""
        if now == kind or (kind == WEAK and now == "" and row.stamp_ns - run[-1].stamp_ns < _GAP_NS):
            run += [row] if now == kind and kind else []
            continue
        if kind and (kind != WEAK or run[-1].stamp_ns - run[0].stamp_ns >= _SHORT_NS):
            yield kind, run
        kind, run = now, [row]
    if kind:
        yield kind, run


def _is_weak(row: LocalizationRow) -> bool:
    return row.std_along_m > _WEAK_ALONG_M or row.std_across_m > _WEAK_ACROSS_M


def _weak_for(rows: Sequence[LocalizationRow]) -> str:
    along, across = max(row.std_along_m for row in rows), max(row.std_across_m for row in rows)
    unmatched = float(np.mean([row.source == "odometry" for row in rows]))
    why = "no scan fitted the walls" if unmatched > _NO_MATCH_SHARE else "the walls say little along the tunnel"
    return f"{why}: up to {100 * along:.0f} cm along, {100 * across:.0f} cm across (standard deviation)"
