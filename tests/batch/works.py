"""Work that workers can do in a moment; the words are a row's command line."""

from __future__ import annotations

import json
import os
import shutil
import signal
import threading
import time
from collections.abc import Sequence
from pathlib import Path

from lhdmap.batch.work import JobOutcome

MADE = {"kind": "pile", "software": {"name": "lhdmap", "version": "0"}}


def warm() -> None:
    """Succeed."""


def warm_dies() -> None:
    """Take the process along."""
    os.kill(os.getpid(), signal.SIGKILL)


def work(words: Sequence[str]) -> JobOutcome:
    """Do what the log's name says: die always, die once, raise, fail, or write a folder; each try leaves a mark beside the log."""
    log = Path(words[1])
    with log.with_suffix(".tries").open("a") as file:
        file.write("x")
    tries = log.with_suffix(".tries").stat().st_size
    if "-o" in words:
        partial = Path(f"{words[words.index('-o') + 1]}.partial")
        partial.mkdir(exist_ok=True)
        (partial / ".lhdmap").touch()
    _go_wrong(log, tries)
    if log.stem.startswith("fails"):
        return JobOutcome(
            3, {"error": {"kind": "input", "message": "not a log", "exit_code": 3}}, "lhdmap: not a log\n"
        )
    if "-o" in words:
        if "--force" in words:
            shutil.rmtree(partial.with_suffix(""))
        partial.rename(partial.with_suffix(""))
        sources = [{"path": str(log), "bytes": log.stat().st_size}]
        (partial.with_suffix("") / "run.json").write_text(json.dumps({**MADE, "sources": sources}))
        (partial.with_suffix("") / "report.html").touch()
    return JobOutcome(0, {"width_m": 3.5, "status": "loadable", "boulders": []})


def _go_wrong(log: Path, tries: int) -> None:
    if log.stem.startswith("killed") or (log.stem.startswith("once") and tries == 1):
        os.kill(os.getpid(), signal.SIGKILL)
    if log.stem.startswith("late"):
        threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGKILL)).start()
    if log.stem.startswith("long"):
        time.sleep(60.0)
    if log.stem.startswith("fat"):
        held = b"x" * 400_000_000
        time.sleep(60.0 + len(held[:0]))
    if log.stem.startswith("slow"):
        time.sleep(0.5)
    if log.stem.startswith("raises"):
        raise ValueError("odd")
