"""Ctrl-C is heard between two messages, and only taken over where it is Python's own to handle."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator

import pytest
from lhdmap.pipeline.interruption import Interruption


@pytest.fixture(autouse=True)
def _handled_by_python() -> Iterator[None]:
    """Ctrl-C as Python has it: a shell leaves it ignored in what it starts in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_the_first_ctrl_c_asks_and_the_second_raises() -> None:
    with Interruption() as interruption:
        signal.raise_signal(signal.SIGINT)
        asked = interruption.asked
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert asked
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_the_program_ends_by_itself_where_it_takes_too_long(monkeypatch: pytest.MonkeyPatch) -> None:
    heard = threading.Event()

    def program(*_: object) -> None:
        heard.set()

    monkeypatch.setattr("lhdmap.pipeline.interruption._LEAST_S", 0.2)
    monkeypatch.setattr("lhdmap.pipeline.interruption.GIVE_WAY", [program])
    alarm, before = signal.getsignal(signal.SIGALRM), signal.signal(signal.SIGINT, program)
    try:
        with Interruption():
            signal.raise_signal(signal.SIGINT)
            assert not heard.is_set()
            assert heard.wait(20.0)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, alarm)
        signal.signal(signal.SIGINT, before)


def test_a_handler_of_the_caller_stays() -> None:
    heard: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: heard.append(number))
    try:
        with Interruption() as interruption:
            signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
    assert heard == [signal.SIGINT]
    assert not interruption.asked


def test_another_thread_leaves_the_signal_alone() -> None:
    found: list[object] = []

    def run() -> None:
        with Interruption():
            found.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert found == [signal.default_int_handler]
