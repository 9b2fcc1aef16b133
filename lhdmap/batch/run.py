"""`run_batch`: a manifest in; results of all rows, one table and one page out. A failed row never stops the others."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lhdmap.batch.ledger import ROWS, Ledger, RowResult
from lhdmap.batch.manifest import Task, read_manifest
from lhdmap.batch.staged import Staged
from lhdmap.batch.store import Store, check_store, is_url
from lhdmap.batch.table import write_table
from lhdmap.batch.work import BatchJob, Runner, Work
from lhdmap.descriptions import SOFTWARE, description_name, kind_of
from lhdmap.errors import UsageError
from lhdmap.interrupts import before_interrupt
from lhdmap.json_files import write_json
from lhdmap.outputs import MARK, locked
from lhdmap.provenance import source_entry
from lhdmap.report.batch_page import write_batch_report
from lhdmap.runfolder import FORMAT_VERSION

KIND, TABLE, REPORT = "batch", "batch.parquet", "report.html"
Told = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class BatchRequest:
    """The manifest, the folder that it goes to, what runs a command line and where; `force`: all rows anew.

    `told` hears a line for each row that is over. `store` is the URL of a folder that results go to instead, with a copy of all
    else at the end.
    """

    manifest: Path
    target: Path
    work: Work
    runner: Runner
    force: bool = False
    told: Told = lambda _: None
    store: str = ""


@dataclass(frozen=True, slots=True)
class BatchResult:
    """The folder and its rows, in the order of the manifest."""

    folder: Path
    rows: Sequence[RowResult]

    def to_json(self) -> dict[str, Any]:
        """Return what `--json` prints."""
        counts = {status: sum(row.status == status for row in self.rows) for status in ("done", "failed", "skipped")}
        told = {"total": len(self.rows), **counts, "retried": sum(row.retried for row in self.rows)}
        places = {"batch": str(self.folder), "table": str(self.folder / TABLE), "report": str(self.folder / REPORT)}
        return told | places | {"rows": [row.to_json() for row in self.rows]}


def run_batch(request: BatchRequest) -> BatchResult:
    """Run all rows that are not complete; the folder of an earlier batch is gone on with.

    Raises:
        UsageError: the folder is something else, another batch is writing it, or the manifest asks for what is not known.
        InputError: the manifest cannot be read, or a cluster is lost.
    """
    tasks = read_manifest(request.manifest)
    _check_folder(request.target)
    request.target.mkdir(parents=True, exist_ok=True)
    with ExitStack() as held:
        lock = held.enter_context((request.target / MARK).open("w", encoding="ascii"))
        if not locked(lock.fileno()):
            raise UsageError(f"{request.target}: another batch is writing it; wait for that one, or -o OTHER")
        _describe(request, {})
        held.enter_context(before_interrupt(lambda: _kept(request.target)))
        store = _store(request, tasks)
        rows = _run(request, tasks, Ledger(request.target, store))
        result = BatchResult(request.target, rows)
        write_table(request.target / TABLE, rows)
        write_batch_report(request.target / REPORT, request.manifest.name, result.to_json(), _page_rows(rows))
        told = result.to_json()
        _describe(request, {key: told[key] for key in ("total", "done", "failed", "skipped", "retried")})
        if store is not None:
            store.send(request.target, [ROWS, TABLE, REPORT, description_name(KIND)])
    return result


def _store(request: BatchRequest, tasks: Sequence[Task]) -> Store | None:
    """Return where results go, after what is needed for all URLs has been looked for; rows of an earlier batch are fetched."""
    urls = [request.store, *(task.log for task in tasks), *(value for task in tasks for _, value in task.options)]
    for url in {f"{one.partition('://')[0]}://": one for one in urls if is_url(one)}.values():
        check_store(url)
    if not request.store:
        return None
    if not is_url(request.store):
        raise UsageError(f"--store {request.store}: a URL was wanted, such as s3://bucket/night")
    store = Store(request.store)
    if not any((request.target / ROWS).glob("*.json")):
        store.fetch(ROWS, request.target)
    return store


def _kept(target: Path) -> Path | None:
    """Return where rows that are over are kept, None where there are none."""
    return target if any((target / ROWS).glob("*.json")) else None


def _check_folder(target: Path) -> None:
    if not target.exists():
        return
    if not target.is_dir():
        raise UsageError(f"{target}: is a file; the folder of a batch was wanted, -o OTHER")
    if any(target.iterdir()) and kind_of(target) != KIND:
        raise UsageError(f"{target}: is there already and is no folder of a batch; -o OTHER")


def _run(request: BatchRequest, tasks: Sequence[Task], ledger: Ledger) -> list[RowResult]:
    found = {task.name: None if request.force else ledger.complete(task) for task in tasks}
    wanted = [task for task in tasks if found[task.name] is None]
    skipped = len(tasks) - len(wanted)
    if skipped:
        request.told(f"{skipped} of {len(tasks)} rows are complete already")
    for task in wanted:
        ledger.clear(task)
    jobs = [
        BatchJob(task.name, tuple(task.words(request.store or request.target, force=ledger.stands(task))))
        for task in wanted
    ]
    by_name, began_s = {task.name: task for task in wanted}, time.monotonic()
    runs = request.runner(jobs, Staged(request.work)) if jobs else iter(())
    for number, ran in enumerate(runs, start=1):
        result = ledger.write(by_name[ran.key], ran)
        found[ran.key] = result
        if result.status == "failed":
            ledger.clear(result.task)
        left_s = (time.monotonic() - began_s) / number * (len(jobs) - number)
        request.told(_line(result, number, len(jobs), left_s))
    return [row for row in found.values() if row is not None]


def _line(row: RowResult, number: int, total: int, left_s: float) -> str:
    why = f": {row.reason}" if row.reason else ""
    again = f", retried {row.retried}" if row.retried else ""
    left = f"; {left_s:.0f} s left" if number < total else ""
    return (
        f"{number} of {total}: {row.task.command} {row.task.log}: {row.status} in {row.wall_s:.1f} s{again}{why}{left}"
    )


def _page_rows(rows: Sequence[RowResult]) -> list[dict[str, Any]]:
    """Return rows for the page, with links relative to it."""
    told = []
    for row in rows:
        there = row.folder is not None and (is_url(row.folder) or (Path(row.folder) / REPORT).is_file())
        link = f"{row.task.name}/{REPORT}" if there else None
        told.append(
            {**row.to_json(), "name": row.task.name, "link": link, "wall_s": row.wall_s, "values": row.values}
            | _trend(row)
        )
    return told


def _trend(row: RowResult) -> dict[str, Any]:
    """Return what the trends want of a row; its shift is the day on which its log begins where the manifest has none."""
    shift = row.task.shift or str(row.figures.get("began", ""))[:10]
    return {"machine": row.task.machine or "default", "shift": shift, "figures": row.figures}


def _describe(request: BatchRequest, counts: dict[str, int]) -> None:
    """Write what the folder is, at the start already: a second run goes on with it."""
    table = {"format_version": FORMAT_VERSION, "kind": KIND, "software": SOFTWARE, "options": {}}
    table |= {"sources": [source_entry(request.manifest)], "frames": {}, "counts": counts, "files": {}, "warnings": []}
    write_json(request.target / description_name(KIND), table)
