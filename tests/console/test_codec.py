"""Messages come back as they went; nothing else passes."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from lhdmap.console.codec import decode, encode
from lhdmap.console.messages import (
    CONSOLE_SAYS,
    MACHINE_SAYS,
    Ask,
    Asked,
    Beat,
    Command,
    Event,
    Hello,
    Message,
    Outcome,
    Plan,
    Status,
    Tick,
)

ASK = Ask(
    2, "loading", "charging", "time limit", "free it", ("a", "b"), (("fill", "0.3"),), ((1.0, 2.5),), ((3.0, 4.0),)
)
ALL: list[Message] = [
    Hello("one"), Plan("map", (((0.0, 1.0), (2.0, 3.0)),), (("DP1", 1.0, 2.0),)), Asked(ASK), Asked(None),
    Status(1.5, True, "autonomous", False, ("x",), "driving", "charging", (1.0, 2.0, 0.5)), Status(0.0, False, "", False),
    Event(3.0, "executor", "stops", True), Tick(7, 0.002, 0.25), Outcome("c-1", False, "no"), Beat(7, "anna"),
    Command("c-1", "answer", 2, "go_on", "anna", "", "ab"),
]  # fmt: skip


@pytest.mark.parametrize("message", ALL, ids=lambda message: type(message).__name__)
def test_a_message_comes_back(message: Message) -> None:
    assert decode(encode(message), (*MACHINE_SAYS, *CONSOLE_SAYS)) == message


def test_a_machine_cannot_say_what_the_console_says() -> None:
    with pytest.raises(ValueError, match="type"):
        decode(encode(Beat(1, "x")), MACHINE_SAYS)


GOOD: dict[str, Any] = {"type": "tick", "number": 1, "round_trip_s": 0.1, "limit_s": 0.2}


@pytest.mark.parametrize(
    "over",
    [
        {"number": True}, {"number": 1.0}, {"number": "1"}, {"number": None}, {"number": 2**60}, {"round_trip_s": "x"},
        {"round_trip_s": 1e999}, {"more": 1}, {"type": "Tick"}, {"type": 3}, {"type": None}, {"type": ["tick"]},
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(over: dict[str, Any]) -> None:
    with pytest.raises(ValueError):  # noqa: PT011  # the text says which field
        decode(json.dumps(GOOD | over), MACHINE_SAYS)


@pytest.mark.parametrize(
    "text", ["", "x", "[]", "3", "null", '"tick"', "[" * 100_000, "1" * 5000, b"\xff\xfe", '{"type":"tick"}']
)
def test_what_is_no_message_is_refused(text: str | bytes) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        decode(text, MACHINE_SAYS)


def test_a_text_and_a_list_have_an_end() -> None:
    with pytest.raises(ValueError, match="text"):
        decode(encode(Hello("x" * 3000)), MACHINE_SAYS)
    with pytest.raises(ValueError, match="list"):
        decode(encode(Plan("map", (((0.0, 0.0),) * 30_000,))), MACHINE_SAYS)


def test_what_is_not_finite_is_not_sent() -> None:
    with pytest.raises(ValueError, match="JSON"):
        encode(Status(math.nan, True, "", True))
