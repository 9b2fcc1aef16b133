"""A shift of one machine with perception in the loop, and what its log is good for: `evaluation/shift.md`.

    python -m tools.evaluate.shift run [SCENARIO] -o RUN [--buckets N] [--map MAP]       # the shift; memory and time on the way
    python -m tools.evaluate.shift log RUN MAP                                           # doctor, build-map, localize, batch
    python -m tools.evaluate.shift page LINES… -o evaluation/shift.md [--run RUN]

`run` and `log` print JSON lines, `page` makes the page of them.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from lhdmap.logs.source import LogSource
from lhdmap.pipeline.production_run import production_of_runs
from lhdmap.replay.run import LOG, ReplayRequest, replay
from lhdmap.replay.scenario import find_scenario, load_scenario
from lhdmap.report import charts
from lhdmap.report.production_charts import cycle_chart
from lhdmap.simulation.history import SECOND_NS, START_NS

EVERY_S = 300.0
PICTURE = Path(__file__).resolve().parents[2] / "docs" / "img" / "shift_cycles.png"


def run(words: argparse.Namespace) -> None:
    """Run the shift."""
    path = find_scenario(words.scenario)
    told = load_scenario(path)
    if words.buckets:
        told = replace(told, mission=tuple(replace(one, buckets=words.buckets) for one in told.mission))
    if words.map:
        told = replace(told, map=str(words.map))
    verdict = replay(
        ReplayRequest(told, words.output, path.stem, force=True, sources=[path], progress=_watched)
    ).verdict
    production = production_of_runs([words.output])
    values = production.values() | {"pace": production.pace, "calendar_s": 1e-9 * production.stack.calendar_ns}
    usage = resource.getrusage(resource.RUSAGE_SELF)
    verdict |= {"contacts": len(verdict["contacts"]), "cpu_s": usage.ru_utime + usage.ru_stime}
    _say({"shift": path.stem, "buckets": words.buckets, "verdict": verdict, "production": values})


def _watched(moments: Iterable[int], _: float) -> Iterator[int]:
    """Yield the moments; say each five simulated minutes what memory and time it has taken."""
    began, told_s = time.process_time(), -EVERY_S
    for now_ns in moments:
        at_s = (now_ns - START_NS) / SECOND_NS
        if at_s - told_s >= EVERY_S:
            told_s = at_s
            _say({"at_s": round(at_s), "cpu_s": round(time.process_time() - began, 1), "rss_mib": round(_rss_mib())})
        yield now_ns


def _rss_mib() -> float:
    """Return the memory that this process has in RAM now."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1024.0**2


def log(words: argparse.Namespace) -> None:
    """Let the other commands read the log of a shift."""
    part = words.run / LOG
    with LogSource([part]) as source:
        minutes = round(source.duration_s / 60.0, 1)
    with tempfile.TemporaryDirectory() as folder:
        for name, command in _commands(part, words.map, Path(folder)).items():
            began = time.monotonic()
            code, cpu_s, peak_mib = _measured(command)
            wall_s = round(time.monotonic() - began, 1)
            _say(
                {
                    "command": name,
                    "minutes": minutes,
                    "code": code,
                    "wall_s": wall_s,
                    "cpu_s": cpu_s,
                    "peak_mib": peak_mib,
                }
            )


def _commands(part: Path, known: Path, work: Path) -> dict[str, list[str]]:
    manifest = work / "batch.csv"
    manifest.write_text(f"log\n{part.resolve()}\n", encoding="utf-8")
    return {
        "doctor": ["doctor", str(part)],
        "build-map": ["build-map", str(part), "-o", str(work / "map")],
        "localize": ["localize", str(part), "--map", str(known), "-o", str(work / "where")],
        "batch": ["batch", str(manifest), "-o", str(work / "batch"), "--jobs", "1"],
        "eval navigation": ["eval", "navigation", str(part), "-o", str(work / "navigation")],
        "eval loading": ["eval", "loading", str(part.parent), "-o", str(work / "loading")],
    }


def _measured(words: list[str]) -> tuple[int, float, int]:
    """Return exit code, CPU time (s) and the most memory (MiB) at a time of a command with all processes that it starts."""
    program = [sys.executable, "-m", "lhdmap", *words, "--quiet"]
    process = subprocess.Popen(program, stdout=subprocess.DEVNULL, start_new_session=True)
    most, ended = 0.0, 0
    while not ended:
        most = max(most, _group_mib(process.pid))
        time.sleep(0.2)
        ended, status, usage = os.wait4(process.pid, os.WNOHANG)
    return os.waitstatus_to_exitcode(status), round(usage.ru_utime + usage.ru_stime, 1), round(most)


def _group_mib(leader: int) -> float:
    """Return the memory of all processes of a group, MiB."""
    pages = 0
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text(encoding="utf-8").rpartition(")")[2].split()
        except OSError:
            continue  # it has ended meanwhile
        pages += int(fields[21]) if int(fields[2]) == leader else 0
    return pages * os.sysconf("SC_PAGE_SIZE") / 1024.0**2


def page(words: argparse.Namespace) -> None:
    """Write the page of the lines that `run` and `log` have printed."""
    texts = [line for path in words.lines for line in path.read_text(encoding="utf-8").splitlines()]
    lines = [json.loads(one) for one in texts if one.startswith("{")]
    shifts = [one for one in lines if "shift" in one]
    parts = [
        "# Shifts",
        "Written by `tools/evaluate/shift.py`. One loader, perception in the loop, simulated; the map is of a teaching drive.",
        "## What came of them",
        _table(["", *(f"{one['shift']}, {one['buckets'] or 'all'} buckets" for one in shifts)], _shift_rows(shifts)),
        "Pace: buckets by those that the productive time would have been enough for at the mean productive time of a cycle.",
        "## Memory and CPU time on the way",
        _table(
            ["simulated, s", "CPU time, s", "memory, MiB"],
            [[one["at_s"], one["cpu_s"], one["rss_mib"]] for one in lines if "rss_mib" in one],
        ),
        "## The log of a shift in the other commands",
        _table(
            ["command", "log, min", "exit code", "CPU time, s", "a minute of log, s", "memory, MiB"],
            _command_rows(lines),
        ),
        "CPU time and memory are those of all processes of a command; each one begins with some 5 s of loading the program.",
    ]
    words.output.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    if words.run:
        with charts.styled():
            charts.write_figure(cycle_chart(production_of_runs([words.run])), PICTURE, "png")


def _command_rows(lines: list[dict[str, Any]]) -> list[list[Any]]:
    rows = [one for one in lines if "command" in one]
    rows.sort(key=lambda one: (one["command"], one["minutes"]))
    names = ("command", "minutes", "code", "cpu_s")
    return [[*(one[name] for name in names), f"{one['cpu_s'] / one['minutes']:.2f}", one["peak_mib"]] for one in rows]


def _shift_rows(shifts: list[dict[str, Any]]) -> list[list[Any]]:
    """Return a row a figure, a column a shift."""
    told: dict[str, Any] = {
        "ended": lambda v, _: v["reason"],
        "simulated time": lambda v, _: f"{v['duration_s'] / 60.0:.1f} min",
        "buckets, tonnes, t/h": lambda _, p: f"{p['cycles']}, {p['tonnes']:.0f}, {p['tonnes_per_hour']:.0f}",
        "cycle, mean and deviation": lambda _, p: f"{p['cycle_mean_s']:.0f} s, {p['cycle_std_s']:.0f} s",
        "fill, attempts": lambda _, p: f"{p['fill_mean']:.2f}, {p['attempts_mean']:.2f}",
        "buckets by pace (wanted 0.95)": lambda _, p: f"{p['pace']:.3f}",
        "contacts, least clearance": lambda v, _: f"{v['contacts']}, {v['min_clearance_m']:.2f} m",
        "requests, for 100 buckets (wanted 2)": lambda v, _: (
            f"{v['assists']}, {100 * v['assists'] / max(v['cycles'], 1):.1f}"
        ),
        "classes of time less the calendar": lambda _, p: f"{sum(p['usage_s'].values()) - p['calendar_s']:.3f} s",
        "time by class": lambda _, p: "; ".join(f"{name} {s:.0f} s" for name, s in p["usage_s"].items() if s),
        "time by phase": lambda _, p: "; ".join(f"{name} {s:.0f} s" for name, s in p["time_by_phase_s"].items()),
        "simulated time by CPU time (wanted 5)": lambda v, _: f"{v['duration_s'] / v['cpu_s']:.1f}",
        "by the clock, on a machine that others used": lambda v, _: f"{v['realtime_factor']:.1f}",
    }
    return [[name, *(figure(one["verdict"], one["production"]) for one in shifts)] for name, figure in told.items()]


def _table(head: list[str], rows: list[list[Any]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(str(cell) for cell in line)} |" for line in lines)


def _say(line: dict[str, Any]) -> None:
    print(json.dumps(line), flush=True)


def main() -> None:
    """Run, read or tell."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    one = commands.add_parser("run")
    one.add_argument("scenario", nargs="?", default="shift_ring")
    one.add_argument("-o", "--output", type=Path, required=True)
    one.add_argument("--buckets", type=int, default=0, help="instead of those of the scenario")
    one.add_argument("--map", type=Path, help="a map of the mine that is there already")
    one.set_defaults(does=run)
    one = commands.add_parser("log")
    one.add_argument("run", type=Path)
    one.add_argument("map", type=Path)
    one.set_defaults(does=log)
    one = commands.add_parser("page")
    one.add_argument("lines", nargs="+", type=Path)
    one.add_argument("--run", type=Path, help="a shift whose cycles are drawn for docs/cycle.md")
    one.add_argument("-o", "--output", type=Path, required=True)
    one.set_defaults(does=page)
    words = parser.parse_args()
    words.does(words)


if __name__ == "__main__":
    main()
