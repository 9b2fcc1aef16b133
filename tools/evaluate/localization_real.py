"""Real logs that pass places again: the first part teaches, the second is localized; relations set by hand compare both."""

from __future__ import annotations

import bz2
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lhdmap.config import settings_from
from lhdmap.errors import InputError
from lhdmap.evaluation.localization import planar
from lhdmap.evaluation.relations import Relations, evaluate_relations, read_relations
from lhdmap.localization.rows import LOST, TRACKING, LocalizationRow
from lhdmap.logs.source import LogSource
from lhdmap.mapfolder import MapFolder
from lhdmap.pipeline.build import BuildRequest, build_map
from lhdmap.pipeline.inputs import ROLES_READ
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.pipeline.localize import Localizer
from lhdmap.pipeline.localize_run import trajectory_of
from lhdmap.trajectory import Trajectory

from tools.evaluate.localization_faults import Messages


class Log(NamedTuple):
    """A log, its relations, and which share of its scans teaches."""

    name: str
    path: str
    relations: str
    teaches: float


LOGS = (
    Log("intel", "01_carmen_intel/intel.clf.bz2", "01_carmen_intel/intel.relations", 0.5),
    Log("aces", "02_carmen_aces/aces.clf.bz2", "02_carmen_aces/aces.relations", 0.6),
)
_SETTINGS = settings_from({"pile.method": "off", "recording.scan_interval_s": 20.0})
_MOVED_NS = 1_000_000
_INTRO = """\
The first share of a log's scans teaches, the rest is localized on that map, from where the first part ended. The robots
drive into places that the first part never saw: there nothing can be tracked. Within 1 m of the way that taught are 52 % of
Intel's second part and 23 % of ACES' (by the map of the whole log); of these 91 and 64 % are tracked.
"Relations": motions between a pose of the first part (in the map) and one of the second (tracked), as people have set them by
hand (Freiburg benchmark); their error holds that of the map.
"""
_COLUMNS = (
    "log", "teaches", "scans after it", "tracked", "losses", "withheld", "support, 5th percentile / median",
    "relations between both", "error, median (mean)",
)  # fmt: skip


def real(data: Path, folder: Path) -> Iterator[str]:
    """Yield the lines of the section."""
    yield _INTRO
    yield f"| {' | '.join(_COLUMNS)} |"
    yield "|" + " --- |" * len(_COLUMNS)
    for log in LOGS:
        yield row(log, data, folder)


def row(log: Log, data: Path, folder: Path) -> str:
    """Teach with the first part of a log, localize the second, and return the line of it."""
    first, second = parts(data / log.path, log.teaches, folder)
    made = folder / f"{log.name}.map"
    if not made.exists():
        build_map(BuildRequest([first], made, _SETTINGS))
    supports: list[float] = []
    start = planar(MapFolder.open(made).trajectory())[-1][[0, 1, 3, 2]]
    with Localizer(KnownMap.read(made), _SETTINGS, None, start) as localizer:
        for role, message in _messages(second):
            localizer.update(role, message)
            if localizer.rows and localizer.rows[-1].status == TRACKING and localizer.support is not None:
                supports.append(localizer.support)
        localizer.finish()
    rows = localizer.rows
    tracked, lost = (100 * np.mean([one.status == status for one in rows]) for status in (TRACKING, LOST))
    cells = (
        log.name,
        f"{100 * log.teaches:.0f} %",
        str(len(rows)),
        f"{tracked:.0f} % (lost {lost:.0f} %)",
        str(localizer.facts.lost_stretches),
        str(localizer.facts.withheld),
        f"{np.quantile(supports, 0.05):.2f} / {np.median(supports):.2f}" if supports else "",
        *_agreement(MapFolder.open(made).trajectory(), rows, read_relations(data / log.relations)),
    )
    return f"| {' | '.join(cells)} |"


def parts(log: Path, share: float, folder: Path) -> tuple[Path, Path]:
    """Cut a CARMEN log after a share of its scans, line by line: stamps may run backwards, the order of the file counts."""
    lines = bz2.decompress(log.read_bytes()).splitlines(keepends=True)
    scans = [k for k, line in enumerate(lines) if line.startswith(b"FLASER")]
    cut = scans[round(share * len(scans))]
    first, second = (folder / f"{log.name.partition('.')[0]}_{part}.clf" for part in ("first", "second"))
    first.write_bytes(b"".join(lines[:cut]))
    second.write_bytes(b"".join(lines[cut:]))
    return first, second


def _messages(log: Path) -> Messages:
    with LogSource([log]) as source:
        return list(source.messages([role for role in ROLES_READ if role in source.roles]))


def _agreement(taught: Trajectory, rows: list[LocalizationRow], relations: Relations) -> tuple[str, str]:
    """Return how many relations join both parts, and by how much these are off."""
    found = trajectory_of(rows)
    stamps = np.concatenate([taught.stamps_ns, found.stamps_ns])
    both = Trajectory(
        stamps,
        np.concatenate([taught.positions_m, found.positions_m]),
        np.concatenate([taught.quaternions_xyzw, found.quaternions_xyzw]),
    )
    end = int(taught.stamps_ns.max()) + _MOVED_NS
    joins = (np.minimum(relations.first_ns, relations.second_ns) <= end) & (
        np.maximum(relations.first_ns, relations.second_ns) > end
    )
    kept = np.flatnonzero(joins)
    if not len(kept) or not len(found.stamps_ns):
        return "0", ""
    chosen = Relations(
        relations.first_ns[kept],
        relations.second_ns[kept],
        type(relations.T_first_second)(*(part[kept] for part in relations.T_first_second)),
    )
    try:
        told = evaluate_relations(both, chosen)
    except InputError:
        return f"0 of {len(kept)}", ""
    group = told.groups[0]
    if group.translation_m is None or group.rotation_deg is None:
        return f"0 of {len(kept)}", ""
    t, r = group.translation_m, group.rotation_deg
    return f"{told.matched} of {len(kept)}", f"{t.median:.3f} m, {r.median:.2f}° (mean {t.mean:.3f} m, {r.mean:.2f}°)"
