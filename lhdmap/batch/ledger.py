"""What is known of each row of a batch: `rows/NAME.json` with what was asked for and what came of it, `rows/NAME.txt`, said."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from lhdmap.batch.figures import folder_figures
from lhdmap.batch.manifest import Task
from lhdmap.batch.store import Store, is_url, stamp_of
from lhdmap.batch.work import Ran
from lhdmap.descriptions import described
from lhdmap.errors import InputError
from lhdmap.json_files import read_json, write_json
from lhdmap.outputs import MARK, PARTIAL_SUFFIX

ROWS = "rows"
Status = Literal["done", "failed", "skipped"]


@dataclass(frozen=True, slots=True)
class RowResult:
    """A row of the table: status and why, where the result is, values of the command, retries, seconds, figures of its folder."""

    task: Task
    status: Status
    reason: str = ""
    folder: str | None = None
    values: Mapping[str, Any] = field(default_factory=dict)
    retried: int = 0
    wall_s: float = 0.0
    figures: Mapping[str, Any] = field(default_factory=dict)

    @property
    def map(self) -> str | None:
        """The map that was made or used."""
        if self.task.command == "build-map":
            return self.folder
        return dict(self.task.options).get("map")

    def to_json(self) -> dict[str, Any]:
        """Return what `--json` says of it."""
        told = {"log": self.task.log, "status": self.status, "reason": self.reason or None}
        told |= {"map": self.map, "command": self.task.command}
        return told | {"run": self.folder, "retried": self.retried}


class Ledger:
    """Reads and writes what is known of rows in the folder of a batch."""

    def __init__(self, folder: Path, store: Store | None = None) -> None:
        """`folder` is that of the batch; results are in the store where there is one."""
        self.folder, self._store = folder, store
        (folder / ROWS).mkdir(parents=True, exist_ok=True)

    def complete(self, task: Task) -> RowResult | None:
        """Return the result of a row that is complete and still what is asked for, None for one that is to be run."""
        info = self._described(task) if task.kind.writes else None
        if task.kind.writes and info is None:
            return None
        known = self._known(task)
        if known is None:
            return None if info is None else self._of_folder(task, info)
        same = (
            known.get("status") == "done" and known.get("asked") == task.asked and known.get("source") == _stamp(task)
        )
        if not same:
            return None
        folder = self._target(task) if task.kind.writes else None
        values, figures = known.get("values") or {}, known.get("figures") or {}
        return RowResult(task, "skipped", "complete already", folder, values, figures=figures)

    def stands(self, task: Task) -> bool:
        """Whether there is a result that a new one replaces."""
        if self._store is not None:
            return False  # each result is made in an empty folder first
        return (self.folder / task.name).exists()

    def clear(self, task: Task) -> None:
        """Remove what a process that was killed has left of a row."""
        partial = self.folder / f"{task.name}{PARTIAL_SUFFIX}"
        if (partial / MARK).is_file():
            shutil.rmtree(partial, ignore_errors=True)

    def write(self, task: Task, ran: Ran) -> RowResult:
        """Write what came of a row, and return it."""
        result = self._result(task, ran)
        table: dict[str, Any] = {"log": task.log, "command": task.command, "asked": task.asked, "source": _stamp(task)}
        table |= {"status": result.status, "reason": result.reason, "retried": result.retried, "wall_s": ran.wall_s}
        write_json(self._path(task, ".json"), table | {"values": result.values, "figures": result.figures})
        if ran.outcome is not None and ran.outcome.said:
            self._path(task, ".txt").write_text(ran.outcome.said, encoding="utf-8", errors="backslashreplace")
        return result

    def _target(self, task: Task) -> str:
        return str(self.folder / task.name) if self._store is None else self._store.at(task.name)

    def _described(self, task: Task) -> Mapping[str, Any] | None:
        return described(self.folder / task.name) if self._store is None else self._store.described(task.name)

    def _known(self, task: Task) -> dict[str, Any] | None:
        try:
            return read_json(self._path(task, ".json"), "what is known of a row", "")
        except InputError:
            return None

    def _path(self, task: Task, suffix: str) -> Path:
        return self.folder / ROWS / f"{task.name}{suffix}"

    def _of_folder(self, task: Task, info: Mapping[str, Any]) -> RowResult | None:
        """Return the result of a folder that was completed, but not written down: the log must be the one that it names."""
        for source in info.get("sources", ()):
            same = isinstance(source, Mapping) and Path(str(source.get("path"))) == task.path
            if same and task.path.is_file() and source.get("bytes") == task.path.stat().st_size and not task.options:
                counts, figures = info.get("counts") or {}, folder_figures(self.folder / task.name)
                return RowResult(task, "skipped", "complete already", self._target(task), counts, figures=figures)
        return None

    def _result(self, task: Task, ran: Ran) -> RowResult:
        """Return what a job came to; exit code 1 is a verdict that fell short, and failed as well."""
        outcome = ran.outcome
        if outcome is None:
            return RowResult(task, "failed", ran.reason, None, {}, max(ran.killed - 1, 0), ran.wall_s)
        values, figures = outcome.values, outcome.figures
        if not outcome.exit_code:
            made = self._target(task) if task.kind.writes else None
            return RowResult(task, "done", "", made, values, ran.killed, ran.wall_s, figures)
        error = values.get("error")
        reason = str(error.get("message")) if isinstance(error, Mapping) else f"exit code {outcome.exit_code}"
        made = self._target(task) if task.kind.writes and self._described(task) is not None else None
        return RowResult(task, "failed", reason, made, values, ran.killed, ran.wall_s, figures)


def _stamp(task: Task) -> list[int] | list[str] | None:
    """Return size and time of change of the log, which say that it is another one now; of a folder the time alone."""
    if is_url(task.log):
        return stamp_of(task.log)
    try:
        found = task.path.stat()
    except OSError:
        return None
    return [found.st_size if task.path.is_file() else 0, found.st_mtime_ns]
