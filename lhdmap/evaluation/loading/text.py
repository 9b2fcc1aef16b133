"""Tables 3, 4 and 5 for a terminal, ours beside the paper's."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lhdmap.evaluation.loading.loads import Load
from lhdmap.evaluation.loading.paper import PRINTED_ATTEMPTS, paper_loads
from lhdmap.evaluation.loading.stats import Stat
from lhdmap.evaluation.loading.tables import Tables, tables_of

_MEANS = (
    "±: half of the 95 % interval of the mean (Student). Table 5 is of the loads alone that went that far: `before` is what "
    "the same loads had before, `gain` what the attempt brought."
)
_ERRATUM = (
    f"the paper's Table 4 prints {PRINTED_ATTEMPTS} attempts; its Table 3 gives 74 / 30 = 2.47 (erratum). Early triggers are "
    "counted apart, as there."
)
NOTES = (_MEANS, _ERRATUM)


def as_text(loads: Sequence[Load]) -> str:
    """Return all tables of loads."""
    ours, paper = tables_of(loads), tables_of(paper_loads())
    return "\n\n".join([_table_3(ours, paper), _table_4(ours, paper), _table_5(ours, paper), "\n".join(NOTES)])


def _table_3(ours: Tables, paper: Tables) -> str:
    by = {row.attempts: row for row in ours.table3}
    theirs = {row.attempts: row for row in paper.table3}
    lines = [["Table 3", "loads", "attempts", "share", "fill", "median", "paper: loads", "share", "fill"]]
    for number in sorted(by | theirs):
        row, other = by.get(number), theirs.get(number)
        ours_cells = (
            [str(row.n), str(row.n * number), _percent(row.share), _fill(row.fill), _percent(row.fill.median)]
            if row
            else ["-"] * 5
        )
        cells = [str(other.n), _percent(other.share), _percent(other.fill.mean)] if other else ["-"] * 3
        lines.append([f"{number} attempt{'s' if number > 1 else ''}", *ours_cells, *cells])
    total = sum(row.attempts * row.n for row in ours.table3)
    lines.append(["total", str(ours.loads), str(total), "", "", "", str(paper.loads), "", ""])
    return _aligned(lines)


def _table_4(ours: Tables, paper: Tables) -> str:
    lines = [["Table 4", "n", "mean", "median", "paper"]]
    for name, stat, other, form in (
        ("attempts", ours.attempts, paper.attempts, _plain),
        ("with early triggers", ours.attempts_begun, paper.attempts_begun, _plain),
        ("fill", ours.fill, paper.fill, _fill),
    ):
        shown = f"{other.mean:.2f}" if form is _plain else _percent(other.mean)
        middle = f"{stat.median:g}" if form is _plain else _percent(stat.median)
        lines.append([name, str(stat.n), form(stat), middle, shown])
    lines.append(["early triggers", str(ours.early), "", "", str(paper.early)])
    return _aligned(lines)


def _table_5(ours: Tables, paper: Tables) -> str:
    theirs = {row.attempt: row for row in paper.table5}
    heads = ["Table 5", "n", "share", "duration s", "median", "fill", "median", "before", "gain"]
    lines = [[*heads, "paper: n", "s", "fill"]]
    for row in ours.table5:
        other = theirs.get(row.attempt)
        cells = [str(other.n), f"{other.duration_s.mean:.1f}", _percent(other.fill.mean)] if other else ["-"] * 3
        seconds = [_plain(row.duration_s, 1), _number(row.duration_s.median)]
        fills = [_fill(row.fill), _percent(row.fill.median), _percent(row.before.mean), _fill(row.gain)]
        lines.append([f"attempt {row.attempt}", str(row.n), _percent(row.share), *seconds, *fills, *cells])
    within = f"digs within 6 to 20 s: {_percent(ours.within)} of {ours.durations.n}"
    return f"{_aligned(lines)}\n{within}"


def _percent(value: float) -> str:
    return f"{100.0 * value:.0f} %" if math.isfinite(value) else "-"


def _number(value: float) -> str:
    return f"{value:.1f}" if math.isfinite(value) else "-"


def _fill(stat: Stat) -> str:
    if not stat.n:
        return "-"
    return f"{100.0 * stat.mean:.0f}{_half(100.0 * stat.mean_95, 0)} %"


def _plain(stat: Stat, digits: int = 2) -> str:
    return f"{stat.mean:.{digits}f}{_half(stat.mean_95, digits)}" if stat.n else "-"


def _half(value: float, digits: int) -> str:
    return f" ± {value:.{digits}f}" if math.isfinite(value) else ""


def _aligned(lines: Sequence[Sequence[str]]) -> str:
    widths = [max(map(len, cells)) for cells in zip(*lines, strict=True)]
    rows = [
        [cells[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(cells[1:], widths[1:], strict=True))]
        for cells in lines
    ]
    return "\n".join("  ".join(row).rstrip() for row in rows)
