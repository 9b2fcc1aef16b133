"""What `lhdmap production` gives: figures as one table for JSON, and a folder with page, tables and IREDES."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from lhdmap.errors import InputError
from lhdmap.haulage.records import Cycle
from lhdmap.production.figures import Production, production_of
from lhdmap.production.files import cycle_rows, phase_rows, write_csv, write_parquet
from lhdmap.production.iredes import iredes_xml
from lhdmap.production.journal import cycles_of_journal
from lhdmap.production.usage import Span
from lhdmap.report.production_page import write_production_page
from lhdmap.runfolder import RunFolderWriter, RunInfo

KIND, JOURNAL = "production", "journal.jsonl"
_SECOND_NS = 1_000_000_000


def journal_of(path: Path) -> Path:
    """Return the journal that a run folder holds, or that is named itself.

    Raises:
        InputError: there is none.
    """
    file = path / JOURNAL if path.is_dir() else path
    if not file.is_file():
        raise InputError(f"{file}: no such file; the folder of a replay, or its {JOURNAL}, was wanted")
    return file


def production_of_runs(runs: Sequence[Path], shift_h: float | None = None) -> Production:
    """Return the production of runs; each is another machine where their journals do not say so.

    `shift_h`: how long was scheduled, from the first record on; None: as long as there are records.

    Raises:
        InputError: a journal cannot be read, or holds nothing.
    """
    cycles: list[Cycle] = []
    for number, run in enumerate(runs, start=1):
        own = cycles_of_journal(journal_of(run))
        if not own:
            raise InputError(f"{run}: neither a mission nor a drive of its own is in its journal")
        told = {one.machine for one in own} | {one.machine for one in cycles}
        same = len(runs) > 1 and len(told) == 1
        cycles += [one._replace(machine=f"{one.machine} {number}") if same or number > 1 else one for one in own]
    begin = min(one.from_ns for one in cycles)
    calendar = None if shift_h is None else Span(begin, begin + round(shift_h * 3600.0 * _SECOND_NS))
    return production_of(cycles, calendar)


def write_run(target: Path, production: Production, runs: Sequence[Path], *, force: bool = False) -> Path:
    """Write `report.html`, `production.json`, cycles and phases as CSV and parquet, and an IREDES file a machine.

    Raises:
        UsageError: the folder is there already.
    """
    journals = [journal_of(run) for run in runs]
    with RunFolderWriter(KIND, target, force=force, inputs=runs) as folder:
        values = production.values()
        folder.write_json("production.json", values)
        for name, rows in (("cycles", cycle_rows(production.cycles)), ("phases", phase_rows(production.cycles))):
            write_csv(folder.path / f"{name}.csv", rows)
            folder.finished(folder.path / f"{name}.csv")
            write_parquet(folder.path / f"{name}.parquet", rows)
            folder.finished(folder.path / f"{name}.parquet")
        for machine in dict.fromkeys(one.machine for one in production.cycles):
            path = folder.path / f"iredes_{re.sub('[^A-Za-z0-9]+', '_', machine)}.xml"
            path.write_text(iredes_xml([one for one in production.cycles if one.machine == machine]), encoding="utf-8")
            folder.finished(path)
        write_production_page(folder.path / "report.html", production, target.name)
        folder.finished(folder.path / "report.html")
        counts = {"cycles": values["cycles"], "tonnes": values["tonnes"]}
        return folder.complete(RunInfo(journals, {}, counts))
