"""The two sockets: of a page, that shows and gives signs of life; of a machine, that tells and is commanded."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, NamedTuple

from starlette.websockets import WebSocket, WebSocketDisconnect

from lhdmap.console.codec import decode, read
from lhdmap.console.messages import MACHINE_SAYS, PROTOCOL, Hello
from lhdmap.console.outbox import Outbox
from lhdmap.console.room import Room

_POLICY, _NAME_MOST = 1008, 60
Clock = Callable[[], float]


class PageBeat(NamedTuple):
    """A page answers a tick of a machine."""

    machine: str
    number: int


async def page_socket(socket: WebSocket, room: Room, who: Callable[[], str], clock: Clock) -> None:
    """Show a page what happens; take its signs of life as long as its session holds."""
    by = who()
    if not by:
        await socket.close(_POLICY)
        return
    await socket.accept()
    page, outbox = room.page_comes(by, clock())

    async def listen() -> None:
        while True:
            text = await socket.receive_text()
            if who() != by:
                return
            beat = read(PageBeat, text)
            room.beat(by, page, beat.machine, beat.number, clock())

    try:
        await _until(listen(), _send(socket, outbox, lambda: who() == by))
    finally:
        room.page_goes(page, clock())
    await _closed(socket)


async def machine_socket(socket: WebSocket, room: Room, clock: Clock) -> None:
    """Take what a machine says, after its hello; send what is for it."""
    await socket.accept()
    name = await _hello(socket)
    if not name:
        await _closed(socket)
        return
    outbox = room.machine_comes(name, clock())

    async def listen() -> None:
        while True:
            message = decode(await socket.receive_text(), MACHINE_SAYS)
            if not isinstance(message, Hello) and room.machines[name].outbox is outbox:
                room.heard(name, message, clock())

    try:
        await _until(listen(), _send(socket, outbox, lambda: True))
    finally:
        room.machine_goes(name, outbox, clock())
    await _closed(socket)


async def _hello(socket: WebSocket) -> str:
    """Return the name that a machine gives; empty where it is none, or speaks another version."""
    try:
        hello = decode(await socket.receive_text(), (Hello,))
    except (WebSocketDisconnect, ValueError, KeyError, TypeError):
        return ""
    assert isinstance(hello, Hello)  # noqa: S101  # nothing else was allowed
    fits = hello.protocol == PROTOCOL and 0 < len(hello.machine) <= _NAME_MOST
    return hello.machine if fits else ""


async def _send(socket: WebSocket, outbox: Outbox, may: Callable[[], bool]) -> None:
    """Send what waits, as long as the other side may have it and keeps up: who is far behind comes again and gets what is."""
    while not outbox.lost:
        text = await outbox.take()
        if not may():
            return
        await socket.send_text(text)


async def _until(*jobs: Coroutine[Any, Any, None]) -> None:
    """Run jobs until one ends: the other side has gone, or has said what is no message."""
    tasks = [asyncio.ensure_future(job) for job in jobs]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        ended = await asyncio.gather(*tasks, return_exceptions=True)
    gone = (WebSocketDisconnect, ValueError, KeyError, TypeError, RuntimeError, asyncio.CancelledError)
    for error in ended:
        if isinstance(error, BaseException) and not isinstance(error, gone):
            raise error


async def _closed(socket: WebSocket) -> None:
    try:
        await socket.close(_POLICY)
    except RuntimeError:
        return  # it is closed
