"""Trends over the logs of a batch by machine and shift: charts and a table."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple

from lhdmap.report import charts, markup

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FIGURES = (
    ("drift_pct", "expected error, % of the way", 2),
    ("weak_pct", "weak scans, %", 1),
    ("slip_mean", "slip of the wheels", 3),
    ("pile_width_m", "width of the pile, m", 2),
    ("pile_inclination_deg", "inclination of the pile, deg", 1),
    ("pile_volume_m3", "volume of the pile, m³", 1),
)
_CAPTION = (
    "Dots are logs, lines join the medians of a machine's shifts. Expected error: of the end of the drive, as the map itself "
    "states it; weak: scans that did not fix the motion in all directions; slip: mean share of the wheels' travel that is "
    "none of the machine's."
)
_COLOURS = (charts.FINAL, charts.ODOMETRY, charts.TRUTH, charts.WHEELS, charts.FLAGGED)
_MOST_LETTERS, _MOST_MACHINES = 54, 12  # what can be read beside each other
_FROM_ZERO = ("drift_pct", "weak_pct", "pile_volume_m3")
_HEIGHT_IN = 1.9
Row = Mapping[str, Any]


class Cell(NamedTuple):
    """The rows of one machine in one shift."""

    machine: str
    shift: str
    rows: Sequence[Row]

    def values(self, key: str) -> list[float]:
        """Return a figure of all rows that have it."""
        found = (row["figures"].get(key) for row in self.rows)
        return [float(value) for value in found if isinstance(value, (int, float))]


def cells_of(rows: Sequence[Row]) -> list[Cell]:
    """Return the rows by machine and shift, both in order of their names; rows whose shift is not known make one of its own."""
    grouped = defaultdict(list)
    for row in rows:
        grouped[str(row["machine"]), str(row["shift"] or "not known")].append(row)
    return [Cell(machine, shift, grouped[machine, shift]) for machine, shift in sorted(grouped)]


def trend_section(rows: Sequence[Row]) -> str:
    """Return the section; nothing where no row has any of the figures."""
    cells = cells_of(rows)
    known = [figure for figure in FIGURES if any(cell.values(figure[0]) for cell in cells)]
    if not known:
        return ""
    with charts.styled():
        picture = markup.picture(charts.svg_uri(trend_chart(cells, known)), _CAPTION)
    return markup.section("Trends by machine and shift", picture + _table(cells, known))


def trend_chart(cells: Sequence[Cell], known: Sequence[tuple[str, str, int]]) -> Figure:
    """Draw each figure over the shifts, a line a machine."""
    count = -(-len(known) // 2)
    height_in = 0.8 + _HEIGHT_IN * count
    figure = charts.new_figure(height_in)
    figure.subplots_adjust(hspace=0.55, wspace=0.22, top=1.0 - 0.5 / height_in)
    shifts = sorted({cell.shift for cell in cells})
    machines = sorted({cell.machine for cell in cells})[:_MOST_MACHINES]
    for number, (key, title, _) in enumerate(known, start=1):
        axes = figure.add_subplot(count, 2, number)
        for k, machine in enumerate(machines):
            own = [cell for cell in cells if cell.machine == machine and cell.values(key)]
            _line(axes, own, key, shifts, (k, len(machines)))
        axes.set_title(title, fontsize=9.0, loc="left")
        step = -(-sum(len(shift) + 3 for shift in shifts) // _MOST_LETTERS)
        axes.set_xticks(range(0, len(shifts), step), shifts[::step])
        axes.set_xlim(-0.5, len(shifts) - 0.5)
        if key in _FROM_ZERO:
            axes.set_ylim(bottom=0.0)
    _legend(figure, machines)
    return figure


def _line(axes: Axes, cells: Sequence[Cell], key: str, shifts: Sequence[str], at: tuple[int, int]) -> None:
    """Draw one machine, number `at[0]` of `at[1]`: beside the others, so that no dot hides one of theirs."""
    number, total = at
    colour, aside = _COLOURS[number % len(_COLOURS)], 0.4 * ((number + 0.5) / total - 0.5)
    x = [shifts.index(cell.shift) + aside for cell in cells]
    axes.plot(x, [median(cell.values(key)) for cell in cells], color=colour, marker="_", markersize=9.0)
    for here, cell in zip(x, cells, strict=True):
        values = cell.values(key)
        axes.plot([here] * len(values), values, ".", color=colour, alpha=0.5, markersize=5.0)


def _legend(figure: Figure, machines: Sequence[str]) -> None:
    from matplotlib.lines import Line2D

    lines = [Line2D([], [], color=_COLOURS[k % len(_COLOURS)]) for k in range(len(machines))]
    figure.legend(lines, machines, loc="upper left", ncols=6, fontsize=9.0)


def _table(cells: Sequence[Cell], known: Sequence[tuple[str, str, int]]) -> str:
    """Return medians by machine and shift, with how many logs they are of."""
    head = ("machine", "shift", "logs", "failed", *(title for _, title, _ in known), "piles")
    rows = []
    for cell in cells:
        failed = sum(row["status"] == "failed" for row in cell.rows)
        medians = [_median(cell.values(key), digits) for key, _, digits in known]
        piles = Counter(str(row["figures"]["pile_status"]) for row in cell.rows if row["figures"].get("pile_status"))
        told = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in piles.most_common())
        rows.append((cell.machine, cell.shift, len(cell.rows), failed, *medians, told))
    words = markup.paragraph("Medians; in brackets the number of logs that have the figure.")
    return words + markup.table(head, rows, numbers_from=2, numbers_to=4 + len(known))


def _median(values: Sequence[float], digits: int) -> str:
    return f"{median(values):.{digits}f} ({len(values)})" if values else ""
