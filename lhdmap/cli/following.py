"""A viewer that follows a run while it goes on: for `replay --view` and `live --view`."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
from collections.abc import Iterator

from lhdmap.cli.console import Console
from lhdmap.cli.viewer import started, viewer
from lhdmap.extras import require

_HOST = "127.0.0.1"


@contextlib.contextmanager
def viewer_of(port: int | None, console: Console, page: int | None = None) -> Iterator[None]:
    """Have a viewer follow the run: a window where there is a display, which stays open afterwards; else a page.

    Args:
        port: of the data; None: nobody follows.
        console: tells where the page is.
        page: port of the page, where one is wanted whatever there is.

    Raises:
        InstallationError: Rerun is not installed.
    """
    if port is None:
        yield
        return
    require("rerun")
    data = f"rerun+http://{_HOST}:{port}/proxy"
    windows = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY") or not sys.platform.startswith("linux")
    if windows and page is None:
        with started(viewer(data), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            yield
            console.note("the run has ended; close the window to go on")
            process.wait()
        return
    page = page or free_port()
    options = ("--serve-web", "--bind", _HOST, "--web-viewer-port", str(page), "--port", str(free_port()))
    with started(viewer(*options, data), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL):
        console.note(f"follow the run at http://{_HOST}:{page}/?url=rerun%2Bhttp://{_HOST}:{port}/proxy")
        yield


def free_port() -> int:
    """Return a port of this machine that nobody listens on."""
    with socket.create_server((_HOST, 0)) as server:
        return int(server.getsockname()[1])
