"""A night of logs by `lhdmap batch` on two workers, workers killed at random: what is lost, what it costs, what memory it takes.

    python -m tools.bench.batch [--logs 300] [--plain 100] [--kills 5] [-o evaluation/batch.md]

Short planar drives of 30 seeds, each under several names, one in ten damaged. The same list without kills is the measure.
Time on the clock depends on what else the machine does, CPU time of all processes, those that were killed among them, hardly.
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
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from lhdmap.simulation.drive import simulate_drift
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriftSettings, DriveSettings
from lhdmap.simulation.sensing.sections import ScannerSettings

from tools.evaluate.figures import Figure, number, write

ROOT = Path(__file__).resolve().parents[2]
SEEDS, WORKERS, EVERY = 30, 2, 10  # one log in ten is damaged
_LOOK_S = 0.5
_RENEWED = 20  # rows a process, as lhdmap/batch/pool.py
HEADING = """\
# Many logs

Written by `python -m tools.bench.batch`; not edited by hand. `lhdmap batch --jobs 2` on {logs} logs: simulated planar drives
of 5 m at 8 km/h, 6 s long ({seeds} seeds, each under several names), {damaged} of them damaged (cut, first bytes overwritten,
empty, noise, not there), {kills} kills (SIGKILL) of a worker at random moments. Measure: the first {plain} of the list without
kills. The machine had {cores} cores and other work on them: load average {before:.1f} at the start, {after:.1f} at the end, so
time on the clock says little; CPU time is that of all processes, killed ones included.
"""


def scenario(seed: int) -> DriftScenario:
    """Return a drive of about six seconds."""
    base = DriftScenario(planar=True, seed=seed, truth=False, scanner=ScannerSettings(rear=False))
    return replace(base, drift=DriftSettings(mesh_m=0.2), drive=DriveSettings(distance_m=5.0, speed_kmh=8.0))


def write_logs(folder: Path, count: int) -> tuple[list[Path], set[str]]:
    """Write the logs; return them and the names of those that are damaged."""
    chance, logs, damaged = np.random.default_rng(1), list[Path](), set[str]()
    whole = [simulate_drift(scenario(seed), folder / f"seed_{seed}.mcap").log for seed in range(SEEDS)]
    for row in range(count):
        log = folder / f"log_{row:03}.mcap"
        logs.append(log)
        shutil.copyfile(whole[row % SEEDS], log)
        if row % EVERY == EVERY // 2:
            damaged.add(log.name)
            _damage(log, row // EVERY % 5, chance)
    return logs, damaged


def _damage(log: Path, kind: int, chance: np.random.Generator) -> None:
    data = log.read_bytes()
    if kind == 4:
        log.unlink()
    else:
        cut = data[: len(data) // 3]
        log.write_bytes((cut, chance.bytes(64) + data[64:], b"", chance.bytes(100_000))[kind])


class Killer:
    """Watches the workers of a batch: notes their memory, and kills one at random at each of the given numbers of rows."""

    def __init__(self, batch: int, at_rows: Sequence[int], seed: int) -> None:
        self.killed = list[int]()
        self.memory = list[tuple[int, float]]()
        self.rows = 0
        self._batch, self._left, self._chance = batch, sorted(at_rows), np.random.default_rng(seed)

    def watch(self, until: threading.Event) -> None:
        """Look at the workers until it is over."""
        while not until.wait(_LOOK_S):
            found = {one: mib for one in workers_of(self._batch) if (mib := resident_mib(one)) > 0.0}
            if found:
                self.memory.append((self.rows, max(found.values())))
            if found and self._left and self.rows >= self._left[0]:
                time.sleep(self._chance.uniform(0.0, 2.0))  # anywhere in a row
                worker = int(self._chance.choice(sorted(found)))
                if worker in workers_of(self._batch):
                    os.kill(worker, signal.SIGKILL)
                    self.killed.append(self.rows)
                    self._left.pop(0)


def workers_of(batch: int) -> list[int]:
    """Return the processes that a batch has started for its rows."""
    found = []
    for task in Path(f"/proc/{batch}/task").glob("*/children"):
        for one in task.read_text(encoding="ascii").split():
            try:
                words = Path(f"/proc/{one}/cmdline").read_bytes()
            except OSError:
                continue
            if b"spawn_main" in words:
                found.append(int(one))
    return found


def resident_mib(process: int) -> float:
    """Return the resident memory of a process, 0 where it is gone."""
    try:
        words = Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()
    except OSError:
        return 0.0
    return int(words[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def run(logs: Sequence[Path], target: Path, kills: int) -> dict[str, Any]:
    """Run a batch; return its `--json` with wall and CPU seconds, memory by row, kills."""
    manifest = target.with_suffix(".csv")
    manifest.write_text("log\n" + "".join(f"{log}\n" for log in logs), encoding="utf-8")
    command = [
        sys.executable,
        "-m",
        "lhdmap",
        "batch",
        str(manifest),
        "-o",
        str(target),
        "--jobs",
        str(WORKERS),
        "--json",
    ]
    began_s, over = time.monotonic(), threading.Event()
    at_rows = (5 + np.random.default_rng(5).choice(max(len(logs) - 15, kills), kills, replace=False)).tolist()
    with (target.with_suffix(".json")).open("w+", encoding="utf-8") as out:
        batch = subprocess.Popen(command, cwd=ROOT, stdout=out, stderr=subprocess.PIPE, text=True)
        killer = Killer(batch.pid, at_rows, seed=7)
        watch = threading.Thread(target=killer.watch, args=(over,))
        watch.start()
        assert batch.stderr is not None
        for line in batch.stderr:
            killer.rows += f" of {len(logs)}: " in line
            print(line.rstrip(), flush=True)
        over.set()
        watch.join()
        _, status, usage = os.wait4(batch.pid, 0)
        out.seek(0)
        told: dict[str, Any] = json.load(out)
    cpu_s = usage.ru_utime + usage.ru_stime  # of its workers too: it has waited for them
    own = {"wall_s": time.monotonic() - began_s, "cpu_s": cpu_s, "exit_code": os.waitstatus_to_exitcode(status)}
    return told | own | {"kills": killer.killed, "memory": killer.memory}


def figures(told: dict[str, Any], plain: dict[str, Any], damaged: set[str]) -> Iterator[Figure]:
    """Yield the figures of a run with kills beside one without."""
    rows, group = told["rows"], "With kills"
    whole = [row for row in rows if Path(row["log"]).name not in damaged]
    complete = [row for row in whole if row["status"] == "done" and (Path(row["map"]) / "map.json").is_file()]
    yield Figure(group, "rows accounted for", float(len({row["log"] for row in rows})), "", None, f"of {told['total']}")
    yield Figure(group, "whole logs without a map", float(len(whole) - len(complete)), "", 0.0, f"of {len(whole)}")
    bad = [row for row in rows if row["status"] == "failed"]
    broken = sum(Path(row["log"]).name in damaged for row in bad)
    note = (
        f"{len(bad)} failed, {broken} of them damaged; {len(damaged) - broken} damaged ones gave a map of what was left"
    )
    yield Figure(group, "failed without a reason", float(sum(not row["reason"] for row in bad)), "", 0.0, note)
    left = list(Path(told["batch"]).glob("*.partial"))
    yield Figure(group, "`.partial` folders left", float(len(left)), "", 0.0)
    note = f"kills after {', '.join(map(str, told['kills']))} rows"
    yield Figure(group, "retried", float(told["retried"]), "", None, note)
    group = "Time a log"
    for key, what in (("wall_s", "on the clock"), ("cpu_s", "CPU")):
        here, there = (one[key] / one["total"] for one in (told, plain))
        note = f"{here:.2f} s against {there:.2f} s"
        target = 1.15 if key == "cpu_s" else None  # the clock tells what else the machine did
        yield Figure(group, f"{what}: with kills over without", here / there, "×", target, note)
    yield from _memory(told["memory"])


def _memory(memory: Sequence[tuple[int, float]]) -> Iterator[Figure]:
    """Yield the largest worker's memory over the run: in its first rows, in the last."""
    last = memory[-1][0]
    thirds = [
        [mib for row, mib in memory if low <= 3 * row <= high]
        for low, high in ((0, last), (last, 2 * last), (2 * last, 3 * last))
    ]
    first, *_, end = (max(one) for one in thirds if one)
    group = f"Memory of the largest worker (a process is renewed after {_RENEWED} rows)"
    for name, mib in (("first", first), ("last", end)):
        yield Figure(group, f"peak in the {name} third of the run", mib, "MiB")
    yield Figure(group, "last over first", end / first, "×", 1.05)


def main(words: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=int, default=300)
    parser.add_argument("--plain", type=int, default=100, help="logs of the run without kills")
    parser.add_argument("--kills", type=int, default=5)
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "evaluation" / "batch.md")
    options = parser.parse_args(words)
    with tempfile.TemporaryDirectory() as name:
        folder, before = Path(name), os.getloadavg()[0]
        logs, damaged = write_logs(folder, options.logs)
        run(logs[:2], folder / "warm", 0)  # compiles what is not compiled yet
        plain = run(logs[: options.plain], folder / "plain", 0)
        told = run(logs, folder / "killed", options.kills)
        found = list(figures(told, plain, damaged))
        for figure in found:
            print(
                f"{figure.ok!s:6} {figure.group}: {figure.name}: {number(figure.measured)} {figure.unit} {figure.note}"
            )
        counts = {
            "logs": options.logs,
            "damaged": len(damaged),
            "kills": len(told["kills"]),
            "plain": options.plain,
            "seeds": SEEDS,
        }
        write(
            options.output,
            HEADING.format(**counts, cores=os.cpu_count(), before=before, after=os.getloadavg()[0]),
            found,
        )
    return 1 if any(figure.ok is False for figure in found) else 0


if __name__ == "__main__":
    sys.exit(main())
