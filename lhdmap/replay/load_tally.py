"""What is counted of a machine that loads: attempts, charges, early triggers, fill as weighed and as it truly is."""

from __future__ import annotations

import math
from typing import Any

from lhdmap.loading.states import State
from lhdmap.replay.processes.told import LoadingNow
from lhdmap.simulation.ground.records import State as Bucket
from lhdmap.simulation.vehicle.state import VehicleState

_TOUCHED_M = 0.01  # less of the lip in rock is no pile


class LoadTally:
    """Takes what the loading task says, and true states. `full_kg` is a full bucket."""

    def __init__(self, full_kg: float) -> None:
        self._full_kg = full_kg
        self.charges = self.early_triggers = self.attempts = 0
        self.fill = self.fill_std = math.nan
        self._state, self._load_kg, self._embed_m, self._fill_true = "", 0.0, 0.0, math.nan

    def at(self, state: VehicleState) -> None:
        """Take a true state."""
        self._load_kg, self._embed_m = state.load_kg, embedded_m(state)

    def said(self, now: LoadingNow) -> None:
        """Take what the task does."""
        if now.state != self._state:
            if self._state == State.CHARGING and now.state == State.EXCAVATION:
                self.charges += 1
                self.early_triggers += self._embed_m < _TOUCHED_M
            self._state = now.state
        if now.attempts != self.attempts:
            self.attempts, self.fill, self.fill_std = now.attempts, now.fill, now.fill_std
            self._fill_true = self._load_kg / self._full_kg

    def verdict(self) -> dict[str, Any]:
        """Return what `verdict.json` says of the loading; `fill_true`, and what is left in the bucket, are the simulator's."""
        return {
            "attempts": self.attempts,
            "fill": _known(self.fill),
            "fill_std": _known(self.fill_std),
            "charges": self.charges,
            "early_triggers": int(self.early_triggers),
            "fill_true": _known(self._fill_true),
            "left_true_t": 1e-3 * self._load_kg,
        }


def embedded_m(state: VehicleState) -> float:
    """Return how deep the lip truly sits in rock, metres."""
    if state.digging is None or state.digging.bucket is None:
        return 0.0
    return float(Bucket._make(state.digging.bucket).embed_m)


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
