"""What is said of the pile while the machine drives, asked of the process beside this one, which nobody waits for."""

from __future__ import annotations

import time
from concurrent.futures import Future, ThreadPoolExecutor

from lhdmap.pile.result import PileReport
from lhdmap.pipeline.inspection import PileBeside
from lhdmap.pipeline.mapping import MappingPipeline

_EVERY_S = 5.0


class PileNow:
    """The newest answer in words; a context manager, left before anybody else asks."""

    def __init__(self) -> None:
        self.words = ""
        self._asked_s = time.monotonic()
        self._answer: Future[PileReport] | None = None
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="pile")

    def look(self, stages: object) -> None:
        """Ask where it is time to, and take over an answer that is there."""
        if self._answer is not None:
            if self._answer.done():
                self.words, self._answer = _words(self._answer.result()), None
            return
        pile = stages.pile if isinstance(stages, MappingPipeline) else None
        if not isinstance(pile, PileBeside) or not pile.apart or time.monotonic() - self._asked_s < _EVERY_S:
            return
        self._asked_s = time.monotonic()
        self._answer = self._thread.submit(pile.report)

    def close(self) -> None:
        """Wait for the answer that is out."""
        self._thread.shutdown()


def _words(report: PileReport) -> str:
    found = report.estimate
    if found is None or found.status in (None, "none"):
        return ""
    what = str(found.status).replace("_", " ")
    return f"{what}, {found.width_m:.1f} m wide, {found.inclination_deg:.0f}°" if found.found else what
