"""Tables 3 and 4 as lines of cells, ours with the paper's µ and σ below, and what must be said with them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from lhdmap.evaluation.navigation.drive import RATE_HZ, STANDING_MPS
from lhdmap.evaluation.navigation.groups import ALL, Group, grouped
from lhdmap.evaluation.navigation.paper import paper_rows
from lhdmap.evaluation.navigation.rate_free import LOW_PASS
from lhdmap.evaluation.navigation.row import Row
from lhdmap.names import name_of


class Column(NamedTuple):
    """A column: its figure, head and number of digits."""

    figure: str
    head: str
    digits: int


class Table(NamedTuple):
    """Heads and lines of cells; the first cell is a name. `groups_at`: where the lines of µ and σ begin, then the paper's."""

    title: str
    heads: list[str]
    lines: list[list[str]]
    groups_at: tuple[int, int]


TABLE_3 = (
    Column("mean_speed_kmh", "mean km/h", 2),
    Column("max_speed_kmh", "max km/h", 2),
    Column("length_s", "length s", 1),
    Column("navigation_s", "nav s", 1),
    Column("stop_s", "stop s", 1),
    Column("teleoperation_s", "t.op s", 1),
    Column("td_net_m", "TD net m", 1),
    Column("td_travelled_m", "TD trav m", 1),
    Column("tad_net_m", "TAD net m", 1),
    Column("tad_travelled_m", "TAD trav m", 1),
)
TABLE_4 = (
    Column("acd", "ACD", 4),
    Column("mcd", "MCD", 4),
    Column("asd", "ASD", 4),
    Column("msd", "MSD", 4),
    Column("adlw_m", "ADLW m", 2),
    Column("mdlw_m", "MDLW m", 2),
    Column("adrw_m", "ADRW m", 2),
    Column("mdrw_m", "MDRW m", 2),
)
RATE_FREE = (
    Column("acd_moving", "ACD moving", 4),
    Column("asd_moving", "ASD moving", 4),
    Column("steering_rate_rms_dps", "rms dγ/dt °/s", 2),
    Column("steering_acceleration_rms_dps2", "rms d²γ/dt² °/s²", 2),
    Column("acceleration_rms_mps2", "rms dv/dt m/s²", 3),
)
CONVENTION = (
    f"E of Eqs. (22), (23) at {RATE_HZ:g} Hz: commands propel and steering rate / largest, each ±1; speed in km/h, "
    "articulation in degrees; mean and largest of the whole drive. The paper tells neither rate nor units: its figures "
    "compare with these only if they are the same."
)
LOW_PASSED = f"rms after one low pass: {LOW_PASS}; they do not depend on the log's rate."
STANDING = (
    f"standing: slower than {STANDING_MPS:g} m/s by the wheels. TD, TAD: net and travelled; the paper's TD is net. "
    "σ: of a sample (n − 1)."
)
WALLS = (
    "walls: from the bodies' sides across to hits of the scanners, at their height, while the machine moves; the paper's "
    "least distances end at 0.10 m, these do not."
)
PAPER = (
    "paper: the µ, σ (1-14) that its Table 4 prints of ACD to MSD are those of the loaded runs alone; here each group has "
    "its own."
)
NOTES = (CONVENTION, LOW_PASSED, STANDING, WALLS, PAPER)


def tables(rows: Sequence[Row]) -> list[Table]:
    """Return Table 3, Table 4, and the figures that do not depend on a rate (the paper has none)."""
    ours, papers = _apart(grouped(rows)), grouped(paper_rows())
    split = [[one for one in groups if one.load != ALL] or groups for groups in (ours, papers)]
    return [
        _table("Table 3: speeds, times, distances", TABLE_3, rows, split[0], split[1]),
        _table("Table 4: smoothness, walls", TABLE_4, rows, ours, papers),
        _table("Smoothness that does not depend on the rate, and while moving", RATE_FREE, rows, ours, ()),
    ]


def _apart(groups: Sequence[Group]) -> list[Group]:
    """Return the groups without those of all loads that hold the rows of one load alone."""
    of_one = {(group.operation, group.n) for group in groups if group.load != ALL}
    return [group for group in groups if group.load != ALL or (group.operation, group.n) not in of_one]


def as_text(rows: Sequence[Row]) -> str:
    """Return all tables for a terminal; without a row that could be used, why."""
    broken = [f"not used: {row.problem}" for row in rows if row.problem]
    if len(broken) == len(rows):
        return "\n".join(broken)
    parts = []
    for table in tables(rows):
        widths = [max(map(len, cells)) for cells in zip(table.heads, *table.lines, strict=True)]
        lines = [table.title, _aligned(table.heads, widths)]
        for number, line in enumerate(table.lines):
            lines += [""] if number in table.groups_at and number else []
            lines.append(_aligned(line, widths))
        parts.append("\n".join(line.rstrip() for line in lines))
    return "\n\n".join([*parts, "\n".join([*broken, *NOTES])])


def _table(
    title: str, columns: Sequence[Column], rows: Sequence[Row], ours: Sequence[Group], papers: Sequence[Group]
) -> Table:
    heads = ["drive", "by", "E/L", "F/B", *(column.head for column in columns)]
    names = _names(rows)
    lines = [
        [name, row.operation or "-", row.load or "-", row.heading or "-", *_cells(row.figures, columns)]
        for name, row in zip(names, rows, strict=True)
    ]
    own = [line for group in ours if group.n > 1 for line in _group_lines(group, "", columns)]
    paper = [line for group in papers for line in _group_lines(group, "paper ", columns)]
    return Table(title, heads, [*lines, *own, *paper], (len(lines), len(lines) + len(own)))


def _group_lines(group: Group, whose: str, columns: Sequence[Column]) -> Iterator[list[str]]:
    for letter, values in (("µ", group.mu), ("σ", group.sigma))[: min(group.n, 2)]:
        name = f"{whose}{letter} of {group.n}"
        yield [name, group.operation or "-", group.load, "", *_cells(values, columns)]


def _cells(values: Mapping[str, float | None], columns: Sequence[Column]) -> list[str]:
    found = []
    for column in columns:
        value = values.get(column.figure)
        found.append("-" if value is None else f"{value:.{column.digits}f}")
    return found


def _names(rows: Sequence[Row]) -> list[str]:
    """Return short names of the logs, whole paths where short ones are not all different."""
    short = [name_of(Path(row.log)) for row in rows]
    return short if len(set(short)) == len(short) else [row.log for row in rows]


def _aligned(cells: Sequence[str], widths: Sequence[int]) -> str:
    first = [cell.ljust(width) for cell, width in zip(cells[:4], widths[:4], strict=True)]
    return "  ".join([*first, *(cell.rjust(width) for cell, width in zip(cells[4:], widths[4:], strict=True))])
