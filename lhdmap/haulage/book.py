"""The records of one machine while its mission goes on: phases as they come, and the cycles that end."""

from __future__ import annotations

from lhdmap.haulage.machine import Errand
from lhdmap.haulage.mission_io import Report
from lhdmap.haulage.records import Cycle, Ledger


class Book:
    """Keeps the ledger of `machine`; `ended`: the cycle that ended since it was asked last."""

    def __init__(self, machine: str) -> None:
        self._machine = machine
        self.ledger = Ledger()
        self.cycles = 0
        self.ended: Cycle | None = None
        self._bucket = Report()

    def loaded(self, told: Report) -> None:
        """Note what loading says of the bucket that it has just filled."""
        self._bucket = told

    def dumped(self, errand: Errand) -> None:
        """Close the cycle of the bucket that has just been dumped; the ledger has been told of now."""
        self.ended = self._made(errand, finished=True)
        self.cycles += 1

    def rest(self, errand: Errand) -> Cycle | None:
        """Return what was done since, as a cycle that was not finished; None: nothing."""
        cycle = self._made(errand, finished=False)
        return cycle if cycle.intervals else None

    def _made(self, errand: Errand, *, finished: bool) -> Cycle:
        told, self._bucket = self._bucket, Report()
        measured = (told.mass_t, told.fill, told.attempts, told.slip)
        intervals = self.ledger.take()
        return Cycle(self._machine, self.cycles + 1, errand.load, errand.dump, intervals, *measured, finished)
