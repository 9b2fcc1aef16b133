"""Tables 3, 4 and 5 from loads: as in the paper, and with n, medians, intervals and conditional means.

Each row of Table 5 is of those loads alone that went on so far, so that row to row says nothing of what an attempt brings:
`before` is what the same loads had before it, `gain` what it brought them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from lhdmap.evaluation.loading.loads import Attempt, Load
from lhdmap.evaluation.loading.stats import Stat, stat_of

LONG_S, SHORT_S = 20.0, 6.0
"""The paper's digs take "from 6 to almost 20 s" (Fig. 24)."""


class Row3(NamedTuple):
    """Loads that took so many attempts."""

    attempts: int
    n: int
    share: float
    fill: Stat

    def to_json(self) -> dict[str, Any]:
        """Return the row for JSON."""
        return {
            "attempts": self.attempts,
            "n": self.n,
            "total_attempts": self.attempts * self.n,
            "share": self.share,
            "fill": self.fill.to_json(),
        }


class Row5(NamedTuple):
    """The k-th attempts of the loads that had one."""

    attempt: int
    n: int
    share: float
    duration_s: Stat
    fill: Stat
    before: Stat
    gain: Stat

    def to_json(self) -> dict[str, Any]:
        """Return the row for JSON."""
        stats = {name: getattr(self, name).to_json() for name in ("duration_s", "fill", "before", "gain")}
        return {"attempt": self.attempt, "n": self.n, "share": self.share, **stats}


class Tables(NamedTuple):
    """All three; `attempts` of Table 4 as in Table 3, `attempts_begun` with those that were begun too early."""

    loads: int
    table3: list[Row3]
    attempts: Stat
    attempts_begun: Stat
    fill: Stat
    early: int
    durations: Stat
    within: float
    table5: list[Row5]

    def to_json(self) -> dict[str, Any]:
        """Return `table3`, `table4`, `table5`."""
        return {
            "table3": {
                "rows": [row.to_json() for row in self.table3],
                "n": self.loads,
                "total_attempts": sum(row.attempts * row.n for row in self.table3),
            },
            "table4": {
                "attempts": self.attempts.to_json(),
                "attempts_with_early": self.attempts_begun.to_json(),
                "fill": self.fill.to_json(),
                "early_triggers": self.early,
                "detection_right": self._right(),
            },
            "table5": {
                "rows": [row.to_json() for row in self.table5],
                "duration_s": self.durations.to_json(),
                "within_6_to_20_s": self.within if math.isfinite(self.within) else None,
            },
        }

    def _right(self) -> float | None:
        counted = sum(row.attempts * row.n for row in self.table3)
        return counted / (counted + self.early) if counted + self.early else None


def tables_of(loads: Sequence[Load]) -> Tables:
    """Return the tables of loads; those without a counted attempt are in none."""
    chosen = [load for load in loads if load.counted]
    counts = [len(load.counted) for load in chosen]
    most = max(counts, default=0)
    table3 = []
    for number in range(1, most + 1):
        same = [load for load in chosen if len(load.counted) == number]
        if same:
            fill = stat_of(load.final_fill for load in same)
            table3.append(Row3(number, len(same), len(same) / len(chosen), fill))
    durations = [one.duration_s for load in chosen for one in load.counted]
    timed = [value for value in durations if math.isfinite(value)]
    within = sum(SHORT_S <= value <= LONG_S for value in timed) / len(timed) if timed else math.nan
    return Tables(
        len(chosen),
        table3,
        stat_of(float(count) for count in counts),
        stat_of(float(len(load.attempts)) for load in chosen),
        stat_of(load.final_fill for load in chosen),
        sum(len(load.attempts) - len(load.counted) for load in chosen),
        stat_of(durations),
        within,
        [_row5(chosen, number) for number in range(1, most + 1)],
    )


def _row5(loads: Sequence[Load], number: int) -> Row5:
    chosen: list[tuple[Attempt, Attempt | None]] = [
        (load.counted[number - 1], load.counted[number - 2] if number > 1 else None)
        for load in loads
        if len(load.counted) >= number
    ]
    before = [last.fill if last else 0.0 for _, last in chosen]
    return Row5(
        number,
        len(chosen),
        len(chosen) / len(loads),
        stat_of(one.duration_s for one, _ in chosen),
        stat_of(one.fill for one, _ in chosen),
        stat_of(before),
        stat_of(one.fill - had for (one, _), had in zip(chosen, before, strict=True)),
    )
