"""Rows of a table of figures: what was wanted, what was measured, whether that is enough; written as Markdown and JSON."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure: `ok` is None where there is no target."""

    group: str
    name: str
    measured: float
    unit: str
    target: float | None = None
    note: str = ""

    @property
    def ok(self) -> bool | None:
        """Return whether the measured value is at or under the target."""
        return None if self.target is None else bool(self.measured <= self.target)


def write(path: Path, heading: str, figures: Iterable[Figure]) -> None:
    """Write `path` (.md) and the same as .json beside it."""
    rows = list(figures)
    lines = [heading.strip(), ""]
    for group in dict.fromkeys(row.group for row in rows):
        lines += [f"## {group}", "", "| | measured | target | ok | |", "| --- | --- | --- | --- | --- |"]
        lines += [_line(row) for row in rows if row.group == group]
        lines.append("")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines), encoding="utf-8")
    table = [asdict(row) | {"ok": row.ok} for row in rows]
    path.with_suffix(".json").write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")


def number(value: float) -> str:
    """Return a value with three or four significant digits, plainly."""
    digits = (
        0 if abs(value) >= 1000 else 1 if abs(value) >= 100 else 2 if abs(value) >= 10 else 3 if abs(value) >= 1 else 4
    )
    return f"{value:.{digits}f}" if abs(value) >= 0.001 or value == 0 else f"{value:.5f}"


def _line(row: Figure) -> str:
    verdict = {None: "", True: "yes", False: "**no**"}[row.ok]
    target = "" if row.target is None else f"≤ {row.target:g}"
    return f"| {row.name} | {number(row.measured)} {row.unit} | {target} | {verdict} | {row.note} |"
