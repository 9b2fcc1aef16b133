"""A machine's WebSocket to a console, in a thread of its own: it comes back by itself, nobody waits for it."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable, Coroutine
from typing import Any, NamedTuple

from lhdmap.console.codec import decode, encode
from lhdmap.console.messages import CONSOLE_SAYS, Asked, Hello, Message, Plan, Tick
from lhdmap.console.outbox import Outbox
from lhdmap.extras import library

_AGAIN_S, _OPEN_S, _MOST_BYTES = 0.5, 5.0, 65_536
PATH = "/machine"


class Address(NamedTuple):
    """Where a console is, as whom a machine comes, and with which key."""

    url: str
    machine: str
    key: str


class Client:
    """Sends what it is given and a tick each `tick_s`; `heard` gets each message of the console, in the thread.

    Plan and open request are sent anew after each connection. `why`: why there is none.
    """

    def __init__(
        self, address: Address, heard: Callable[[Message], None], tick: Callable[[], Tick], tick_s: float
    ) -> None:
        self.address, self.why, self.connected = address, "", threading.Event()
        self._heard, self._tick, self.tick_s = heard, tick, tick_s
        self._held: dict[str, str] = {}
        self._outbox: Outbox | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._main: asyncio.Task[None] | None = None
        self._thread = threading.Thread(target=self._run, name="console", daemon=True)

    def start(self) -> None:
        """Begin to connect."""
        self._loop = asyncio.new_event_loop()
        self._thread.start()

    def send(self, message: Message, key: str = "") -> None:
        """Send a message as soon as there is a connection; one that waits under the same key is replaced."""
        text = encode(message)
        if isinstance(message, (Plan, Asked)):
            self._held[key] = text
        self._soon(lambda: self._put(text, key))

    def close(self) -> None:
        """End the connection and the thread."""
        self._soon(lambda: self._main and self._main.cancel())
        if self._thread.is_alive():
            self._thread.join(2.0)

    def _soon(self, what: Callable[[], object]) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended
            if self._loop is not None:
                self._loop.call_soon_threadsafe(what)

    def _put(self, text: str, key: str) -> None:
        if self._outbox is not None:
            self._outbox.put(text, key)

    def _run(self) -> None:
        loop = self._loop
        assert loop is not None  # noqa: S101  # made before the thread
        self._main = loop.create_task(self._stay())
        with contextlib.suppress(asyncio.CancelledError):
            loop.run_until_complete(self._main)
        loop.run_until_complete(loop.shutdown_asyncgens())
        loop.close()

    async def _stay(self) -> None:
        """Connect, and connect again."""
        failed = library("websockets.exceptions").WebSocketException

        while True:
            try:
                await self._once()
                self.why = "the console has closed the connection"
            except (OSError, failed, TimeoutError) as error:
                self.why = str(error).partition(";")[0] or type(error).__name__
            await asyncio.sleep(_AGAIN_S)

    async def _once(self) -> None:
        connect = library("websockets.asyncio.client").connect

        address = self.address.url.replace("http", "ws", 1).rstrip("/") + PATH
        headers = {"Authorization": f"Bearer {self.address.key}"}
        async with connect(
            address, additional_headers=headers, open_timeout=_OPEN_S, max_size=_MOST_BYTES, proxy=None
        ) as socket:
            self._outbox = outbox = Outbox()
            outbox.put(encode(Hello(self.address.machine)))
            for key, text in self._held.items():
                outbox.put(text, key)
            self.connected.set()
            await _first(self._receive(socket), self._send(socket, outbox), self._ticks(outbox))

    async def _receive(self, socket: Any) -> None:
        async for text in socket:
            with contextlib.suppress(ValueError):  # what is no message is none
                self._heard(decode(text, CONSOLE_SAYS))

    async def _send(self, socket: Any, outbox: Outbox) -> None:
        while not outbox.lost:  # who is so far behind begins anew: what counts is sent again
            await socket.send(await outbox.take())

    async def _ticks(self, outbox: Outbox) -> None:
        while True:
            outbox.put(encode(self._tick()), "tick")
            await asyncio.sleep(self.tick_s)


async def _first(*jobs: Coroutine[Any, Any, None]) -> None:
    """Run jobs until one of them ends, end the others, and raise what it raised."""
    tasks = [asyncio.ensure_future(job) for job in jobs]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for task in done:
        task.result()
