"""Where a console listens: on this machine alone, unless TLS or a proxy with TLS stands before it."""

from __future__ import annotations

import ipaddress
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self
from urllib.parse import urlsplit

import uvicorn

from lhdmap.console.app import Place, application
from lhdmap.console.audit import Audit
from lhdmap.console.operators import AUDIT_FILE, Operators, machine_key
from lhdmap.console.settings import ConsoleSettings
from lhdmap.errors import InputError, UsageError

HOST, PORT = "127.0.0.1", 8460
_PATIENCE_S = 10.0


@dataclass(frozen=True, slots=True)
class Listening:
    """How a console is reached. `origin`: its address as browsers see it, where that is another; certificate and its key: TLS."""

    host: str = HOST
    port: int = PORT
    origin: str = ""
    viewer: str = ""
    certificate: Path | None = None
    certificate_key: Path | None = None

    def __post_init__(self) -> None:
        """Refuse what would send codes and cookies in the clear; raises UsageError."""
        for name in ("origin", "viewer"):
            address = getattr(self, name)
            if address and (urlsplit(address).scheme not in ("http", "https") or not urlsplit(address).netloc):
                raise UsageError(f"--{name} {address}: an address like http://127.0.0.1:9090 was wanted")
        if (self.certificate is None) != (self.certificate_key is None):
            raise UsageError("--certificate and --certificate-key: both or none were wanted")
        for file in (self.certificate, self.certificate_key):
            if file is not None and not file.is_file():
                raise InputError(f"{file}: no such file")
        if not _loopback(self.host) and (self.certificate is None or not self.origin.startswith("https://")):
            wanted = "--certificate, --certificate-key and --origin https://NAME:PORT"
            raise UsageError(f"--host {self.host}: beyond this machine {wanted} were wanted")

    @property
    def url(self) -> str:
        """Where the page is."""
        return self.origin.rstrip("/") or f"{self._scheme}://{self.host}:{self.port}"

    @property
    def _scheme(self) -> str:
        return "http" if self.certificate is None else "https"

    def place(self, key: str) -> Place:
        """Return it as the application needs it."""
        local = {f"{self._scheme}://{host}:{self.port}" for host in (self.host, "localhost", HOST) if _loopback(host)}
        origins = {self.url, *(local if _loopback(self.host) else ())}
        return Place(tuple(sorted(origins)), key, self.viewer, self.url.startswith("https://"))


def server_of(folder: Path, listening: Listening, settings: ConsoleSettings) -> uvicorn.Server:
    """Return the server of a folder with operators, key and audit; `run()` serves until it is interrupted.

    Raises:
        UsageError: the folder has no operators.
        InputError: a file of it cannot be used.
        EvaluationShortfall: the audit has been changed.
    """
    operators = Operators(folder)
    if not operators.names:
        raise UsageError(f"{folder}: no operators; `lhdmap console --new-operator NAME` makes one")
    audit = Audit(folder / AUDIT_FILE)
    app = application(settings, listening.place(machine_key(folder, make=True)), operators, audit)
    return uvicorn.Server(
        uvicorn.Config(
            app,
            host=listening.host,
            port=listening.port,
            log_level="critical",
            ws="websockets-sansio",
            ws_max_size=1_000_000,  # evidence of a machine
            server_header=False,
            proxy_headers=False,
            lifespan="off",
            timeout_graceful_shutdown=1,
            ssl_certfile=listening.certificate,
            ssl_keyfile=listening.certificate_key,
        )
    )


class Beside:
    """A server in a thread, from `with` to its end: for programs that do something else meanwhile."""

    def __init__(self, server: uvicorn.Server) -> None:
        self.server = server
        self._thread = threading.Thread(target=server.run, name="console server", daemon=True)

    def __enter__(self) -> Self:
        """Start, and wait until it listens; raises InputError where it cannot."""
        self._thread.start()
        until_s = time.monotonic() + _PATIENCE_S
        while not self.server.started:
            if not self._thread.is_alive() or time.monotonic() > until_s:
                raise InputError(
                    f"{self.server.config.host}:{self.server.config.port}: the console cannot listen there"
                )
            time.sleep(0.01)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop."""
        self.server.should_exit = True
        self._thread.join(5.0)


def _loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
