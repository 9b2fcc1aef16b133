"""Writes `evaluation/guidance.md`: `python -m tools.evaluate.guidance_page --planar A.json --printed B.json --replays FOLDER`.

Sections, and classes of the first table, of which no runs are given stay as they are on the page.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from tests.guidance.drawn_drives import Row

from tools.evaluate.bends import Bend, told
from tools.evaluate.guidance import summary

SOURCES = {
    "jinchuan": "a survey of a real drift",
    "edgar": "a real floor plan, twice its size",
    "narrow": "lhdmap: 0.10 m free at two pinches",
    "ring": "lhdmap",
}
RESULT = Path(__file__).resolve().parents[2] / "evaluation" / "guidance.md"
_HEAD = """# Guidance

Written by `python -m tools.evaluate.guidance_page` from runs of `tools.evaluate.guidance` (planar) and
`tools.evaluate.navigation` (replays); not edited by hand. c: least free room beside the bodies on the reference drive, measured.

## Guidance alone, planar

Winding tunnels of 70 m (180 m in the class R 12-40), bends of 20 to 90 degrees, walls rough by 0.10 m, one opening of 5 m. By
turns forward and in reverse, empty and loaded; pose noise 1 cm and 0.1 degrees, joint offset 0.5 degrees, steering gain
within 5 %, lags within 10 %, the route off by 0.15 m (1 sigma). Walls are known as points, there is no guard and no backing up:
a touch ends the run. In the opening and 4 m about it the route counts 30 times as much, as navigation has it in intersections;
"opening not known": it does not (the touch of c 0.15 turned into it, the worst of c 0.25 came nearest there). E at 10 Hz, commands
as shares of 24 km/h and 15 deg/s, km/h and degrees. Limit
{limit}.

{columns}
{planar}

"""
_COLUMNS = (
    "| class | runs | arrived | contacts | least room, median / worst, m | mean speed empty / loaded, km/h | top, km/h "
    "| ACD | ASD | field, solve and speeds, CPU ms median / worst p99 |\n"
    "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"
)
_BEFORE = """## An earlier state, planar

With a horizon of 3.6 s alone, a joint that turns where the machine stands, and clearances that are not smoothed, the
same tunnels gave (classes that are not in the table above were not driven again):

{columns}
{rows}

"""
_PRINTED = """## Guidance as printed (`guidance.method = "paper"`), planar

The same tunnels and errors; its speeds come from the default's profile, for nothing in its cost rewards progress.

{columns}
{rows}

"""
_BENDS = """## Bends that can be driven

By `python -m tools.evaluate.bends`. {told}

"""
_TOLERANCE = """## A machine other than its model

By `python -m tools.evaluate.guidance_tolerance`: a bend of 60 degrees and 8 m radius, c 0.25 m, with two walls.

| error | m |
| --- | --- |
{rows}

"""
_MINES = """## Replays in mines of surveys and plans

Taught by the operator, mapped and localized by this code, then driven ([mines](../docs/mines.md)).

| mine | from | verdict | contacts | least, m | way, m | mean, km/h | top | stops | assists |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
{rows}

"""
_REPLAYS = """## Replays: simulated sensors, odometry, localization on the own map

One mine a row pair, made to measure (`tools.evaluate.navigation`), taught once by the operator, then driven forward and in
reverse; 12 km/h is the limit of the map's tunnels. Room is what the simulator's bumper measures.

| class | measured c | direction | load, t | arrived | contacts | least, m | mean, km/h | top | back-ups | assists | ACD | ASD |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
{rows}

{sums}
"""


def main() -> int:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--planar", type=Path, nargs="+", default=[])
    parser.add_argument("--bends", type=Path, help="what `tools.evaluate.bends --json` wrote")
    parser.add_argument("--tolerance", type=Path, help="what `tools.evaluate.guidance_tolerance` wrote")
    parser.add_argument("--mines", nargs="+", metavar="NAME=RUN", default=[], help="run folders of replays, by mine")
    parser.add_argument("--printed", type=Path, nargs="+")
    parser.add_argument("--before", type=Path, help="runs of an earlier state, to be compared")
    parser.add_argument("--replays", type=Path)
    parser.add_argument(
        "--navigation", type=Path, help="what `lhdmap eval navigation RUN... --json` said of the replays"
    )
    asked = parser.parse_args()
    before = RESULT.read_text(encoding="utf-8") if RESULT.is_file() else ""
    text = _HEAD.format(
        columns=_COLUMNS,
        planar="\n".join(kept_rows(before, planar(asked.planar))),
        limit="10.1 km/h empty, 7.9 loaded; 20 and 18 in the last class",
    )
    if asked.before:
        text += _BEFORE.format(columns=_COLUMNS, rows="\n".join(planar([asked.before])))
    if asked.printed:
        text += _PRINTED.format(columns=_COLUMNS, rows="\n".join(planar(asked.printed)))
    if asked.replays:
        rows = replayed(asked.replays)
        smooth = smoothness(asked.navigation) if asked.navigation else {}
        lines = [line(row, smooth.get(Path(row["folder"]).parent.name + Path(row["folder"]).name)) for row in rows]
        text += _REPLAYS.format(rows="\n".join(lines), sums="\n".join(sums(rows)))
    if asked.bends:
        text += _BENDS.format(told=told([Bend(**one) for one in json.loads(asked.bends.read_text())]))
    if asked.tolerance:
        figures = json.loads(asked.tolerance.read_text()).items()
        rows_of = [f"| {name} | {', '.join(f'{one:.3f}' for one in values)} |" for name, values in figures]
        text += _TOLERANCE.format(rows="\n".join(rows_of))
    if asked.mines:
        text += _MINES.format(rows="\n".join(mine_line(*one.split("=", 1)) for one in asked.mines))
    text = with_kept(text, before)
    RESULT.write_text(text.rstrip() + "\n", encoding="utf-8")
    return 0


def kept_rows(page: str, rows: list[str]) -> list[str]:
    """Return the rows of the first table: new ones, and those of a page whose class was not run."""
    table = page.partition("\n## ")[2].partition("\n## ")[0]
    old = [line for line in table.splitlines() if line.startswith("| c ")]
    return [*rows, *(line for line in old if line.split("|")[1] not in {one.split("|")[1] for one in rows})]


def with_kept(text: str, page: str) -> str:
    """Return a text with the sections of a page that it lacks."""
    new, old = sections(text), sections(page)
    return "\n".join(
        body.rstrip() + "\n" for body in (old | new if set(old) >= set(new) else new | (old | new)).values()
    )


def sections(text: str) -> dict[str, str]:
    """Return the parts of a page by their headings."""
    parts = [("## " if k else "") + part for k, part in enumerate(text.split("\n## "))] if text else []
    return {part.partition("\n")[0]: part for part in parts}


def mine_line(name: str, folder: str) -> str:
    """Return the table's line of a replay."""
    verdict, source = json.loads((Path(folder) / "verdict.json").read_text()), SOURCES.get(name, "")
    return (
        f"| `{name}` | {source} | {'arrived' if verdict['ok'] else verdict['reason']} | {len(verdict['contacts'])} "
        f"| {verdict['min_clearance_m']:.2f} | {verdict['distance_m']:.0f} | {verdict['mean_speed_kmh']:.1f} "
        f"| {verdict['max_speed_kmh']:.1f} | {verdict['stops']} | {verdict['assists']} |"
    )


def planar(files: list[Path]) -> list[str]:
    """Return a line for each class of all files."""
    every: dict[str, list[Row]] = {}
    for file in files:
        for name, rows in json.loads(file.read_text()).items():
            every.setdefault(name, []).extend(Row(**row) for row in rows)
    return [summary(name, rows) for name, rows in every.items()]


def replayed(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of all runs, by class and tunnel."""
    rows = [row for file in sorted(folder.glob("rows_*.json")) for row in json.loads(file.read_text())]
    return sorted(rows, key=lambda row: (row["class"], row["tunnel"], row["reverse"]))


def smoothness(file: Path) -> dict[str, tuple[float, float]]:
    """Return ACD and ASD of each run, by the names of its folders."""
    told = json.loads(file.read_text())
    return {"".join(Path(row["log"]).parts[-2:]): (row["acd"], row["asd"]) for row in told["rows"]}


def line(row: dict[str, Any], smooth: tuple[float, float] | None) -> str:
    """Return the table's line of a run."""
    acd, asd = ("", "") if smooth is None else (f"{smooth[0]:.5f}", f"{smooth[1]:.4f}")
    return (
        f"| {row['class']} | {row['room_m']:.3f} | {'reverse' if row['reverse'] else 'forward'} | {row['load_t']:.0f} "
        f"| {'yes' if row['arrived'] else 'no: ' + row['reason']} | {row['contacts']} | {row['min_clearance_m']:.3f} "
        f"| {row['mean_speed_kmh']:.2f} | {row['max_speed_kmh']:.1f} | {row['back_ups']} | {row['assists']} | {acd} | {asd} |"
    )


def sums(rows: list[dict[str, Any]]) -> list[str]:
    """Return a line for each class."""
    lines = []
    for kind in sorted({row["class"] for row in rows}):
        of = [row for row in rows if row["class"] == kind]
        least = [row["min_clearance_m"] for row in of]
        lines.append(
            f"- {kind}: {sum(row['arrived'] for row in of)} of {len(of)} arrived, {sum(row['contacts'] for row in of)} contacts, "
            f"least room {np.median(least):.3f} m (median), {min(least):.3f} m (worst), mean speed "
            f"{np.mean([row['mean_speed_kmh'] for row in of if row['arrived']]):.2f} km/h."
        )
    return lines


if __name__ == "__main__":
    raise SystemExit(main())
