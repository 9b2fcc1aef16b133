"""Whole runs in processes of their own: `build-map` on simulated drives, start-up times."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tools.evaluate.figures import Figure

_LHDMAP = str(Path(sys.executable).with_name("lhdmap"))
_SPEED_KMH = 12.0
_STARTS = 7


def simulate(folder: Path, duration_s: float) -> Path:
    """Simulate a drive with two scanners of 761 beams at 50 Hz; return its log."""
    log = folder / f"drive_{duration_s:.0f}s.mcap"
    length_m = duration_s * _SPEED_KMH / 3.6
    subprocess.run(
        [
            *(_LHDMAP, "simulate", "drift", "--length", f"{length_m:.0f}", "--speed-kmh", f"{_SPEED_KMH:g}"),
            *("--beams", "761", "--rate-hz", "50", "--mesh-size", "0.12", "-o", str(log), "--quiet"),
        ],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return log


def build(log: Path, target: Path) -> dict[str, Any]:
    """Run `lhdmap build-map` and return its figures, with wall and CPU time of the whole process: `process_s`, `cpu_s`."""
    started, cpu_s = time.monotonic(), _children_cpu_s()
    done = subprocess.run(
        [_LHDMAP, "build-map", str(log), "-o", str(target), "--json", "--quiet"],
        capture_output=True,
        text=True,
        check=True,
    )
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer | {
        "process_s": time.monotonic() - started,
        "cpu_s": _children_cpu_s() - cpu_s,
        "cloud_mib": (target / "cloud.ply").stat().st_size / 2**20,
    }


def _children_cpu_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def build_figures(logs: list[Path], folder: Path) -> Iterator[Figure]:
    """Measure `build-map` on logs, the shortest first; the last one has the targets."""
    build(logs[0], folder / "warm")  # compiles what is not compiled yet
    found = [build(log, folder / f"map_{k}") for k, log in enumerate(logs)]
    group = "build-map, two scanners of 761 beams at 50 Hz (odometry, cloud, report, recording)"
    for answer in found:
        last = answer is found[-1]
        name = f"{answer['duration_s']:.0f} s, {answer['distance_m']:.0f} m"
        speed = answer["duration_s"] / answer["process_s"]
        yield Figure(
            group,
            f"{name}: time",
            answer["process_s"],
            "s",
            answer["duration_s"] / 20.0 if last else None,
            f"{speed:.1f} × real time; wanted 20; CPU time {answer['cpu_s']:.1f} s",
        )
        note = f"of it {answer['cloud_mib']:.0f} MiB cloud on disk"
        yield Figure(group, f"{name}: peak memory", answer["peak_memory_mib"], "MiB", 1024.0 if last else None, note)
    short, long = found[0], found[-1]
    longer = long["duration_s"] / short["duration_s"]
    more = long["peak_memory_mib"] - short["peak_memory_mib"]
    group = "Growth with the log's length"
    yield Figure(
        group, f"time for a log {longer:.1f} × as long", long["process_s"] / short["process_s"], "×", 1.2 * longer
    )
    yield Figure(
        group, f"memory more for a log {longer:.1f} × as long", more, "MiB", None, "the cloud's points among it"
    )


def startup_figures() -> Iterator[Figure]:
    """Measure start-up times: medians of fresh processes."""
    for name, words, target in (
        ("lhdmap --help", [_LHDMAP, "--help"], 0.3),
        ("import lhdmap", [sys.executable, "-c", "import lhdmap"], 0.2),
    ):
        times = []
        for _ in range(_STARTS):
            started = time.monotonic()
            subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
            times.append(time.monotonic() - started)
        yield Figure(
            "Start-up, a fresh process", name, float(np.median(times)), "s", target, f"slowest {max(times):.2f} s"
        )
