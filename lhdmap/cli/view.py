"""`lhdmap view PATH`: opens a map folder, a recording or a log in the Rerun viewer, a browser, or as a picture."""

from __future__ import annotations

import argparse
import importlib.util
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from lhdmap.cli.console import Console
from lhdmap.errors import InputError, UsageError
from lhdmap.names import in_utf8, name_of

WINDOW = "1600x1000"
SCREENSHOT_LIMIT_S = 180.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `lhdmap view`."""
    parser.add_argument("path", type=Path, help="map folder, recording (.rrd) or log")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--web", action="store_true", help="serve to a browser on this machine until interrupted")
    how.add_argument("--screenshot", type=Path, metavar="PNG", help="no window: write a picture of the viewer")
    parser.add_argument(
        "--bind", default="127.0.0.1", help="with --web, address to serve on (default: this machine only)"
    )
    parser.add_argument(
        "--port", type=int, default=9090, help="with --web, port of the page; the data is on the next one"
    )
    parser.add_argument("--topic", action="append", default=[], metavar="ROLE=TOPIC", help="of a log, as in build-map")
    parser.add_argument("-o", "--output", type=Path, metavar="RRD", help="of a log, keep the recording in this file")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Find or make the recording, then show it."""
    if not arguments.path.exists():
        raise InputError(f"{arguments.path}: no such file or folder; a map folder, a .rrd file or a log was wanted")
    if not (arguments.web or arguments.screenshot or _has_display()):
        raise UsageError("no display was found (DISPLAY is not set); use --web for a browser, or --screenshot OUT.png")
    with tempfile.TemporaryDirectory(prefix="lhdmap-") as folder:
        recording = _recording(arguments, Path(folder), console)
        if arguments.screenshot:
            _screenshot(recording, arguments.screenshot)
            values = {"recording": str(recording), "screenshot": str(arguments.screenshot)}
            console.result(values, f"screenshot: {arguments.screenshot}")
            return 0
        return _serve(recording, arguments, console) if arguments.web else _open_window(recording)


def _recording(arguments: argparse.Namespace, folder: Path, console: Console) -> Path:
    """Return the recording of what was asked for; that of a log is made first.

    Raises:
        InputError: there is nothing to show at the path.
    """
    path: Path = arguments.path
    if path.suffix == ".rrd":
        return path
    if path.is_dir() and ((path / "map.json").exists() or (path / "recording.rrd").exists()):
        if not (path / "recording.rrd").is_file():
            raise InputError(f"{path}: the map folder has no recording.rrd; run build-map again")
        return path / "recording.rrd"
    return _recorded_log(arguments, folder, console)


def _recorded_log(arguments: argparse.Namespace, folder: Path, console: Console) -> Path:
    from lhdmap.logs.source import LogSource
    from lhdmap.report.log_recording import LogRecorder

    target: Path = arguments.output or folder / "log.rrd"
    if target.exists():
        raise UsageError(f"{target}: is there already; name another file with -o")
    with LogSource(arguments.path, _overrides(arguments.topic)) as source:
        start_ns = source.start_ns or 0
        messages = console.progress(
            source.messages(),
            total=source.duration_s,
            label="reading",
            position=lambda item: (item[1].stamp_ns - start_ns) / 1e9,
        )
        recorder = LogRecorder(target, name_of(arguments.path))
        for role, message in messages:
            recorder.update(role, message)
        recorder.finish([*source.damage, *source.warnings])
    console.note(f"{recorder.scans} scans recorded, ten a second; build-map makes a map of them")
    return target


def _overrides(pairs: list[str]) -> dict[str, str]:
    named = dict(pair.split("=", 1) for pair in pairs if "=" in pair)
    if len(named) != len(pairs):
        raise UsageError(f"--topic {' '.join(pairs)}: ROLE=TOPIC was wanted, e.g. --topic front=/scan")
    return named


def _has_display() -> bool:
    if not sys.platform.startswith("linux"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _viewer(*options: str) -> list[str]:
    """Return the command line of the viewer that comes with the package rerun-sdk: its program, else its module."""
    spec = importlib.util.find_spec("rerun_cli")
    for folder in (spec.submodule_search_locations or []) if spec else []:
        program = Path(folder) / ("rerun.exe" if sys.platform == "win32" else "rerun")
        if program.is_file():
            return [str(program), *options]
    return [sys.executable, "-m", "rerun", *options]


def _open_window(recording: Path) -> int:
    """Run the viewer until its window is closed."""
    with in_utf8(recording) as opened:
        return 0 if subprocess.run(_viewer(str(opened)), check=False).returncode == 0 else InputError.exit_code  # noqa: S603


def _serve(recording: Path, arguments: argparse.Namespace, console: Console) -> int:
    """Serve the viewer and the recording until interrupted."""
    host, data_port = arguments.bind, arguments.port + 1
    url = f"http://{host}:{arguments.port}/?url=rerun%2Bhttp://{host}:{data_port}/proxy"
    console.result({"recording": str(recording), "url": url}, f"open {url}  (Ctrl-C ends)")
    sys.stdout.flush()
    ports = ("--port", str(data_port), "--web-viewer-port", str(arguments.port))
    with (
        in_utf8(recording) as opened,
        subprocess.Popen(_viewer("--bind", host, "--serve-web", *ports, str(opened))) as viewer,  # noqa: S603
    ):
        try:
            exit_code = viewer.wait()
        finally:  # after Ctrl-C too, nothing serves any more once the command has ended
            viewer.kill()
            viewer.wait()
    if exit_code != 0:
        raise InputError(f"the web viewer ended with code {exit_code}; is port {arguments.port} in use? see --port")
    return 0


def _screenshot(recording: Path, target: Path) -> None:
    """Write a picture of the viewer; the recording goes in by standard input, so that all of it is there in time.

    Raises:
        InputError: the viewer could not draw.
    """
    target.unlink(missing_ok=True)
    try:
        with recording.open("rb") as data, in_utf8(target) as drawn:
            command = _viewer("--headless", "--screenshot-to", str(drawn), "--window-size", WINDOW, "-")
            done = subprocess.run(  # noqa: S603
                command, stdin=data, capture_output=True, text=True, check=False, timeout=SCREENSHOT_LIMIT_S
            )
    except subprocess.TimeoutExpired:
        raise InputError(f"{recording}: no picture after {SCREENSHOT_LIMIT_S:.0f} s; try --web") from None
    if done.returncode != 0 or not target.is_file():
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise InputError(f"{recording}: the viewer could not draw ({last}); on Debian it needs mesa-vulkan-drivers")
