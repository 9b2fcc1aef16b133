"""From estimates to decisions: one an approach; what was decided stays when the machine backs out and drives elsewhere."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.pile.result import PileApproach, PileEstimate, PileReport, Snapshot
from lhdmap.pile.settings import PileSettings

_MOST_HISTORY = 400
_SURE_STD_DEG = 2.5
_ELSEWHERE_M = 5.0
_TOE_STD_M = 0.5  # the deadline acts at the last estimate before it, of which the distance is not known better
_AWAY_M = 2.0  # travel without a face after which the last one was none; in reverse: the machine backs out
_CHANGED_SIGMAS = 2.0
_RANK = {"loadable": 2, "too_shallow": 1, "hang_up": 1}


class Approaches:
    """`take` each estimate; `report` the pile at any time. Lengths travelled are in metres, negative in reverse."""

    def __init__(self, settings: PileSettings) -> None:
        self._settings = settings
        self._ended: list[PileReport] = []
        self._begin()

    def _begin(self) -> None:
        self._history: list[Snapshot] = []
        self._decision: Snapshot | None = None
        self._best: Snapshot | None = None
        self._best_m = 0.0
        self._around: FloatArray | None = None

    @property
    def decided(self) -> bool:
        """Whether it was decided what the machine looks at."""
        return self._decision is not None

    @property
    def best(self) -> PileEstimate | None:
        """The last estimate of what the machine looks at that was not made too near."""
        return None if self._best is None else self._best.estimate

    def take(self, snapshot: Snapshot, travelled_m: float) -> None:
        """Keep the estimate, and decide: when sure enough, at the latest at the deadline."""
        if self._left(snapshot, travelled_m):
            self._end()
        self._history.append(snapshot)
        if len(self._history) > _MOST_HISTORY:
            del self._history[1::2]
        if not snapshot.estimate.found:
            return
        if snapshot.distance_m >= self._settings.closest_m:
            self._withdraw(snapshot.estimate)
            self._best, self._best_m = snapshot, travelled_m
        if self._decision is None and self._sure(snapshot):
            self._decision = snapshot

    def backed_out(self, travelled_m: float) -> bool:
        """Return whether the machine has just backed out from what was decided: `keep` its surroundings while they are known."""
        return self.decided and self._around is None and self._best_m - travelled_m > _AWAY_M

    def keep(self, around_m: FloatArray) -> None:
        """Keep the pile for good, with hits around it (N, 3)."""
        self._around = around_m

    def report(self, around_m: FloatArray) -> PileReport:
        """Return the last pile that can be loaded, else the last one that is a pile, else what lies ahead.

        `around_m` (N, 3): hits around what lies ahead.
        """
        piles = self._all(around_m)
        chosen = max(reversed(piles), key=_rank, default=self._ahead(around_m))  # of equals the last one
        ends = [PileApproach(one.decision, one.last) for one in piles if one.decision and one.last]
        return replace(chosen, piles=tuple(ends))

    def _all(self, around_m: FloatArray) -> list[PileReport]:
        """Return what was decided in each approach; of several to one pile, the last, or the better known where they agree."""
        if not self.decided:
            return self._ended
        ahead = self._ahead(around_m)
        before = next((one for one in self._ended if _same(one, ahead)), None)
        others = [one for one in self._ended if one is not before]
        return [*others, ahead if before is None or _changed(before, ahead) else min(before, ahead, key=_std_deg)]

    def _ahead(self, around_m: FloatArray) -> PileReport:
        last = self._best or self._decision
        around = around_m if self._around is None else self._around
        return PileReport(self._decision, last, tuple(self._history), self._settings.method, around)

    def _left(self, snapshot: Snapshot, travelled_m: float) -> bool:
        """Return whether another approach has begun, or nothing is seen any more; near a pile the bucket hides it."""
        if self._best is None:
            return False
        if snapshot.estimate.found:
            return self._around is not None and snapshot.distance_m >= self._settings.closest_m
        moved_m = travelled_m - self._best_m
        return abs(moved_m) > _AWAY_M and self._best.distance_m - moved_m > self._settings.closest_m

    def _end(self) -> None:
        """Begin anew. What the machine backed out from was there; what it drove on through was not."""
        if self._around is None:
            self._best = self._decision = None
        else:
            self._ended = self._all(self._around)
            self._begin()

    def _withdraw(self, now: PileEstimate) -> None:
        """Take the decision back where what it was on is not the end: the drift goes on behind it, or nothing closes it."""
        decided = self._decision
        if decided is not None and (now.status in (None, "none") or _elsewhere(decided.estimate, now)):
            self._decision = None

    def _sure(self, snapshot: Snapshot) -> bool:
        estimate, settings = snapshot.estimate, self._settings
        if estimate.status is None or estimate.status == "none":
            return False
        chance = estimate.probabilities[estimate.status]
        if snapshot.distance_m <= settings.deadline_m + settings.update_m + _TOE_STD_M:
            return chance >= settings.likely
        return chance >= settings.sure and estimate.inclination_std_deg <= _SURE_STD_DEG


def _rank(report: PileReport) -> int:
    return _RANK.get(report.last.estimate.status or "none", 0) if report.last is not None else 0


def _same(one: PileReport, other: PileReport) -> bool:
    return one.last is not None and other.last is not None and not _elsewhere(one.last.estimate, other.last.estimate)


def _changed(before: PileReport, now: PileReport) -> bool:
    """Return whether the face's slope is another than before, beyond what both may be wrong by."""
    if before.last is None or now.last is None:
        return True
    off = abs(now.last.estimate.inclination_deg - before.last.estimate.inclination_deg)
    return off > _CHANGED_SIGMAS * math.hypot(_std_deg(before), _std_deg(now))


def _std_deg(report: PileReport) -> float:
    return math.inf if report.last is None else report.last.estimate.inclination_std_deg


def _elsewhere(one: PileEstimate, other: PileEstimate) -> bool:
    return bool(np.hypot(*(other.center_m - one.center_m)[:2]) > _ELSEWHERE_M)
