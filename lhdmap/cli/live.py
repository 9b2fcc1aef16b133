"""`lhdmap live SOURCE`: follow a running machine; what `build-map` or `localize` would do, while it drives."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_output, add_settings, add_topics, topic_overrides

if TYPE_CHECKING:
    from lhdmap.live.watch import Status

_TERMINAL_S, _LINES_S = 0.5, 10.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap live`."""
    parser.add_argument(
        "source",
        metavar="SOURCE",
        help="a growing MCAP file (path or mcap:FILE), foxglove:ws://HOST:8765, zenoh:tcp/HOST:7447, dds:DOMAIN",
    )
    parser.add_argument("--map", type=Path, metavar="MAP", help="localize on this map instead of building one")
    add_output(parser, "folder to make: log.mcap, and map/ or localization/ (default: live_DATE_TIME here)", "RUN")
    add_settings(parser)
    add_topics(parser)
    parser.add_argument("--machine", type=Path, metavar="FILE.toml", help="machine description")
    parser.add_argument(
        "--start", metavar="X,Y,DEG|NAME", help="with --map: about where the machine is (default: it is searched for)"
    )
    parser.add_argument(
        "--for",
        dest="for_s",
        type=float,
        metavar="SECONDS",
        help="end after this time (default: when the source ends, or with Ctrl-C)",
    )
    parser.add_argument(
        "--quiet-end",
        type=float,
        metavar="SECONDS",
        help="a file that has not grown for so long has ended (default: 30)",
    )
    parser.add_argument("--view", action="store_true", help="follow it in Rerun: a window, or a page without a display")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Follow the source and print what came of it."""
    from lhdmap.cli.following import free_port, viewer_of
    from lhdmap.config import load_settings
    from lhdmap.errors import UsageError
    from lhdmap.live.addresses import source_of
    from lhdmap.live.run import LiveRequest, live
    from lhdmap.machine import load_machine

    for name, value in (("--for", arguments.for_s), ("--quiet-end", arguments.quiet_end)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise UsageError(f"{name} {value:g}: seconds above 0 were wanted")
    if arguments.start and arguments.map is None:
        raise UsageError("--start is a place on a map: --map was wanted beside it")
    port = free_port() if arguments.view else None
    interval_s, show = _shower(console)
    request = LiveRequest(
        source_of(arguments.source, arguments.quiet_end),
        arguments.output or _default_target(),
        arguments.map,
        load_settings(arguments.config, arguments.set),
        topic_overrides(arguments.topic),
        load_machine(arguments.machine) if arguments.machine else None,
        _start(arguments.start, arguments.map),
        for_s=arguments.for_s,
        force=arguments.force,
        helper=True,
        live_port=port,
        interval_s=interval_s,
        show=show,
        say=console.note,
    )
    with viewer_of(port, console):
        result = live(request)
    for text in result.warnings:
        console.warn(text)
    console.result(result.summary | {"warnings": result.warnings}, _text(result.summary))
    return 0


def status_text(now: Status) -> str:
    """Return a status in one line."""
    parts = [f"{now.elapsed_s:7.1f} s"]
    if now.pose is None:
        parts.append("no pose yet")
    else:
        x, y, z, heading = now.pose
        parts.append(f"{now.frame} {x:.2f} {y:.2f} {z:.2f} m {math.degrees(heading):.1f}°")
        parts.append(f"{now.distance_m:.1f} m driven")
    parts += [now.place] if now.place else []
    parts.append(f"{now.scans} scans, {100 * now.weak_share:.0f} % weak" + (" (now)" if now.weak else ""))
    parts += [f"pile {now.pile}"] if now.pile else []
    counts = (
        (now.lost_stretches, "lost"),
        (now.waiting, "waiting"),
        (now.dropped, "dropped"),
        (now.missed, "missed"),
        (now.gaps, "gaps"),
        (now.reconnects, "reconnects"),
    )
    parts += [f"{count} {word}" for count, word in counts if count]
    parts += [] if math.isnan(now.latency_ms) else [f"{now.latency_ms:.0f} ms late"]
    return " | ".join(parts)


def _shower(console: Console) -> tuple[float, Callable[[Any], None]]:
    """Return at which interval the status is shown, and what shows it: one line that changes, or plain lines."""
    terminal = sys.stderr.isatty()
    return (_TERMINAL_S if terminal else _LINES_S), lambda now: console.status(status_text(now), terminal=terminal)


def _default_target() -> Path:
    import datetime as dt

    return Path(dt.datetime.now().astimezone().strftime("live_%Y%m%d_%H%M%S"))


def _start(text: str | None, folder: Path | None) -> Any:
    from lhdmap.cli.localize import start_on

    return None if text is None or folder is None else start_on(text, folder)


def _text(summary: dict[str, Any]) -> str:
    stream = summary["stream"]
    late = stream["latency"]["pose"]
    lost = f"{sum(stream['dropped'].values())} dropped, {sum(stream['missed'].values())} missed, {stream['gaps']} gaps"
    lines = [
        f"run          {summary['run']}",
        f"log          {summary['log']}: {stream['messages']} messages, {stream['bytes'] / 1e6:.1f} MB",
        f"stream       {lost}, {stream['reconnects']} reconnects, {stream['clock_steps']} clock steps",
    ]
    if late["count"]:
        lines.append(f"pose late by {late['median_ms']:.1f} ms median, {late['p99_ms']:.1f} ms of 99 %")
    if "map" in summary:
        seen = f"{summary['scans']} scans, {100 * summary['degenerate_share']:.0f} % weak"
        pile = summary["pile"] or "not looked for"
        lines += [
            f"map          {summary['map']}",
            f"drive        {summary['distance_m']:.1f} m, {seen}, pile {pile}",
        ]
    else:
        lines += [
            f"places       {summary['localization']}",
            f"tracked      {100 * summary['tracking_share']:.1f} % of {summary['scans']} scans",
        ]
    return "\n".join(lines)
