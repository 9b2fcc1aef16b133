"""Searches beside the tracking: their answers are taken over at a stamp that was fixed when they were asked."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import cast

import numpy as np
from lhdmap.localization.recent_way import RecentWindow
from lhdmap.localization.search import FIND, GlobalSearch, Question, Search
from lhdmap.localization.search_thread import SearchThread

_NONE = np.zeros((0, 2))
WINDOW = RecentWindow(_NONE, np.zeros(0), _NONE, (np.zeros(3), np.zeros(3)), 0.0)
DUE_NS = 200_000_000


def asked(stamp_ns: int = 0) -> Question:
    return Question(stamp_ns, 5.0, FIND, WINDOW, np.zeros(3), None)


class Slow:
    """A search that ends when it is let go."""

    def __init__(self) -> None:
        self.go = threading.Event()

    def answer(self, question: Question) -> Search:
        assert self.go.wait(10.0)
        return Search(question.stamp_ns, 5.0, 5.0, FIND, (), "nothing")


def quick() -> GlobalSearch:
    return cast("GlobalSearch", SimpleNamespace(answer=lambda q: Search(q.stamp_ns, 5.0, 5.0, FIND, (), "nothing")))


def test_an_answer_comes_when_it_is_due_and_not_before() -> None:
    thread = SearchThread(quick())
    thread.ask(asked(1_000))
    assert thread.answer(1_000 + DUE_NS - 1) is None
    said = thread.answer(1_000 + DUE_NS)
    assert said is not None
    assert said[1].stamp_ns == 1_000
    assert not thread.busy
    assert thread.answer(2 * DUE_NS) is None
    thread.close()


def test_a_replay_waits_for_a_slow_search() -> None:
    slow = Slow()
    thread = SearchThread(cast("GlobalSearch", slow))
    thread.ask(asked())
    threading.Timer(0.05, slow.go.set).start()
    assert thread.answer(DUE_NS) is not None
    thread.close()


def test_a_running_machine_does_not_wait() -> None:
    slow = Slow()
    thread = SearchThread(cast("GlobalSearch", slow), waits=False)
    thread.ask(asked())
    assert thread.answer(10 * DUE_NS) is None
    assert thread.busy
    slow.go.set()
    thread.close()
    assert thread.answer(11 * DUE_NS) is not None
