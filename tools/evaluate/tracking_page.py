"""Writes `evaluation/tracking.md` and its figures: `python -m tools.evaluate.tracking_page --json FOLDER`."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from tools.evaluate.tracking_figures import draw_docks, draw_site

Row = dict[str, Any]
EVALUATION = Path(__file__).resolve().parents[2] / "evaluation"
_LOST_M = 5.0

_HEAD = """# Path tracking of both bodies, docking

Written by `python -m tools.evaluate.tracking_page` from runs of `tools.evaluate.tracking`; not edited by hand.

The machine is kinematic with slip: no tyres, no roll, no grade. Both axles drift outward by 0.12 rad per g. Noise as in the
prototype: pose of the front axle 5 cm and 0.3 degrees, joint 0.3 degrees and 0.5 degrees of offset, white, at 20 Hz. Models from
`pipelines/machines/truck_28t.toml` and `lhd_11t.toml` (dead time 0.2 and 0.25 s, lag of the joint 0.15 and 0.2 s, lag of the drive
0.5 s); the loader is driven at 30 km/h too, beyond its top speed. All figures are against the exact path, in metres, from above
1 km/h on; offsets of both axles to the left are positive. RMS: mean of the seeds; maximum: worst of them.
"""


_TEXTS = {
    "turns": """## A turn of 90 degrees: z0 + z1, RMS / maximum

R = max(12 m, v2 / 1.2), clothoids of 8 m (of 2 s where that is more) or a step of curvature, waypoints each metre. `both`: the
default, five seeds; `circles`: the corrected law and the filter, Eq. (10) at local circles; `paper`: Section 2.4 as printed.
Negative: in reverse. Targets: 0.05 / 0.15 to 10 km/h, 0.09 / 0.30 to 30 km/h, 0.04 / 0.12 in reverse. lost: an axle 5 m off.
""",
    "overshoots": """## Overshoot of the joint on a step of curvature

Against Eq. (10), without noise and slip. Targets: 12 % to 10 km/h, 20 % to 30 km/h.
""",
    "sites": """## The paper's site

424 m, two junctions of R 12 m, bends of R 60 and R 80 m; 30 (truck) and 20 km/h (loader). Targets: truck 0.09 / 0.30, loader
0.07 / 0.25, both bodies within the lane: half a lane of 2.0 m holds both.
""",
    "dead_times": """## A dead time that is off

Target: off by 0.1 s, RMS of 0.15 at most.
""",
    "disturbed": """## Disturbances
""",
    "recoveries": """## Back to the path

Starts at speed beside a straight line: offset (m), heading, joint (degrees). Way until |z0 + z1| stays below 0.4 m, and the
largest |z1|. A clip of 10 m is none.
""",
    "scattered": """## Docking in reverse, the start scattered

One way (a quarter turn at twice the least radius, 6 m straight, 1.2 m/s) from starts off by up to 1 m in x and in y, 8 degrees,
joint 4 degrees. Target: all within 0.10 m and 1 degree.
""",
    "anywhere": """## Docking from anywhere on an apron

Starts and headings drawn evenly where both bodies fit, the dock in the middle of the far side, 0.4 m of margin. The first of
each row are driven, too. Targets: one cusp at most in 98 % on 45 x 40 m, three on 35 x 24 m.
""",
}


def main() -> int:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, required=True)
    folder = parser.parse_args().json
    read = {file.stem: json.loads(file.read_text()) for file in folder.glob("*.json")}
    sections: dict[str, Callable[[list[Row]], str]] = {
        "turns": turns, "overshoots": overshoots, "sites": sites, "dead_times": dead_times, "disturbed": disturbed,
        "recoveries": recoveries, "scattered": scattered, "anywhere": anywhere,
    }  # fmt: skip
    text = [_HEAD, *(f"{_TEXTS[name]}\n{section(read[name])}" for name, section in sections.items() if name in read)]
    if "sites" in read:
        draw_site(EVALUATION / "img" / "tracking_site.png")
    if "anywhere" in read:
        draw_docks(read["anywhere"], EVALUATION / "img" / "tracking_docks.png")
    (EVALUATION / "tracking.md").write_text("\n".join(text).rstrip() + "\n", encoding="utf-8")
    return 0


def table(head: str, lines: Iterable[str]) -> str:
    """A table: its head, cells apart by |, and its lines."""
    columns = head.count("|") + 1
    return (
        "\n".join([f"| {head} |", "| " + " | ".join(["---"] * columns) + " |", *(f"| {one} |" for one in lines)]) + "\n"
    )


def grouped(rows: list[Row], *keys: str) -> dict[tuple[Any, ...], list[Row]]:
    """Rows by the values of keys, in the order in which they come."""
    found: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        found.setdefault(tuple(row[key] for key in keys), []).append(row)
    return found


def cell(rows: list[Row]) -> str:
    """RMS and maximum, or that the path was lost."""
    if not rows:
        return ""
    if any(not row.get("arrived") or max(row["z0"], row["z1"]) > _LOST_M for row in rows):
        return "lost"
    return f"{np.mean([row['rms'] for row in rows]):.3f} / {max(row['max'] for row in rows):.2f}"


def turns(rows: list[Row]) -> str:
    speeds = list(dict.fromkeys(row["kmh"] for row in rows))
    lines = []
    for (name, method, step), found in grouped(rows, "machine", "method", "step").items():
        cells = [cell([row for row in found if row["kmh"] == speed]) for speed in speeds]
        lines.append(" | ".join([f"{name}, {method}, {'steps' if step else 'clothoids'}", *cells]))
    both = grouped([row for row in rows if row["method"] == "both"], "machine")
    halves = [
        (name, part)
        for (name,), found in both.items()
        for part in ([r for r in found if abs(r["kmh"]) <= 10], [r for r in found if abs(r["kmh"]) > 10])
    ]
    own = [
        f"{name} {max(r['z0'] for r in part):.2f} / {max(r['z1'] for r in part):.2f} m" for name, part in halves if part
    ]
    return table("machine, method, path | " + _kmh(speeds), lines) + (
        f"\nOwn offsets of `both`, largest |z0| / |z1|, to 10 km/h, then above: {', '.join(own)}\n"
        "(z0 + z1 = 0 leaves the truck's axles 0.16 m off at R 12 m).\n"
    )


def _kmh(speeds: list[int]) -> str:
    return " | ".join(f"{speed} km/h" for speed in speeds)


def overshoots(rows: list[Row]) -> str:
    speeds = list(dict.fromkeys(row["kmh"] for row in rows))
    lines = []
    for (name, method), found in grouped(rows, "machine", "method").items():
        cells = [f"{100 * row['over']:.0f} %" for row in found]
        lines.append(" | ".join([f"{name}, {method}", *cells]))
    return table("machine, method | " + _kmh(speeds), lines)


def sites(rows: list[Row]) -> str:
    lines = []
    for (name, method, way), found in grouped(rows, "machine", "method", "way").items():
        own = f"{max(r['z0'] for r in found):.2f} / {max(r['z1'] for r in found):.2f}"
        lane, top = max(r["half_lane_m"] for r in found), max(r["top_kmh"] for r in found)
        lines.append(f"{name} | {method} | {way} | {len(found)} | {cell(found)} | {own} | {lane:.2f} | {top:.0f}")
    head = "machine | method | way | runs | z0 + z1 | own offsets | half lane used, m | top, km/h"
    return table(head, lines) + "\n![z0 + z1 along the site](img/tracking_site.png)\n"


def dead_times(rows: list[Row]) -> str:
    speeds = list(dict.fromkeys(row["kmh"] for row in rows))
    lines = [
        " | ".join([name, f"{off:+.1f} s", *(cell([r for r in found if r["kmh"] == speed]) for speed in speeds)])
        for (name, off), found in grouped(rows, "machine", "off").items()
    ]
    return table("machine | real less believed | " + _kmh(speeds), lines)


def disturbed(rows: list[Row]) -> str:
    speeds = list(dict.fromkeys(row["kmh"] for row in rows))
    lines = [
        " | ".join([name, kind, *(cell([r for r in found if r["kmh"] == speed]) for speed in speeds)])
        for (name, kind), found in grouped(rows, "machine", "kind").items()
    ]
    return table("machine | what | " + _kmh(speeds), lines)


def recoveries(rows: list[Row]) -> str:
    lines = []
    for (name, kmh, clip), found in grouped(rows, "machine", "kmh", "clip_m").items():
        cells = [
            f"{r['after_m']:.0f} m ({r['widest_m']:.1f})" if r["arrived"] else f"lost ({r['widest_m']:.1f})"
            for r in found
        ]
        lines.append(" | ".join([name, str(kmh), f"{clip:g} m", *cells]))
    starts = list(dict.fromkeys(tuple(row["start"]) for row in rows))
    return table("machine | km/h | clip | " + " | ".join(f"{a:g}, {b:g}, {c:g}" for a, b, c in starts), lines)


_DOCKED = "within 0.10 m, 1 deg | off, m, 95 % / worst | off, deg, 95 % / worst | stayed on the apron"


def _docked(found: list[Row]) -> str:
    done = [row for row in found if "off_m" in row]
    good = [row for row in done if row["arrived"] and row["off_m"] <= 0.10 and row["off_deg"] <= 1.0]
    cells = [f"{len(good)} of {len(done)}"]
    for key in ("off_m", "off_deg"):
        values = [row[key] for row in done]
        cells.append(f"{np.percentile(values, 95):.3f} / {max(values):.3f}")
    return " | ".join([*cells, str(sum(row["in_room"] for row in done))])


def scattered(rows: list[Row]) -> str:
    lines = [f"{name} | {_docked(found)}" for (name,), found in grouped(rows, "machine").items()]
    return table(f"machine | {_DOCKED}", lines)


def anywhere(rows: list[Row]) -> str:
    lines, reasons = [], set()
    for (name, kind), found in grouped(rows, "machine", "apron").items():
        ways = [row for row in found if not row["reason"]]
        reasons |= {row["reason"].split(":")[0] for row in found if row["reason"]}
        cusps = " / ".join(str(sum(row["cusps"] == k for row in ways)) for k in range(4))
        radii, work = [row["radius_m"] for row in ways], [row["plan_s"] for row in found]
        cells = [
            name,
            kind,
            str(len(found)),
            cusps,
            str(len(found) - len(ways)),
            f"{min(radii):.1f} to {max(radii):.1f}",
        ]
        lines.append(" | ".join([*cells, f"{np.median(work):.2f} / {max(work):.1f}", _docked(found)]))
    head = "machine | apron, m | starts | cusps 0 / 1 / 2 / 3 | no way | radius, m | work, s, median / most"
    said = f"\nNo way, as it is said before anything moves: {'; '.join(sorted(reasons))}.\n" if reasons else ""
    return table(f"{head} | driven: {_DOCKED}", lines) + said + "\n![Ways to docks](img/tracking_docks.png)\n"


if __name__ == "__main__":
    raise SystemExit(main())
