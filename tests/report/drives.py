"""A drive on a small map, made up: along a tunnel, then back in reverse, beside a known place error."""

from __future__ import annotations

import numpy as np
from lhdmap.messages import FloatArray
from lhdmap.report.replay_data import Change, DriveData, ReplayData, StopRow
from lhdmap.report.route_legs import Leg

from tests.topology.maps import ladder

START_NS = 1_700_000_000_000_000_000
VERDICT = {
    "ok": True, "reason": "arrived", "kind": "tram", "arrived": True, "contacts": [], "min_clearance_m": 0.4, "distance_m": 40.0,
    "duration_s": 20.0, "mean_speed_kmh": 7.2, "max_speed_kmh": 9.0, "stops": 1, "assists": 0, "assist_s": 0.0, "faults": [],
    "realtime_factor": 3.0, "journal_sha256": "0",
}  # fmt: skip


def rows() -> FloatArray:
    """Forward 20 m along x in 10 s, and back."""
    t = np.arange(0.0, 20.0, 0.1)
    zero = np.zeros(len(t))
    x = np.where(t < 10.0, 2.0 * t, 40.0 - 2.0 * t)
    speed = np.where(t < 10.0, 2.0, -2.0)
    return np.column_stack([t, x, zero, zero, zero, zero, speed, speed, zero + 0.5, zero + 0.01])


def drive() -> DriveData:
    """Plans in each direction with a rest between, limited by two things; the place 3 cm off along, 4 cm across."""
    t = np.append(np.arange(1.0, 9.0, 0.2), np.arange(12.0, 18.0, 0.2))
    plans = np.column_stack([t, np.where(t < 10.0, 2.0, -2.0), 0.4 + 0.0 * t, 20.0 + 0.0 * t, (t > 6.0).astype(float)])
    places = np.column_stack([t, 0.03 + 0.0 * t, 0.04 + 0.0 * t, 0.001 + 0.0 * t, 0.02 + 0.0 * t])
    line = np.column_stack([np.linspace(0.0, 20.0, 30), np.zeros(30), np.zeros(30)])
    legs = [Leg("forward", line), Leg("reverse", line[::-1])]
    return DriveData(ladder(), legs, plans, ("limit", "stop"), [line[:8], np.empty((0, 3))], places, [line[:5, :2]])


def replayed() -> ReplayData:
    """The whole run."""
    changes = {"navigation": [Change(START_NS, "idle", ""), Change(START_NS + 10**9, "driving", "route")]}
    stops = [StopRow(9.0, 12.0, 7.2, "guard: contact on the braking path", "guard: <points>")]
    return ReplayData(
        "Replay made up", VERDICT, rows(), START_NS, changes, [rows()[:, 1:4] + 2.0], drive=drive(), stops=stops
    )
