"""Searches in a thread of their own: what tracks goes on, and takes an answer over at a stamp that was fixed when it was asked.

So a log gives the same rows however fast the machine is: a replay that gets there first waits for the answer.
"""

from __future__ import annotations

import time
from concurrent.futures import Future, ThreadPoolExecutor

from lhdmap.localization.search import GlobalSearch, Question, Search

_ANSWER_NS = 200_000_000


class SearchThread:
    """One question at a time.

    `waits`: at the stamp that an answer is due, wait for it; False on a running machine, where a late one is taken over later.
    `waited_s`: in all, as a replay does that is faster than the drive was.
    """

    def __init__(self, search: GlobalSearch, *, waits: bool = True) -> None:
        self._search, self._waits = search, waits
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="search")
        self.waited_s = 0.0
        self._asked: tuple[Question, Future[Search]] | None = None

    @property
    def busy(self) -> bool:
        """Whether a question is out."""
        return self._asked is not None

    def ask(self, question: Question) -> None:
        """Begin a search."""
        self._asked = question, self._thread.submit(self._search.answer, question)

    def answer(self, stamp_ns: int) -> tuple[Question, Search] | None:
        """Return what was asked and the answer to it, once it is due."""
        if self._asked is None or stamp_ns - self._asked[0].stamp_ns < _ANSWER_NS:
            return None
        question, future = self._asked
        if not self._waits and not future.done():
            return None
        self._asked = None
        began = time.perf_counter()
        said = future.result()
        self.waited_s += time.perf_counter() - began
        return question, said

    def close(self) -> None:
        """End the thread."""
        self._thread.shutdown(wait=True, cancel_futures=True)
