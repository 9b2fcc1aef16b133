"""A replay on a page: what happened, the way, figures over time, states, faults and what followed, the verdict."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lhdmap.report import (
    charts,
    haulage_section,
    loading_section,
    markup,
    mission_chart,
    replay_charts,
    replay_drive_charts,
)
from lhdmap.report.replay_data import DriveData, ReplayData, StopRow

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PLAN = "The way from above: what truly happened, and where perception believed the machine, placed at the true start."
DRIVE = (
    "The map that is driven on, the legs that navigation asked for, and each way of the leading axle that guidance predicted, "
    "drawn from where the machine truly was. Map and truth are laid over each other, for this picture alone, as they fit best."
)
PLACE = (
    "Place by localization less the true one, in the axes of the machine; map and truth are laid over each other as they fit best "
    "over the drive: errors of localization and of the map."
)
TIME = (
    "Speed, joint angle and clearance as they truly were; what was planned, predicted and commanded beside it. Stretches with a "
    "fault are shaded."
)
MISSION = (
    "The true way in the colours of the mission's phases, speed and phases under it (of a long run its first 15 minutes). "
    "A diamond is a place of the map."
)
STATES = (
    "States of the processes over time, from the journal; journal.jsonl has the cause and the figures of each change."
)
SIMULATED = "All of this is simulated: the figures are those of a model, not of a mine."
_MOST_ROWS = 200


def write_replay_report(path: Path, data: ReplayData) -> None:
    """Write one self-contained HTML page."""
    path.write_text(render(data), encoding="utf-8")


def render(data: ReplayData) -> str:
    """Return the page as text; all pictures are in it."""
    with charts.styled():
        pictures = list(_pictures(data))
    parts = [
        markup.section("What happened", markup.cards(_cards(data)) + markup.paragraph(SIMULATED)),
        markup.section("Warnings", markup.listed(data.warnings, "warning")),
        *pictures,
        markup.section("What navigation decided", _decided(data)),
        markup.section("Stops", _stops(data.stops)),
        markup.section("Machines", _machines(data.verdict)),
        markup.section("Docks", haulage_section.docks(data.verdict)),
        markup.section("Contacts", _contacts(data.verdict["contacts"])),
        markup.section("Faults and what followed", _faults(data.verdict["faults"])),
        markup.section("Where the time went", _phases(data.verdict)),
        markup.section("Verdict", _verdict(data.verdict)),
        markup.section("How it was made", _made(data)),
    ]
    return markup.document(data.title, "".join(parts))


def _cards(data: ReplayData) -> Iterator[tuple[str, str, str]]:
    """Yield name, value and meaning of the headline figures."""
    verdict = data.verdict
    yield "verdict", "ok" if verdict["ok"] else "not ok", str(verdict["reason"])
    yield "driven", f"{verdict['distance_m']:.1f} m", f"in {verdict['duration_s']:.1f} s of simulated time"
    fastest = f"mean of the whole run; at most {verdict['max_speed_kmh']:.1f} km/h"
    yield "speed", f"{verdict['mean_speed_kmh']:.1f} km/h", fastest
    wall = "the edge of its lane" if verdict["kind"] == "haulage" else "a wall"
    yield "contacts", str(len(verdict["contacts"])), f"of a body of the machine with {wall} or a thing"
    if verdict["min_clearance_m"] is not None:
        yield (
            "clearance",
            f"{verdict['min_clearance_m']:.2f} m",
            f"least distance of a body from {wall}, looked at each 0.1 s",
        )
    yield "stops", str(verdict["stops"]), "rests on the way, without those of start and end"
    yield "assistance", str(verdict["assists"]), f"requests; {verdict['assist_s']:.0f} s until they were answered"
    yield "faults", str(len(verdict["faults"])), "injected by the scenario"
    yield from haulage_section.cards(verdict)
    if "cycles" in verdict:
        yield "cycles", str(verdict["cycles"]), f"{verdict['tonnes']:.1f} t to the dump"
    elif verdict.get("fill") is not None:
        tries = f"after {verdict['attempts']} attempts, ± {verdict['fill_std']:.2f}; truly {verdict['fill_true']:.2f}"
        yield "fill", f"{verdict['fill']:.2f}", tries
    if data.drive is not None:
        yield from _drive_cards(data.drive)


def _drive_cards(drive: DriveData) -> Iterator[tuple[str, str, str]]:
    if len(drive.places):
        off_cm = 100.0 * np.hypot(drive.place("along_m"), drive.place("across_m"))
        most = f"of the place on the map, in 95 % of the time; at most {off_cm.max():.0f} cm"
        yield "error of the place", f"{np.percentile(off_cm, 95):.0f} cm", most
    shares = replay_drive_charts.limit_shares(drive)
    if shares:
        others = ", ".join(f"{name} {100.0 * share:.0f} %" for name, share in shares[1:])
        meaning = f"limits the speed in {100.0 * shares[0][1]:.0f} % of the plans" + (f"; {others}" if others else "")
        yield "slowed by", shares[0][0], meaning


def _pictures(data: ReplayData) -> Iterator[str]:
    if not len(data.rows):
        return
    if mission_chart.has_mission(data):
        yield markup.section("Mission", _picture(mission_chart.mission_chart(data), MISSION))
    words = PLAN if data.drive is None else f"{PLAN} {DRIVE}"
    yield markup.section("Way", _picture(replay_charts.plan_chart(data), words))
    yield markup.section("Over time", _picture(replay_charts.time_chart(data), TIME))
    if data.drive is not None and len(data.drive.places):
        chart = replay_drive_charts.place_chart(data.drive, data.verdict["duration_s"])
        yield markup.section("Place on the map", _picture(chart, PLACE))
    if data.load is not None:
        yield from loading_section.sections(data, data.load)
    if data.changes:
        yield markup.section("States", _picture(replay_charts.state_chart(data), STATES))


def _picture(figure: Figure, caption: str) -> str:
    return markup.picture(charts.svg_uri(figure), caption)


def _decided(data: ReplayData) -> str:
    changes = data.changes.get("navigation", ())[:_MOST_ROWS]
    rows = [(f"{1e-9 * (one.t_ns - data.start_ns):.2f}", one.state, one.cause) for one in changes]
    return markup.table(("time, s", "state", "why"), rows, numbers_from=0, numbers_to=1) if rows else ""


def _stops(stops: Sequence[StopRow]) -> str:
    rows = [
        (
            f"{one.from_s:.2f}",
            "the end" if one.to_s is None else f"{one.to_s:.2f}",
            f"{one.speed_kmh:.1f}",
            one.cause,
            one.said,
        )
        for one in stops[:_MOST_ROWS]
    ]
    head = ("from, s", "to, s", "speed before, km/h", "why, by the executor", "what watchdog and guard said")
    return markup.table(head, rows, numbers_from=0, numbers_to=3) if rows else ""


def _contacts(contacts: Sequence[Mapping[str, Any]]) -> str:
    rows = [
        (f"{one['t_s']:.2f}", one["body"], "{:.2f}, {:.2f}, {:.2f}".format(*one["point_m"]), f"{one['depth_m']:.3f}",
         f"{one['speed_kmh']:.1f}")
        for one in contacts[:_MOST_ROWS]
    ]  # fmt: skip
    return markup.table(("time, s", "body", "where, m", "depth, m", "speed, km/h"), rows) if rows else ""


def _faults(faults: Sequence[Mapping[str, Any]]) -> str:
    rows = [
        (
            "never" if one["began_s"] is None else f"{one['began_s']:.2f}",
            "the end" if one["ended_s"] is None else f"{one['ended_s']:.2f}",
            one["kind"],
            one["target"] or one["at"],
            "; ".join(map(_followed, one["followed"])) or "nothing that the journal knows",
        )
        for one in faults
    ]
    head = ("from, s", "to, s", "fault", "target or place", "what followed")
    return markup.table(head, rows, numbers_from=0, numbers_to=4) if rows else ""


def _followed(one: Mapping[str, Any]) -> str:
    return f"{one['after_s']:+.2f} s {one['process']}: {one['to'] or one['event']}"


def _machines(verdict: Mapping[str, Any]) -> str:
    """Return a table of the machines of a crew, and of sections that two of them were in; nothing where there is one."""
    rows = [
        (
            one["machine"],
            one["reason"],
            str(one["cycles"]),
            f"{one['tonnes']:.1f}",
            f"{one['distance_m']:.0f}",
            f"{one['time_by_phase_s'].get('traffic', 0.0):.1f}",
            str(one["contacts"]),
        )
        for one in verdict.get("machines", ())
    ]
    shared = verdict.get("sections_shared", ())
    told = [f"{one['t_s']:.1f} s: {' and '.join(one['machines'])} in section {one['section']}" for one in shared]
    words = "No section had two machines in it at any time, by the truth." if rows and not told else ""
    head = ("machine", "ended", "buckets", "mass, t", "driven, m", "waited for a section, s", "contacts")
    table = markup.table(head, rows, numbers_from=2) if rows else ""
    return table + (markup.paragraph(words) if words else "") + (markup.listed(told, "warning") if told else "")


def _phases(verdict: Mapping[str, Any]) -> str:
    by_phase = verdict.get("time_by_phase_s", {})
    whole_s = max(sum(by_phase.values()), 1e-9)
    rows = [(name, f"{s:.1f}", f"{100.0 * s / whole_s:.0f} %") for name, s in by_phase.items()]
    return markup.table(("phase", "seconds", "share"), rows, numbers_from=1) if rows else ""


def _verdict(verdict: Mapping[str, Any]) -> str:
    rows = [
        (key, _said(value))
        for key, value in verdict.items()
        if key not in ("contacts", "docks", "faults", "time_by_phase_s", "machines", "sections_shared")
    ]
    return markup.table(("figure of verdict.json", "value"), rows)


def _said(value: Any) -> str:
    if value is None:
        return "not looked at"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _made(data: ReplayData) -> str:
    parts = markup.table(("", ""), list(data.provenance.items())) if data.provenance else ""
    settings = html.escape(data.settings_text)
    return parts + (f"<details><summary>Scenario</summary><pre>{settings}</pre></details>\n" if settings else "")
