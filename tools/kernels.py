"""Compile the kernels that the tests use, once, before several workers each compile the same: `python -m tools.kernels`.

numba compiles a kernel at its first call and keeps it beside the sources; where all are kept, this takes some seconds. One
process begins with odometry, the other with the simulator: what the second needs of odometry is kept by then.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from lhdmap.cli.main import main as lhdmap
from lhdmap.config import Settings
from lhdmap.live.warm_up import warm_up

_LOAD = 'kind = "loading"\nmine = "stope"\nstart = "DP1"\n[loading]\napproach_m = 12.0\n[limits]\ntime_s = 30.0\n'
_TRAM = 'kind = "tram"\nmine = "short"\nstart = "P1"\ngoal = "OP1"\n[limits]\ntime_s = 12.0\n'


def maps() -> None:
    """Map two drives, and find the place of one on its map."""
    warm_up(Settings(), None)
    with tempfile.TemporaryDirectory() as folder:
        log = f"{folder}/drive.mcap"
        _run("simulate", "drift", "--length", "12", "-o", log)
        _run("build-map", log, "-o", f"{folder}/map", "--one-process")
        _run("localize", log, "--map", f"{folder}/map", "-o", f"{folder}/where")


def replays() -> None:
    """Teach a mine and drive in it, and begin to load: runs that are cut short."""
    for number, text in enumerate((_TRAM, _LOAD)):
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "short.toml").write_text(text, encoding="utf-8")
            _run("replay", f"{folder}/short.toml", "-o", f"{folder}/run{number}", "--no-recording")


def _run(*words: str) -> None:
    lhdmap([*words, "--quiet"])  # cut short, runs fall short: what they compile is wanted


def main() -> None:
    """Run both at the same time."""
    jobs: tuple[Callable[[], None], ...] = (maps, replays)
    with ProcessPoolExecutor(len(jobs), mp_context=get_context("spawn")) as pool:
        for one in [pool.submit(job) for job in jobs]:
            one.result()


if __name__ == "__main__":
    main()
