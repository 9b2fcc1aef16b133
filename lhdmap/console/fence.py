"""What stands before every route: the Host that was asked for, the Origin that asks, and the headers of each response."""

from __future__ import annotations

import hmac
from collections.abc import Collection
from typing import Any
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

MACHINE_PATH = "/machine"
_SAFE = ("GET", "HEAD")
_POLICY = 1008  # WebSocket: policy violation


def policy(origins: Collection[str], viewer: str) -> str:
    """Return the Content-Security-Policy: this page's own files and socket, and the viewer in a frame."""
    sockets = " ".join(origin.replace("http", "ws", 1) for origin in origins)
    frame = _origin_of(viewer) or "'none'"
    return (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
        f"connect-src 'self' {sockets}; frame-src {frame}; frame-ancestors 'none'; base-uri 'none'; form-action 'self'"
    )


class Fence:
    """Refuses with 403 what comes to another host's name, from another origin, or, of a machine, without the key."""

    def __init__(self, app: ASGIApp, origins: Collection[str], viewer: str, key: str) -> None:
        self._app, self._origins, self._key = app, frozenset(origins), f"Bearer {key}"
        self._hosts = frozenset(urlsplit(origin).netloc for origin in origins)
        self._headers = {
            "Content-Security-Policy": policy(sorted(origins), viewer),
            "X-Content-Type-Options": "nosniff",
            "X-Frame-Options": "DENY",
            "Referrer-Policy": "no-referrer",
            "Origin-Agent-Cluster": "?1",  # a viewer that hangs in its frame should not hang the page
            "Cross-Origin-Opener-Policy": "same-origin",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Cache-Control": "no-store",
        }

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on what may pass."""
        if scope["type"] == "http":
            await self._http(scope, receive, send)
        elif scope["type"] == "websocket" and not self._may_open(scope["path"], Headers(scope=scope)):
            await WebSocket(scope, receive, send).close(_POLICY)
        else:
            await self._app(scope, receive, send)

    async def _http(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = Headers(scope=scope)

        async def dressed(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(self._headers)
            await send(message)

        fits = headers.get("host", "") in self._hosts
        fits &= scope["method"] in _SAFE or headers.get("origin", "") in self._origins
        app: Any = self._app if fits else PlainTextResponse("another origin", 403)
        await app(scope, receive, dressed)

    def _may_open(self, path: str, headers: Headers) -> bool:
        if headers.get("host", "") not in self._hosts:
            return False
        if path != MACHINE_PATH:
            return headers.get("origin", "") in self._origins
        told = headers.get("authorization", "").encode("utf-8", "replace")
        return "origin" not in headers and hmac.compare_digest(told, self._key.encode())


def _origin_of(address: str) -> str:
    parts = urlsplit(address)
    return f"{parts.scheme}://{parts.netloc}" if parts.scheme in ("http", "https") and parts.netloc else ""
