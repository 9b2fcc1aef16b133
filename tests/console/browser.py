"""A headless Chromium, driven over the DevTools protocol by `websockets` alone."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

NAMES = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-extensions", "--disable-background-networking",
    "--remote-debugging-port=0", "--window-size=1280,1100",
)  # fmt: skip


def chromium() -> str:
    """Return the program; empty where there is none."""
    return next((found for name in NAMES if (found := shutil.which(name))), "")


class Tab:
    """A page: evaluate JavaScript, wait for something, click."""

    def __init__(self, socket: ClientConnection, process: subprocess.Popen[bytes]) -> None:
        self._socket, self._process, self._count = socket, process, 0

    def call(self, method: str, wait_s: float = 10.0, **more: Any) -> Any:
        self.send(method, **more)
        number = self._count
        until = time.monotonic() + wait_s
        while True:
            answer = json.loads(self._socket.recv(timeout=until - time.monotonic()))
            if answer.get("id") == number:
                assert "error" not in answer, answer
                return answer["result"]

    def send(self, method: str, **more: Any) -> None:
        self._count += 1
        self._socket.send(json.dumps({"id": self._count, "method": method, "params": more}))

    def run(self, script: str, wait_s: float = 10.0) -> Any:
        told = self.call("Runtime.evaluate", wait_s, expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in told, told
        return told["result"].get("value")

    def wait(self, script: str, for_s: float = 8.0) -> Any:
        """Return the first value of a script that is not false."""
        until = time.monotonic() + for_s
        while not (value := self.run(script)):
            assert time.monotonic() < until, f"never true: {script}\n{self.run('document.body.innerText')}"
            time.sleep(0.02)
        return value

    def click(self, selector: str) -> None:
        self.wait(f"(() => {{ const b = document.querySelector('{selector}'); return b && !b.disabled; }})()")
        self.run(f"document.querySelector('{selector}').click()")

    def log_in(self, url: str, name: str, code: str) -> None:
        self.call("Page.navigate", url=url)
        self.wait("document.readyState === 'complete' && document.querySelector('#login')?.hidden === false")
        self.run(f"document.querySelector('#name').value = '{name}'; document.querySelector('#code').value = '{code}'")
        self.click("#login button")
        self.wait("!document.querySelector('#console').hidden")

    def freeze(self, number: int) -> None:
        """Send a signal to all processes of the browser."""
        os.killpg(self._process.pid, number)


@contextlib.contextmanager
def browser(folder: Path) -> Iterator[Tab]:
    """Start a Chromium with a profile of its own."""
    process = subprocess.Popen(
        [chromium(), *_FLAGS, f"--user-data-dir={folder}", "about:blank"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        port = _port(folder / "DevToolsActivePort")
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            pages = [one for one in json.load(answer) if one["type"] == "page"]
        with connect(pages[0]["webSocketDebuggerUrl"], max_size=None, proxy=None) as socket:
            yield Tab(socket, process)
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _port(path: Path) -> int:
    until = time.monotonic() + 20.0
    while time.monotonic() < until:
        with contextlib.suppress(OSError, IndexError, ValueError):
            return int(path.read_text().splitlines()[0])
        time.sleep(0.05)
    raise AssertionError("Chromium does not start")
