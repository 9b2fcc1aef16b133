"""Figures of a result that are compared over machines and shifts, read from its folder, whatever command made it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.descriptions import described

_PILE = ("status", "width_m", "inclination_deg", "volume_m3")


def folder_figures(folder: Path) -> dict[str, Any]:
    """Return what is known of a complete result; what it does not have is left out.

    `began` (UTC, ISO 8601), `drift_pct` (expected error at the end, % of the way), `weak_pct` (scans that did not fix the
    motion, %), `slip_mean` (skid factor of the wheels), `pile_status`, `pile_width_m`, `pile_inclination_deg`, `pile_volume_m3`.
    """
    info = described(folder)
    if info is None:
        return {}
    counts = info.get("counts")
    counts = counts if isinstance(counts, Mapping) else {}
    error = counts.get("expected_error")
    weak = counts.get("degenerate_share")
    found = {
        "began": _began(folder / "trajectory.tum"),
        "drift_pct": error.get("end_pct") if isinstance(error, Mapping) else None,
        "weak_pct": 100.0 * weak if isinstance(weak, (int, float)) else None,
        "slip_mean": _slip(folder / "diagnostics.parquet", counts),
    }
    return {key: value for key, value in (found | _pile(folder / "pile.json")).items() if value is not None}


def _began(trajectory: Path) -> str | None:
    """Return when the first pose of a trajectory was."""
    try:
        with trajectory.open(encoding="ascii") as file:
            word = next((line.split()[0] for line in file if line.strip() and not line.startswith("#")), "")
        return datetime.fromtimestamp(float(word), UTC).isoformat(timespec="seconds")
    except (OSError, ValueError, OverflowError):
        return None


def _slip(diagnostics: Path, counts: Mapping[str, Any]) -> float | None:
    """Return the mean over the scans at which it was seen, or that of the command itself."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    own = counts.get("slip_mean")
    if isinstance(own, (int, float)):
        return float(own)
    try:
        slip = pq.read_table(diagnostics, columns=["slip"])["slip"].to_numpy()
    except (OSError, KeyError, pa.ArrowException):
        return None
    seen = slip[np.isfinite(slip)]
    return float(seen.mean()) if len(seen) else None


def _pile(file: Path) -> dict[str, Any]:
    try:
        pile = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return {f"pile_{key}": pile.get(key) for key in _PILE} if isinstance(pile, Mapping) else {}
