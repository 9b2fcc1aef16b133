"""When what came out of a run is no map: it is refused, so that no script goes on with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lhdmap.errors import InputError
from lhdmap.pipeline.records import ScanRecords
from lhdmap.pipeline.track import TrackRows

_KEY_SCANS_S, _MOSTLY = 0.5, 0.5


def require_a_map(path: Path, records: ScanRecords, rows: TrackRows) -> None:
    """Refuse a run of the odometry that led nowhere; `rows`: its final poses.

    Raises:
        InputError: one scan only, no times, no scan that fitted, or the same pose for all.
    """
    why = _no_map(records, rows)
    if why:
        raise InputError(
            f"{path}: {why}; lhdmap doctor tells more, and with --poses FILE.tum a map is made at given poses"
        )


def key_scans_remark(records: ScanRecords) -> list[str]:
    """Return a warning about scans that are too far apart for odometry."""
    apart_s = float(np.median(np.diff(records.stamps_ns))) * 1e-9 if records.scans > 1 else 0.0
    if apart_s < _KEY_SCANS_S or records.degenerate_share < _MOSTLY:
        return []
    text = f"odometry: scans come each {apart_s:.1f} s and hardly fit to each other: key scans are too far apart for odometry"
    return [f"{text}; build the map at given poses (--poses FILE.tum)"]


def _no_map(records: ScanRecords, rows: TrackRows) -> str:
    stamps = records.stamps_ns
    if len(stamps) < 2:
        return "one scan only: no drive, no map"
    if stamps.max() - stamps.min() < len(stamps) * 1000:
        return f"{len(stamps)} scans without usable times: nothing can be said of the motion between them"
    if records.all_lost:
        return f"no scan fitted to the one before it ({records.processed} tried)"
    if not np.ptp(rows.poses, axis=0).any():
        return f"all {len(stamps)} scans got one and the same pose: nothing was placed"
    return ""
