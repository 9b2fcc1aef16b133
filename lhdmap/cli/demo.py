"""`lhdmap demo`: the sample drive from end to end, and one cycle of a machine in a mine, without any input."""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lhdmap.cli.build_map import progress_of
from lhdmap.cli.console import Console
from lhdmap.cli.options import add_output, add_settings
from lhdmap.cli.replay import progress_of as replay_progress_of
from lhdmap.errors import EvaluationShortfall
from lhdmap.outputs import free_folder

if TYPE_CHECKING:
    from lhdmap.messages import Record
    from lhdmap.replay.demo import Demo

FIRST_RUN = "the first run compiles the inner loops: up to a minute more than the next ones"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap demo`."""
    add_output(parser, "folder to make (default: lhdmap_demo here)")
    add_settings(parser)


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Simulate, map, evaluate, teach, work; say where everything is. Exit code 1 where the cycle is not ok."""
    from lhdmap.config import load_settings
    from lhdmap.replay.demo import Watcher, run_demo

    started = time.monotonic()
    settings = load_settings(arguments.config, arguments.set)
    watcher = Watcher(console.note, _simulation_progress(console), progress_of(console), replay_progress_of(console))
    target = arguments.output or Path("lhdmap_demo")
    free_folder(target, force=arguments.force)
    console.note(FIRST_RUN)
    demo = run_demo(target, settings, watcher, force=arguments.force)
    for text in demo.built.warnings:
        console.warn(text)
    wall_s = time.monotonic() - started
    verdict = demo.cycle.verdict
    failure = None if verdict["ok"] else EvaluationShortfall(f"the cycle is not ok: {verdict['reason']}")
    console.result(demo_values(demo, wall_s), demo_text(demo, wall_s), failure=failure)
    return 0 if failure is None else failure.exit_code


def demo_values(demo: Demo, wall_s: float) -> dict[str, Any]:
    """Return what `--json` prints."""
    return {
        "folder": str(demo.folder),
        "log": str(demo.drive.log),
        "truth": str(demo.drive.truth_file),
        "map": demo.built.summary | {"warnings": demo.built.warnings},
        "report": str(demo.built.folder / "report.html"),
        "recording": str(demo.built.folder / "recording.rrd"),
        "evaluation": demo.evaluation.to_json(),
        "cycle": {"run": str(demo.cycle.folder), "picture": str(demo.picture)} | demo.cycle.verdict,
        "wall_s": wall_s,
    }


def demo_text(demo: Demo, wall_s: float) -> str:
    """Return the result for a person: what was made, how good it is, where it is, what to do with it."""
    found, built = demo.evaluation, demo.built
    program = "lhdmap" if shutil.which("lhdmap") else sys.argv[0]
    ten = next((s for s in found.segments if s.length_m == 10.0 and s.n), None)
    segments = f"; over 10 m segments {ten.translation_pct:.2f} % (mean of {ten.n})" if ten else ""
    end = f"{found.end_pct:.2f} %" if found.end_pct is not None else "not known"
    return "\n".join(
        [
            f"drive       {demo.drive.distance_m:.0f} m, {demo.drive.scans} front scans, {demo.drive.log}",
            f"map         {built.summary['scans_processed']} scans processed, cloud and trajectory, {built.folder}",
            f"error       end point {end} of the distance{segments}",
            _cycle_text(demo),
            f"time        {wall_s:.0f} s, of which build-map {built.summary['wall_s']:.0f} s{_compiling(built.summary)}",
            "",
            f"report      open {built.folder / 'report.html'} in a browser",
            f"recording   {program} view {built.folder}",
            f"comparison  {demo.plot_file}",
            f"cycle       {demo.picture}, {demo.cycle.folder / 'report.html'}, {program} view {demo.cycle.folder}",
            f"your log    {program} doctor LOG, then {program} build-map LOG",
        ]
    )


def _cycle_text(demo: Demo) -> str:
    """Return what the machine did in the mine."""
    told = demo.cycle.verdict
    done = f"{told['cycles']} bucket of {told['tonnes']:.1f} t" if told.get("cycles") else "no bucket"
    took = f"{told['distance_m']:.0f} m in {told['duration_s']:.0f} s, {told['realtime_factor']:.1f} x real time"
    return f"cycle       {told['reason']}: {done} from draw point to dump by itself, {took}"


def _compiling(summary: dict[str, Any]) -> str:
    """Return how much of build-map was compilation, where that is worth a word."""
    seconds = float(summary["compile_s"])
    return f" ({seconds:.0f} s of it compiling, once after installation)" if seconds >= 1.0 else ""


def _simulation_progress(console: Console) -> Any:
    from lhdmap.simulation.history import START_NS

    def position(record: Record) -> float:
        return (record.log_time_ns - START_NS) * 1e-9

    def shown(records: Iterator[Record], duration_s: float) -> Iterator[Record]:
        return console.progress(records, total=duration_s, label="simulate", position=position)

    return shown
