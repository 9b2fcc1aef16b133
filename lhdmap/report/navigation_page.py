"""The report of `eval navigation`: Tables 3 and 4 beside the paper's, and each drive as in its Figs. 15 to 20."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lhdmap.evaluation.navigation.drive import Samples
from lhdmap.evaluation.navigation.row import Row
from lhdmap.evaluation.navigation.tables import NOTES, tables
from lhdmap.evaluation.navigation.walls import WallRow
from lhdmap.names import name_of
from lhdmap.report import charts, markup, navigation_charts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_DRAWN = 20


class DrawnDrive(NamedTuple):
    """What is drawn of a drive."""

    row: Row
    samples: Samples
    walls: Sequence[WallRow]


def write_navigation_report(path: Path, title: str, drives: Sequence[DrawnDrive], rows: Sequence[Row]) -> None:
    """Write one self-contained page."""
    with charts.styled():
        parts = [*_tables(rows), markup.section("How to read them", "".join(map(markup.paragraph, NOTES)))]
        warnings = [f"{row.log}: {text}" for row in rows for text in (*row.warnings, row.problem) if text]
        parts.append(markup.section("Warnings", markup.listed(warnings, "warning")))
        parts += [_drive(drive) for drive in drives[:_MOST_DRAWN]]
    if len(drives) > _MOST_DRAWN:
        parts.append(markup.paragraph(f"{len(drives) - _MOST_DRAWN} more drives are in the tables, and not drawn."))
    path.write_text(markup.document(title, "".join(parts)), encoding="utf-8")


def _tables(rows: Sequence[Row]) -> Iterator[str]:
    for table in tables(rows):
        body = markup.table(table.heads, table.lines, numbers_from=4)
        yield markup.section(table.title, body)


def _drive(drive: DrawnDrive) -> str:
    samples = drive.samples
    if not len(samples.time_s):
        return ""
    told = (drive.row.operation, {"E": "empty", "L": "loaded"}.get(drive.row.load or ""), drive.row.heading)
    words = ", ".join(one for one in told if one)
    return markup.section(
        f"{name_of(Path(drive.row.log))}: {words}" if words else drive.row.log, "".join(_pictures(drive))
    )


def _pictures(drive: DrawnDrive) -> Iterator[str]:
    samples = drive.samples
    if _known(samples.speed_mps):
        yield _picture(navigation_charts.overview(samples), "Speed, mode and distance over time, as in Fig. 15.")
    if _known(samples.steering) or _known(samples.articulation_rad):
        yield _picture(navigation_charts.steering(samples), "Steering command and angle, as in Figs. 17 and 18.")
    if _known(samples.propel) or _known(samples.speed_mps):
        yield _picture(navigation_charts.propulsion(samples), "Propel command and speed, as in Figs. 19 and 20.")
    if drive.walls:
        caption = "Distances of the bodies' sides to the walls, at the height of the scanners."
        yield _picture(navigation_charts.beside(samples, drive.walls), caption)


def _known(values: np.ndarray) -> bool:
    return bool(np.isfinite(values).any())


def _picture(figure: Figure, caption: str) -> str:
    return markup.picture(charts.svg_uri(figure), caption)
