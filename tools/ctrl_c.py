"""Send Ctrl-C at many moments of every command: `python -m tools.ctrl_c [--step 0.1] [COMMAND…]`.

Each run must end with exit code 4 (or 0, where the command was done before), without a traceback or a fault, and with
a partial folder only where the text says that something is kept.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from lhdmap.console.operators import Operators
from lhdmap.pipeline.build import BuildRequest, build_map
from lhdmap.topology.geojson import to_geojson
from tests.cli.logs import write_room_log
from tests.evaluation.loading.loadings import write_loading
from tests.evaluation.navigation.drives import write_log
from tests.exports.folders import map_folder
from tests.topology.maps import ladder
from tests.update.drives import first_way, mine, second_way, write_drive

EXIT_DONE, EXIT_INTERRUPTED = 0, 4
BAD = ("Traceback", "fault in lhdmap", "Error:", "Exception ignored")
PATIENCE_S = 120.0
LONGEST_S = 30.0
EARLIEST_S = 0.06
_BEFORE = (-signal.SIGINT, 1)  # of Python itself; 1 while it imports `site`


def commands(work: Path) -> dict[str, list[str]]:
    """Return the command lines by name; `{out}` is a new place each time."""
    log, long_log = write_room_log(work / "room.mcap", 120), write_room_log(work / "long.mcap", 1700)
    (work / "t.tum").write_text("".join(f"{i}.0 {i}.0 0 0 0 0 0 1\n" for i in range(90)), encoding="utf-8")
    (work / "t.csv").write_text("attempt,log,gt_width_m,gt_inclination_deg\nA,room.mcap,3,-30\nB,room.mcap,3,-30\n")
    (work / "s.toml").write_text('[[scenes]]\nvariant = "wall"\ncount = 2\n', encoding="utf-8")
    (work / "t.geojson").write_text(json.dumps(to_geojson(ladder())), encoding="utf-8")
    (work / "w.csv").write_text("pressure_bar,fill\n52,0\n64,0.25\n76,0.5\n88,0.75\n100,1\n", encoding="utf-8")
    (work / "grizzly.toml").write_text('kind = "grizzly"\nrocks = 1\n', encoding="utf-8")
    (work / "batch.csv").write_text("log,command\nroom.mcap,pile\nroom.mcap,doctor\n", encoding="utf-8")
    write_loading(work / "loading.mcap", [[0.6, 0.8, 0.9]])
    first_map = str(_built(work))
    return {
        "help": ["--help"],
        "config": ["config", "pile"],
        "completion": ["completion", "bash"],
        "doctor": ["doctor", str(long_log)],
        "build-map": ["build-map", str(log), "-o", "{out}"],
        "beside": ["build-map", str(long_log), "-o", "{out}"],
        "pile": ["pile", str(log), "-o", "{out}"],
        "rockbreaker": ["rockbreaker", "plan", "--to", "6,0,-1", "-o", "{out}"],
        "workspace": ["rockbreaker", "workspace", "-o", "{out}"],
        "simulate": ["simulate", "drift", "--length", "4", "-o", "{out}.mcap"],
        "suite": ["simulate", "pile", "--suite", str(work / "s.toml"), "--jobs", "2", "-o", "{out}"],
        "eval": ["eval", "trajectory", str(work / "t.tum"), "--truth", str(work / "t.tum"), "--plot", "{out}.png"],
        "eval-navigation": ["eval", "navigation", str(write_log(work / "drive.mcap")), "-o", "{out}"],
        "eval-loading": ["eval", "loading", str(work / "loading.mcap"), "-o", "{out}"],
        "calibrate": ["loading", "calibrate", str(work / "w.csv")],
        "eval-pile": ["eval", "pile", "--truth", str(work / "t.csv")],
        "view": ["view", str(log), "--web", "--port", "9191"],
        "screenshot": ["view", str(log), "--screenshot", "{out}.png"],
        "update-map": ["update-map", first_map, str(work / "later.mcap"), "-o", "{out}", "--start", "0,0,0"],
        "route": ["route", str(work / "t.geojson"), "DP1", "T2"],
        "check-map": ["check-map", str(work / "t.geojson")],
        "export": ["export", str(map_folder(work / "map")), "--format", "dxf", "-o", "{out}.dxf"],
        "localize": ["localize", str(work / "later.mcap"), "--map", first_map, "-o", "{out}"],
        "live": ["live", str(_unfinished(long_log, work / "grows.mcap")), "-o", "{out}"],
        "batch": ["batch", str(work / "batch.csv"), "-o", "{out}", "--jobs", "2"],
        "replay-grizzly": ["replay", str(work / "grizzly.toml"), "-o", "{out}"],
        "console": ["console", "--folder", str(_operated(work))],
        "demo": ["demo", "-o", "{out}"],
    }


def _operated(work: Path) -> Path:
    """Make the folder of a console."""
    folder = work / "console"
    Operators(folder).add("anna")
    return folder


def _unfinished(log: Path, path: Path) -> Path:
    """Write the first half of a log: what follows it waits for more, until Ctrl-C ends the stream and the run is finished."""
    content = log.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    return path


def _built(work: Path) -> Path:
    """Make a map, and the log of a later drive through it."""
    write_drive(work / "later.mcap", mine(branch=True), second_way(), 2)
    first = write_drive(work / "first.mcap", mine(branch=False), first_way(), 1)
    return build_map(BuildRequest([first], work / "first_map")).folder


def life_s(words: list[str], out: Path) -> float:
    """Return how long the command runs, at most LONGEST_S."""
    started = time.monotonic()
    with _process(words, out) as process:
        try:
            process.communicate(timeout=LONGEST_S)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=PATIENCE_S)
    return time.monotonic() - started


def problem(words: list[str], out: Path, delay_s: float) -> str:
    """Return what was wrong with a run that got Ctrl-C after a while, empty if nothing was."""
    with _process(words, out) as process:
        time.sleep(delay_s)
        asked = time.monotonic()
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all processes of the command
        try:
            output, errors = process.communicate(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return f"does not end within {PATIENCE_S:.0f} s"
    took_s = time.monotonic() - asked
    if process.returncode == EXIT_DONE:
        return ""
    if process.returncode in _BEFORE and "KeyboardInterrupt" in errors and "in entry_point" not in errors:
        return ""  # Python itself was starting: no line of lhdmap had run
    if process.returncode != EXIT_INTERRUPTED:
        return f"exit code {process.returncode}: {errors.strip()[-300:]}"
    if any(word in errors for word in BAD):
        return errors.strip()[-600:]
    if "--json" in words and json.loads(output)["error"]["kind"] != "interrupted":
        return f"said {output}"
    left = sorted(path.name for path in out.parent.iterdir() if "partial" in path.name)  # all else is complete
    if left and "kept in" not in errors:
        return f"leaves {', '.join(left)} and says {errors.strip()[-200:]!r}"
    if "kept in" in errors and not list(out.parent.iterdir()):
        return "says that something is kept, and nothing is"
    return f"takes {took_s:.1f} s to end" if took_s > 15.0 else ""


def _process(words: list[str], out: Path) -> subprocess.Popen[str]:
    shutil.rmtree(out.parent, ignore_errors=True)
    out.parent.mkdir()
    program = [sys.executable, "-m", "lhdmap", *(word.format(out=out) for word in words)]
    pipe = subprocess.PIPE
    return subprocess.Popen(program, stdout=pipe, stderr=pipe, text=True, start_new_session=True)


def main() -> int:
    """Run all commands; return how many runs went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="COMMAND", help="some only")
    parser.add_argument("--step", type=float, default=0.1, help="seconds between the moments")
    parser.add_argument("--most", type=int, default=60, metavar="N", help="moments of a command at most")
    parser.add_argument("--json", action="store_true", help="with --json behind every command")
    arguments = parser.parse_args()
    wrong = 0
    with tempfile.TemporaryDirectory(prefix="ctrl-c-") as folder:
        work = Path(folder)
        out = work / "made" / "out"
        for name, words in commands(work).items():
            if arguments.names and name not in arguments.names:
                continue
            words = [*words, *(["--json"] if arguments.json else [])]
            whole_s = life_s(words, out)
            moments = min(int((whole_s + 0.2 - EARLIEST_S) / arguments.step), arguments.most)
            print(f"{name}: {whole_s:.1f} s, {moments} moments", flush=True)
            for k in range(moments):
                delay_s = EARLIEST_S + k * (whole_s + 0.2 - EARLIEST_S) / moments
                found = problem(words, out, delay_s)
                wrong += bool(found)
                if found:
                    print(f"  after {delay_s:.2f} s: {found}", flush=True)
    print(f"{wrong} runs went wrong")
    return min(wrong, 1)


if __name__ == "__main__":
    sys.exit(main())
