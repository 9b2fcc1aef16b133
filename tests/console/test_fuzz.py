"""Bad requests by chance: none is answered by a 5xx, none does anything.

As a program, more of them: `python -m tests.console.test_fuzz 1000`.
"""

from __future__ import annotations

import contextlib
import json
import random
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

for _name in ("starlette", "uvicorn", "websockets", "pyotp"):
    pytest.importorskip(_name, reason="the extra console is not installed")

from lhdmap.console.messages import Ask, Asked  # noqa: E402
from websockets.exceptions import WebSocketException  # noqa: E402
from websockets.sync.client import connect  # noqa: E402

from tests.console.served import Page, Served, console  # noqa: E402

_PATHS = (
    "/command",
    "/seat",
    "/login",
    "/me",
    "/page",
    "/machine",
    "/",
    "/../etc/passwd",
    "/command/",
    "/%00",
    "/x" * 300,
)
_METHODS = ("POST", "POST", "POST", "GET", "PUT", "DELETE", "PATCH", "HEAD", "OPTIONS", "TRACE")
_WORDS = (
    "",
    "m",
    "rearm",
    "stop",
    "answer",
    "go_on",
    "abort",
    "anna",
    "\x00",
    "💥",
    "' or 1=1 --",
    "<script>",
    "../..",
    "9" * 400,
)


def value(chance: random.Random, deep: int = 0) -> Any:
    pick = chance.randrange(9 if deep < 3 else 7)
    if pick == 7:
        return [value(chance, deep + 1) for _ in range(chance.randrange(4))]
    if pick == 8:
        return {chance.choice(_WORDS): value(chance, deep + 1) for _ in range(chance.randrange(4))}
    return (chance.choice(_WORDS), chance.randrange(-5, 10**18), chance.random(), None, True, float("nan"), -0.0)[pick]


def body(chance: random.Random, page: str) -> bytes:
    """Return a body: bytes, JSON of anything, or a wish to a request that is not open, with a field or two gone wrong."""
    pick = chance.randrange(5)
    if pick == 0:
        return chance.randbytes(chance.choice((0, 1, 40, 9000)))
    if pick == 1:
        return json.dumps(value(chance)).encode()
    wish: dict[str, Any] = {"page": page, "machine": "m", "kind": "answer", "number": 4, "answer": "go_on"}  # 3 is open
    for _ in range(chance.randrange(1, 3)):
        name = chance.choice([*wish, "take", "name", "code", "more"])
        typed = chance.randrange(4, 99) if name == "number" else chance.choice(_WORDS)
        wish[name] = typed if chance.random() < 0.8 and name in wish else value(chance)
    return json.dumps(wish).encode()[: chance.choice((10_000, 10_000, 25))] + chance.choice((b"", b"", b"}", b"\xff"))


def ask(served: Served, page: Page, chance: random.Random) -> int:
    headers = (
        {}
        if chance.random() < 0.7
        else {chance.choice(("Origin", "Host", "Content-Type", "Cookie")): chance.choice(("", "x", "é\x7f", "a" * 999))}
    )
    data = body(chance, page.number)
    method, path = chance.choice(_METHODS), chance.choice(_PATHS)
    if chance.random() < 0.5:
        method, path = "POST", chance.choice(_PATHS[:3])
    return served.ask(method, path, data, page.cookie, **headers).status


def socket(served: Served, page: Page, chance: random.Random) -> None:
    """Say something bad on a socket: of a page that has no seat, or of a machine with the key."""
    machine = chance.random() < 0.5
    headers = {"Authorization": f"Bearer {served.key}"} if machine else {"Cookie": page.cookie, "Origin": served.url}
    bad = [
        body(chance, page.number) for _ in range(3)
    ]  # drawn first: when the other side closes is no matter of the seed
    texts = [data if chance.random() < 0.3 else data.decode("utf-8", "replace") for data in bad]
    path = "/machine" if machine else "/page"
    address = f"ws://127.0.0.1:{served.port}{path}"
    with (
        contextlib.suppress(WebSocketException, OSError, TimeoutError),
        connect(address, additional_headers=headers, proxy=None, open_timeout=5) as one,
    ):
        for text in texts:
            one.send(text)
        one.recv(timeout=0.01)


def fuzz(served: Served, count: int, seed: int) -> tuple[Counter[int], list[dict[str, Any]]]:
    """Send `count` bad requests; return answers by status, and what was commanded or changed hands meanwhile."""
    chance = random.Random(seed)
    machine = served.machine("m")
    machine.say(Asked(Ask(3, "loading", "x", "y", "z")))
    page = served.page(served.log_in("anna"))
    assert page.sit() == 204
    page.until("asked", machine="m")
    told, before = Counter[int](), len(served.audit())
    for k in range(count):
        if k % 10 == 9:
            socket(served, page, chance)
            told[0] += 1
        else:
            told[ask(served, page, chance)] += 1
    assert served.ask("GET", "/me", cookie=page.cookie).status in (200, 401)  # it lives; the fuzz may have logged out
    assert machine.nothing("command", 0.3)
    return told, [one for one in served.audit()[before:] if one["what"] in ("command", "takes the seat", "logs in")]


def test_300_bad_requests_do_nothing(tmp_path: Path) -> None:
    with console(tmp_path) as served:
        told, done = fuzz(served, 300, 1)
    assert sum(told.values()) == 300
    assert [status for status in told if status >= 500] == []
    assert done == []
    assert {401, 403, 404, 405, 409, 422} <= set(told)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as _folder, console(Path(_folder)) as _served:
        print(fuzz(_served, int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 2))  # noqa: T201
