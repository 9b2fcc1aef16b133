"""A console that listens, and what talks to it: HTTP by hand, sockets of pages and machines. Its wall clock is an input."""

from __future__ import annotations

import contextlib
import http.client
import json
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pyotp
import uvicorn
from lhdmap.console.app import Place, application
from lhdmap.console.audit import Audit
from lhdmap.console.codec import encode
from lhdmap.console.messages import Hello, Message
from lhdmap.console.operators import Operators, machine_key
from lhdmap.console.serve import Beside
from lhdmap.console.settings import ConsoleSettings
from websockets.sync.client import ClientConnection, connect

NAMES = ("anna", "bert")


class Answer(NamedTuple):
    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def cookie(self) -> str:
        return self.headers.get("set-cookie", "").partition(";")[0]


class Served:
    """A running console; `now_s` is the time that it sees, beside the time that goes by."""

    def __init__(self, folder: Path, port: int) -> None:
        self.folder, self.port, self.url = folder, port, f"http://127.0.0.1:{port}"
        self.later_s, self._begun_s = 0.0, time.monotonic()
        self.secrets: dict[str, pyotp.TOTP] = {}
        for name in NAMES:
            made = pyotp.parse_uri(Operators(folder).add(name))
            assert isinstance(made, pyotp.TOTP)
            self.secrets[name] = made
        self.key = machine_key(folder, make=True)
        self.audit_path = folder / "audit.jsonl"

        self.open = contextlib.ExitStack()

    def now_s(self) -> float:
        return 1_800_000_000.0 + time.monotonic() - self._begun_s + self.later_s

    def code(self, name: str) -> str:
        """Return the code of now; the clock goes on so far that it is a new one."""
        self.later_s += 31.0
        return str(self.secrets[name].at(self.now_s()))

    def ask(self, method: str, path: str, body: Any = None, cookie: str = "", **headers: str) -> Answer:
        """Send a request as the page would; what is given replaces its headers, empty ones are left out."""
        data = body if isinstance(body, bytes) else b"" if body is None else json.dumps(body).encode()
        sent = {"Host": f"127.0.0.1:{self.port}", "Origin": self.url, "Cookie": cookie} | headers
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=10)
        with contextlib.closing(connection):
            connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            for name, value in sent.items():
                if value:
                    connection.putheader(name, value)
            connection.putheader("Content-Length", str(len(data)))
            connection.endheaders(data)
            got = connection.getresponse()
            read = b""
            with contextlib.suppress(ConnectionResetError):  # it has refused to read all that was sent
                read = got.read()
            return Answer(got.status, {name.lower(): value for name, value in got.getheaders()}, read)

    def log_in(self, name: str) -> str:
        """Return the cookie of a new session."""
        answer = self.ask("POST", "/login", {"name": name, "code": self.code(name)})
        assert answer.status == 204, answer
        return answer.cookie

    def page(self, cookie: str, origin: str = "") -> Page:
        """Open the socket of a page."""
        return Page(self, self.opened("/page", {"Cookie": cookie, "Origin": origin or self.url}), cookie)

    def machine(self, name: str) -> Machine:
        """Connect a machine."""
        machine = Machine(self.opened("/machine", {"Authorization": f"Bearer {self.key}"}))
        machine.say(Hello(name))
        return machine

    def opened(self, path: str, headers: dict[str, str]) -> ClientConnection:
        """Open a socket that ends with the console."""
        address = f"ws://127.0.0.1:{self.port}{path}"
        return self.open.enter_context(
            connect(address, additional_headers=headers, proxy=None, close_timeout=0.1, max_queue=None)
        )

    def audit(self) -> list[dict[str, Any]]:
        """Return the lines of the audit."""
        return [json.loads(line) for line in self.audit_path.read_text().splitlines()]


class Side:
    """One end of a socket."""

    def __init__(self, told: ClientConnection) -> None:
        self.socket = told

    def until(self, kind: str, wait_s: float = 5.0, **more: Any) -> dict[str, Any]:
        """Return the next message of a kind with these values."""
        end = time.monotonic() + wait_s
        while True:
            got: dict[str, Any] = json.loads(self.socket.recv(timeout=max(end - time.monotonic(), 0.0)))
            if got["type"] == kind and all(got.get(key) == value for key, value in more.items()):
                return got

    def nothing(self, kind: str, for_s: float = 0.15) -> bool:
        """Return whether no message of a kind comes for a while."""
        with contextlib.suppress(TimeoutError):
            self.until(kind, for_s)
            return False
        return True


class Page(Side):
    """A page of an operator."""

    def __init__(self, served: Served, told: ClientConnection, cookie: str) -> None:
        super().__init__(told)
        self._served, self.cookie = served, cookie
        self.number = self.until("you")["page"]

    def sit(self, *, take: bool = True) -> int:
        return self._served.ask("POST", "/seat", {"page": self.number, "take": take}, self.cookie).status

    def command(self, machine: str, kind: str, number: int = 0, answer: str = "") -> Answer:
        wish = {"page": self.number, "machine": machine, "kind": kind, "number": number, "answer": answer}
        return self._served.ask("POST", "/command", wish, self.cookie)

    def beat(self, machine: str, number: int) -> None:
        self.socket.send(json.dumps({"machine": machine, "number": number}))


class Machine(Side):
    """A machine."""

    def say(self, message: Message) -> None:
        self.socket.send(encode(message))


@contextlib.contextmanager
def console(folder: Path, settings: ConsoleSettings | None = None) -> Iterator[Served]:
    """Serve a console with two operators on a free port of this machine."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = int(free.getsockname()[1])
    served = Served(folder, port)
    audit = Audit(served.audit_path)
    place = Place((served.url,), served.key, "http://127.0.0.1:9090/?url=x")
    app = application(settings or ConsoleSettings(), place, Operators(folder), audit, served.now_s)
    config = uvicorn.Config(
        app,
        "127.0.0.1",
        port,
        log_level="critical",
        ws="websockets-sansio",
        lifespan="off",
        timeout_graceful_shutdown=1,
    )
    with Beside(uvicorn.Server(config)), served.open:
        yield served
    audit.close()
    assert not [one for one in threading.enumerate() if one.name == "console server"]
