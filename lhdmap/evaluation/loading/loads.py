"""What was found of a log of loadings: loads, and the attempts of each."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Attempt:
    """One dig and the weighing after it; what is not known is NaN.

    `begin_s`: of the dig, seconds after the log's start. `duration_s`: from the touch to the end of the excavation, as the
    paper's. `early`: the touch was told too early; the paper counts such attempts apart (81 = 74 + 7).
    """

    begin_s: float
    duration_s: float
    fill: float = math.nan
    fill_std: float = math.nan
    early: bool = False
    mode: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return the attempt for JSON."""
        return {
            "begin_s": known(self.begin_s),
            "duration_s": known(self.duration_s),
            "fill": known(self.fill),
            "fill_std": known(self.fill_std),
            "early": self.early,
            "mode": self.mode,
        }


@dataclass(frozen=True, slots=True)
class Load:
    """A bucket from empty to what was hauled away; `log` names where it is from."""

    log: str
    attempts: tuple[Attempt, ...]
    warnings: tuple[str, ...] = field(default=())

    @property
    def counted(self) -> tuple[Attempt, ...]:
        """The attempts without those that were begun too early."""
        return tuple(one for one in self.attempts if not one.early)

    @property
    def final_fill(self) -> float:
        """The last fill that is known; NaN where none is."""
        return next((one.fill for one in reversed(self.counted) if math.isfinite(one.fill)), math.nan)

    def to_json(self) -> dict[str, Any]:
        """Return the load for JSON."""
        return {
            "log": self.log,
            "attempts": [one.to_json() for one in self.attempts],
            "n_attempts": len(self.counted),
            "early_triggers": len(self.attempts) - len(self.counted),
            "fill": known(self.final_fill),
        }


def known(value: float) -> float | None:
    """Return a figure for JSON: what is not known is null."""
    return value if math.isfinite(value) else None
