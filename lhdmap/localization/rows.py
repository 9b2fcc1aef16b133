"""One row a scan of what localization says: columns as in the contract (`localization.parquet`)."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

UNKNOWN, CANDIDATE, TRACKING, LOST = "unknown", "candidate", "tracking", "lost"


class LocalizationRow(NamedTuple):
    """Where the machine is at a front scan; NaN and empty texts where it is not known."""

    stamp_ns: int
    status: str
    node: str
    rho_m: float
    lateral_m: float
    heading_rad: float
    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float
    std_along_m: float
    std_across_m: float
    std_heading_rad: float
    information_along: float
    probability: float
    source: str
    next_point: str
    next_point_m: float
    latency_ms: float


_NAN = math.nan
NOWHERE = LocalizationRow(
    0, UNKNOWN, "", _NAN, _NAN, _NAN, _NAN, _NAN, _NAN, _NAN, _NAN, _NAN, _NAN, _NAN, 0.0, "", "", _NAN, _NAN
)  # fmt: skip
"""A row of which nothing is known."""
TEXTS = ("status", "node", "source", "next_point")


def columns(rows: list[LocalizationRow]) -> dict[str, Any]:
    """Return rows as columns of a table."""
    out: dict[str, Any] = {}
    for name in LocalizationRow._fields:
        values = [getattr(row, name) for row in rows]
        out[name] = values if name in TEXTS else np.array(values, dtype=np.int64 if name == "stamp_ns" else float)
    return out
