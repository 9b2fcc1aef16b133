"""`lhdmap view PATH`: opens a map or run folder, a recording or a log in the Rerun viewer, a browser, or as a picture."""

from __future__ import annotations

import argparse
import contextlib
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_output, add_topics, topic_overrides
from lhdmap.cli.viewer import check_recording, started, viewer
from lhdmap.descriptions import described, kind_of
from lhdmap.errors import InputError, UsageError
from lhdmap.extras import require
from lhdmap.interrupts import before_interrupt
from lhdmap.names import in_utf8, name_of
from lhdmap.outputs import OutputFiles, free_files

WINDOW = "1600x1000"
SCREENSHOT_LIMIT_S = 180.0
_SERVER_LIMIT_S = 30.0
_LAST_PORT = 65535
RECORDINGS = ("recording.rrd", "pile.rrd")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `lhdmap view`."""
    parser.add_argument(
        "path", type=Path, metavar="PATH", help="map or run folder, topology.geojson, recording (.rrd) or log"
    )
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--web", action="store_true", help="serve to a browser on this machine until interrupted")
    how.add_argument("--screenshot", type=Path, metavar="PNG", help="no window: write a picture of the viewer")
    parser.add_argument(
        "--bind", default="127.0.0.1", help="with --web, address to serve on (default: this machine only)"
    )
    parser.add_argument(
        "--port", type=_port, default=9090, help="with --web, port of the page; the data is on the next one"
    )
    add_topics(parser, "of a log, as in build-map")
    add_output(parser, "of a log, keep the recording in this file", "RRD")


def _port(text: str) -> int:
    if not (text.isdecimal() and 0 < int(text) < _LAST_PORT):
        raise argparse.ArgumentTypeError(f"'{text}': a number from 1 to {_LAST_PORT - 1} was wanted")
    return int(text)


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Find or make the recording, then show it."""
    if not arguments.path.exists():
        raise InputError(f"{arguments.path}: no such file or folder; a map folder, a .rrd file or a log was wanted")
    if not (arguments.web or arguments.screenshot or _has_display()):
        raise UsageError("no display was found (DISPLAY is not set); use --web for a browser, or --screenshot OUT.png")
    require("rerun")
    new = [path for path in (arguments.output, arguments.screenshot) if path is not None]
    free_files(new, force=arguments.force, inputs=[arguments.path])
    with _temporary_folder() as folder:
        recording = _recording(arguments, folder, console)
        check_recording(recording)
        if arguments.screenshot:
            _screenshot(recording, arguments.screenshot, force=arguments.force)
            values = {"recording": str(recording), "screenshot": str(arguments.screenshot)}
            console.result(values, f"screenshot: {arguments.screenshot}")
            return 0
        return _serve(recording, arguments, console) if arguments.web else _open_window(recording)


@contextlib.contextmanager
def _temporary_folder() -> Iterator[Path]:
    """Make a folder that is gone afterwards, after Ctrl-C too."""
    with tempfile.TemporaryDirectory(prefix="lhdmap-", ignore_cleanup_errors=True) as name:

        def end() -> None:
            shutil.rmtree(name, ignore_errors=True)

        with before_interrupt(end):
            yield Path(name)


def _recording(arguments: argparse.Namespace, folder: Path, console: Console) -> Path:
    """Return the recording of what was asked for; that of a log is made first.

    Raises:
        InputError: there is nothing to show at the path.
    """
    path: Path = arguments.path
    if path.suffix == ".rrd" and path.is_file():
        return path
    if path.suffix == ".geojson":
        return _recorded_topology(path, folder)
    if path.is_dir():
        found = recording_of(path)
        if found is not None:
            return found
        if kind_of(path) is not None or (path / "map.json").exists():
            raise InputError(f"{path}: the folder has no recording.rrd; make it anew with the command that made it")
    return _recorded_log(arguments, folder, console)


def recording_of(folder: Path) -> Path | None:
    """Return the recording in a map or run folder, or in the map of a run; None where there is none."""
    inner = [folder / str(name) for name in [(described(folder) or {}).get("map")] if name]
    for place in (folder, *inner):
        known = [place / name for name in RECORDINGS if (place / name).is_file()]
        found = known or sorted(place.glob("*.rrd"))
        if found:
            return found[0]
    return None


def _recorded_topology(path: Path, folder: Path) -> Path:
    from lhdmap.report.topology_recording import write_topology_recording
    from lhdmap.topology.files import read_topology

    target = folder / "topology.rrd"
    write_topology_recording(target, name_of(path), read_topology(path))
    return target


def _recorded_log(arguments: argparse.Namespace, folder: Path, console: Console) -> Path:
    from lhdmap.logs.source import LogSource
    from lhdmap.report.log_recording import LogRecorder

    target: Path = arguments.output or folder / "log.rrd"
    with (
        OutputFiles(target, force=arguments.force, inputs=[arguments.path]) as files,
        LogSource(arguments.path, topic_overrides(arguments.topic)) as source,
    ):
        start_ns = source.start_ns or 0
        messages = console.progress(
            source.messages(),
            total=source.duration_s,
            label="reading",
            position=lambda item: (item[1].stamp_ns - start_ns) / 1e9,
        )
        recorder = LogRecorder(files.at(target), name_of(arguments.path))
        for role, message in messages:
            recorder.update(role, message)
        recorder.finish([*source.damage, *source.warnings])
    console.note(f"{recorder.scans} scans recorded, ten a second; build-map makes a map of them")
    return target


def _has_display() -> bool:
    if not sys.platform.startswith("linux"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _open_window(recording: Path) -> int:
    """Run the viewer until its window is closed."""
    with in_utf8(recording) as opened, started(viewer(str(opened))) as process:
        exit_code = process.wait()
    if exit_code != 0:
        raise InputError(f"the viewer ended with code {exit_code}; --web shows the recording in a browser")
    return 0


def _serve(recording: Path, arguments: argparse.Namespace, console: Console) -> int:
    """Serve the viewer and the recording until interrupted; the last line that is printed is the address alone."""
    host, data_port = arguments.bind, arguments.port + 1
    url = f"http://{host}:{arguments.port}/?url=rerun%2Bhttp://{host}:{data_port}/proxy"
    for port in (arguments.port, data_port):
        if _answers(host, port):
            raise UsageError(f"port {port} is in use; --port names another, the one after it must be free too")
    ports = ("--port", str(data_port), "--web-viewer-port", str(arguments.port))
    with (
        in_utf8(recording) as opened,
        tempfile.TemporaryFile("w+") as said,
        started(viewer("--bind", host, "--serve-web", *ports, str(opened)), stdout=said, stderr=said) as process,
    ):
        _wait_for(process, host, arguments.port)
        if process.poll() is None:
            console.note("open this address in a browser; Ctrl-C ends")
            console.result({"recording": str(recording), "url": url}, url, at_once=True)
        exit_code = process.wait()
        said.seek(0)
        last = (said.read().strip().splitlines() or ["no message"])[-1]
    if exit_code != 0:
        raise InputError(f"the web viewer ended with code {exit_code} ({last}); is the port in use? see --port")
    return 0


def _wait_for(process: subprocess.Popen[str], host: str, port: int) -> None:
    """Wait until the page is served, or the viewer has ended."""
    until = time.monotonic() + _SERVER_LIMIT_S
    while process.poll() is None and time.monotonic() < until and not _answers(host, port):
        time.sleep(0.05)


def _answers(host: str, port: int) -> bool:
    try:
        with socket.create_connection((host if host not in ("0.0.0.0", "::") else "127.0.0.1", port), timeout=1.0):  # noqa: S104
            return True
    except OSError:
        return False


def _screenshot(recording: Path, target: Path, *, force: bool) -> None:
    """Write a picture of the viewer; the recording goes in by standard input, so that all of it is there in time.

    Raises:
        InputError: the viewer could not draw.
    """
    with (
        OutputFiles(target, force=force) as files,
        recording.open("rb") as data,
        in_utf8(files.at(target)) as drawn,
    ):
        picture = files.at(target)
        command = viewer("--headless", "--screenshot-to", str(drawn), "--window-size", WINDOW, "-")
        with started(command, stdin=data, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            try:
                _, errors = process.communicate(timeout=SCREENSHOT_LIMIT_S)
            except subprocess.TimeoutExpired:
                raise InputError(f"{recording}: no picture after {SCREENSHOT_LIMIT_S:.0f} s; try --web") from None
        if process.returncode != 0 or not picture.is_file():
            last = (errors.strip().splitlines() or ["no message"])[-1]
            raise InputError(f"{recording}: the viewer could not draw ({last}); on Debian it needs mesa-vulkan-drivers")
