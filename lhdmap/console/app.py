"""The console as an application: one page, a few POSTs, a socket for pages and one for machines."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route, WebSocketRoute

from lhdmap.console.audit import Audit
from lhdmap.console.codec import read
from lhdmap.console.fence import MACHINE_PATH, Fence
from lhdmap.console.operators import Operators, Tries
from lhdmap.console.room import Refused, Room, Wish
from lhdmap.console.sessions import Sessions
from lhdmap.console.settings import ConsoleSettings
from lhdmap.console.sockets import machine_socket, page_socket

T = TypeVar("T")
COOKIE = "lhdmap_console"
_PAGE = Path(__file__).parent / "page"
_FILES = {"/": "index.html", "/console.js": "console.js", "/drawing.js": "drawing.js", "/console.css": "console.css"}
_MOST_BYTES = 4096
_CODE = re.compile(r"[0-9]{6}")
Clock = Callable[[], float]


class Login(NamedTuple):
    """What is typed to log in."""

    name: str
    code: str


class Sit(NamedTuple):
    """A page takes the seat, or leaves it."""

    page: str
    take: bool


@dataclass(frozen=True, slots=True)
class Place:
    """Where a console is reached, and with what: `origins` (https://host:port) of its page, address of a viewer, key of machines.

    `secure`: the cookie is sent over TLS alone.
    """

    origins: tuple[str, ...]
    key: str
    viewer: str = ""
    secure: bool = False


@dataclass(frozen=True, slots=True)
class Desk:
    """What the routes share. `clock`: seconds since 1970."""

    settings: ConsoleSettings
    place: Place
    operators: Operators
    room: Room
    clock: Clock
    sessions: Sessions = field(init=False)
    tries: Tries = field(init=False)

    def __post_init__(self) -> None:
        """Begin without anybody."""
        object.__setattr__(self, "sessions", Sessions(self.settings))
        object.__setattr__(self, "tries", Tries(self.settings))

    def who(self, cookies: dict[str, str]) -> str:
        """Return who is logged in; empty: nobody."""
        return self.sessions.name(cookies.get(COOKIE), self.clock())


def application(
    settings: ConsoleSettings, place: Place, operators: Operators, audit: Audit, clock: Clock = time.time
) -> Fence:
    """Return the console as an ASGI application."""
    desk = Desk(settings, place, operators, Room(settings, audit), clock)
    routes = [
        *(Route(path, _file(name)) for path, name in _FILES.items()),
        Route("/me", _routed(desk, _me)),
        Route("/login", _routed(desk, _login), methods=["POST"]),
        Route("/logout", _routed(desk, _logout), methods=["POST"]),
        Route("/seat", _routed(desk, _seat), methods=["POST"]),
        Route("/command", _routed(desk, _command), methods=["POST"]),
        WebSocketRoute("/page", lambda socket: page_socket(socket, desk.room, lambda: desk.who(socket.cookies), clock)),
        WebSocketRoute(MACHINE_PATH, lambda socket: machine_socket(socket, desk.room, clock)),
    ]
    return Fence(Starlette(routes=routes), place.origins, place.viewer, place.key)


Answerer = Callable[[Request, Desk], Awaitable[Response]]


def _routed(desk: Desk, answer: Answerer) -> Callable[[Request], Awaitable[Response]]:
    async def endpoint(request: Request) -> Response:
        try:
            return await answer(request, desk)
        except Refused as error:
            return _said(409, str(error))
        except ValueError as error:
            return _said(422, str(error))

    return endpoint


def _file(name: str) -> Callable[[Request], Awaitable[Response]]:
    async def endpoint(_: Request) -> Response:
        return FileResponse(_PAGE / name)

    return endpoint


async def _me(request: Request, desk: Desk) -> Response:
    return JSONResponse({"name": _operator(request, desk), "viewer": desk.place.viewer})


async def _login(request: Request, desk: Desk) -> Response:
    login, now_s = await _body(request, Login), desk.clock()
    if not desk.tries.allowed(now_s):
        return _said(429, "too many wrong codes: wait a minute")
    if not _CODE.fullmatch(login.code) or not desk.operators.accepts(login.name, login.code, now_s):
        desk.tries.wrong(now_s)
        desk.room.audit.write(now_s, login.name[:40], "login refused")
        return _said(403, "wrong name or code, or a code that was used before")
    desk.room.audit.write(now_s, login.name, "logs in")
    response = Response(status_code=204)
    response.set_cookie(
        COOKIE, desk.sessions.open(login.name, now_s), httponly=True, samesite="strict", secure=desk.place.secure
    )
    return response


async def _logout(request: Request, desk: Desk) -> Response:
    by = _operator(request, desk)
    desk.sessions.close(request.cookies.get(COOKIE))
    desk.room.audit.write(desk.clock(), by, "logs out")
    response = Response(status_code=204)
    response.delete_cookie(COOKIE)
    return response


async def _seat(request: Request, desk: Desk) -> Response:
    by = _operator(request, desk)
    sit = await _body(request, Sit)
    if sit.take:
        desk.room.takes(by, sit.page, desk.clock())
    elif desk.room.seat.holds(by, sit.page):
        desk.room.leaves(sit.page, desk.clock())
    return Response(status_code=204)


async def _command(request: Request, desk: Desk) -> Response:
    by = _operator(request, desk)
    command = desk.room.command(by, await _body(request, Wish), desk.clock())
    return JSONResponse({"id": command.id, "audit": command.audit}, 202)


def _operator(request: Request, desk: Desk) -> str:
    by = desk.who(request.cookies)
    if not by:
        raise HTTPException(401, "log in first")
    return by


async def _body(request: Request, kind: type[T]) -> T:
    data = b""
    async for chunk in request.stream():
        data += chunk
        if len(data) > _MOST_BYTES:
            raise HTTPException(413, "too long")
    return read(kind, data)


def _said(status: int, why: str, **more: Any) -> Response:
    return Response(json.dumps({"why": why, **more}), status, media_type="application/json")
