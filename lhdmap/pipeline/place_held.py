"""The place that a `Localizer` holds: unknown, candidate (on trial), tracking or lost, and how well the walls agree with it."""

from __future__ import annotations

from collections import deque

import numpy as np

from lhdmap.localization.fixed_lag import Belief
from lhdmap.localization.method import Corrected, Tracks
from lhdmap.localization.rows import LOST, TRACKING, UNKNOWN

_HELD = 1.0 / 0.02**2  # 1/m²: less along the machine, and walls hardly hold it


class WallSupport:
    """Shares of hits that agreed with the walls, of the last scans; `information` along the machine (1/m²) of the newest."""

    def __init__(self, scans: int) -> None:
        self._shares: deque[float] = deque(maxlen=scans)
        self.information = 0.0

    def add(self, said: Corrected) -> None:
        """Take what a match said."""
        self._shares.append(said.support)
        self.information = said.information_along

    def forget(self) -> None:
        """Forget the shares: they are of another place."""
        self._shares.clear()

    @property
    def newest(self) -> float | None:
        """The newest share; None before the first."""
        return self._shares[-1] if self._shares else None

    @property
    def well_held(self) -> bool:
        """Whether the walls hold the machine along its way."""
        return self.information > _HELD

    @property
    def barely_held(self) -> bool:
        """Whether they hardly do: the walls are smooth."""
        return self.information < _HELD

    def falls_short(self, wanted: float) -> float | None:
        """Return the mean share where it is less than wanted over as many scans as are kept; None where it is not."""
        if len(self._shares) < (self._shares.maxlen or 0) or not self._shares:
            return None
        mean = float(np.mean(self._shares))
        return None if mean >= wanted else mean


class LocalizationFacts:
    """What is counted over a drive.

    `withheld`: places that were found and not believed; `lost_stretches`; `reasons`: when a place was given up, and why;
    `first_fix`: when the place was first known (s, m after the beginning).
    """

    def __init__(self) -> None:
        self.withheld = self.lost_stretches = 0
        self.reasons: list[tuple[int, str]] = []
        self.first_fix: tuple[float, float] | None = None


class HeldPlace:
    """The place and its status; `trial_m`: since where on the path it is under trial, None where it is not."""

    def __init__(self, tracker: Tracks | None, scans: int) -> None:
        self.tracker = tracker
        self.status = UNKNOWN if tracker is None else TRACKING
        self.probability = 0.0 if tracker is None else 1.0
        self.trial_m: float | None = None
        self.support = WallSupport(scans)
        self.facts = LocalizationFacts()

    @property
    def belief(self) -> Belief | None:
        """Pose and covariance of now; None where there is no place."""
        return None if self.tracker is None else Belief(self.tracker.pose.copy(), self.tracker.P.copy())

    @property
    def tracked(self) -> Tracks | None:
        """What tracks a place that is known; None where none is."""
        return self.tracker if self.status == TRACKING else None

    def hold(self, tracker: Tracks, status: str) -> None:
        """Take another place."""
        self.tracker, self.status = tracker, status
        self.support.forget()

    def give_up(self, stamp_ns: int, why: str) -> bool:
        """Give the place up: a trial that failed, or one that is lost; return whether it is lost."""
        self.facts.reasons.append((stamp_ns, why))
        self.support.forget()
        self.probability = 0.0
        if self.trial_m is not None:
            self.facts.withheld += 1
            self.trial_m, self.tracker = None, None
            self.status = UNKNOWN if self.facts.first_fix is None else LOST
            return False
        self.facts.lost_stretches += 1
        self.status = LOST
        return True
