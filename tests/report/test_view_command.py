"""`lhdmap view` through the entry point: what can be shown, and clear errors for what cannot."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from lhdmap.cli.main import main
from lhdmap.cli.view import recording_of
from lhdmap.cli.viewer import check_recording
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import LaserScan
from lhdmap.report.recording import RecordingWriter
from lhdmap.runfolder import RunFolderWriter, RunInfo

from tests.report.synthetic import START_NS


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "drive.mcap"
    with LogWriter(path) as writer:
        for number in range(30):
            stamp = START_NS + number * 40_000_000
            ranges = np.full(91, 3.0, np.float32)
            writer.write("/lidar/front/scan", LaserScan(stamp, "laser", -1.57, 0.0349, 0.0, 0.1, 30.0, ranges))
    return path


@pytest.fixture
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)


def test_no_display_says_what_else_there_is(log: Path, no_display: None, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["view", str(log)]) == 2
    assert "--web" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "text"), [("none.rrd", "no such file"), ("empty", "unknown format"), ("map", "no recording.rrd")]
)
def test_what_cannot_be_shown_is_an_error(
    tmp_path: Path, name: str, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "map").mkdir()
    (tmp_path / "map" / "map.json").write_text("{}")
    (tmp_path / "empty").write_text("what is this")
    assert main(["view", str(tmp_path / name), "--screenshot", str(tmp_path / "s.png")]) == 3
    assert text in capsys.readouterr().err
    assert not (tmp_path / "s.png").exists()


def test_a_log_becomes_a_picture_or_an_error_that_names_the_driver(
    tmp_path: Path, log: Path, no_display: None, capsys: pytest.CaptureFixture[str]
) -> None:
    picture, recording = tmp_path / "s.png", tmp_path / "kept.rrd"
    code = main(["view", str(log), "--screenshot", str(picture), "-o", str(recording), "--json"])
    output = capsys.readouterr()
    assert recording.stat().st_size > 1000
    if code == 0:
        assert json.loads(output.out) == {"recording": str(recording), "screenshot": str(picture)}
        assert picture.read_bytes().startswith(b"\x89PNG")
    else:  # a machine without any Vulkan driver
        assert (code, "mesa-vulkan-drivers" in output.err) == (3, True)


def test_a_recording_is_not_overwritten(tmp_path: Path, log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with RecordingWriter(tmp_path / "old.rrd", "old", START_NS) as writer:
        writer.add_text("old")
    before = (tmp_path / "old.rrd").read_bytes()
    assert main(["view", str(log), "--screenshot", str(tmp_path / "s.png"), "-o", str(tmp_path / "old.rrd")]) == 2
    assert (tmp_path / "old.rrd").read_bytes() == before
    assert "exists already" in capsys.readouterr().err


def written(path: Path) -> Path:
    """Write a recording."""
    with RecordingWriter(path, "r", START_NS) as writer:
        for number in range(50):
            writer.add_scan(START_NS + number * 1_000_000_000, np.random.default_rng(number).normal(size=(500, 3)))
        writer.add_text("hello")
    return path


def broken(path: Path, how: str) -> Path:
    """Break a recording: a share of its bytes is cut off, its start is another file's, or bytes in the middle are others."""
    data = bytearray(written(path).read_bytes())
    middle = len(data) // 2
    match how:
        case "text":
            data = bytearray(b"hello\n")
        case "nothing":
            data = bytearray()
        case "magic":
            data = data[:4]
        case "inside":  # not only what is drawn, but where its parts begin
            data[64:middle] = bytes(middle - 64)
        case "start":
            data[:4] = b"PK12"
        case share:
            data = data[: int(float(share) * len(data))]
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("how", ["text", "nothing", "magic", "start", "inside", "0.1", "0.5", "0.9", "0.999"])
def test_a_broken_recording_is_refused_before_a_viewer_opens(
    how: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = broken(tmp_path / "b.rrd", how)
    started = time.monotonic()
    for words in (["--web"], ["--screenshot", str(tmp_path / "s.png")]):
        assert main(["view", str(path), *words]) == 3
        assert "b.rrd" in capsys.readouterr().err
    assert time.monotonic() - started < 10.0
    assert not (tmp_path / "s.png").exists()


def test_a_whole_recording_is_not_refused(tmp_path: Path) -> None:
    check_recording(written(tmp_path / "whole.rrd"))


@pytest.mark.parametrize("name", ["recording.rrd", "pile.rrd", "other.rrd"])
def test_the_recording_of_any_run_is_found(name: str, tmp_path: Path) -> None:
    with RunFolderWriter("replay", tmp_path / "run") as folder:
        written(folder.path / name)
        run = folder.complete(RunInfo())
    assert recording_of(run) == run / name
    with RunFolderWriter("demo", tmp_path / "demo") as folder:
        run.rename(folder.path / "inner")
        demo = folder.complete(RunInfo(more={"map": "inner"}))
    assert recording_of(demo) == demo / "inner" / name


def test_a_port_that_is_taken_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert main(["view", str(written(tmp_path / "r.rrd")), "--web", "--port", str(port)]) == 2
    assert f"port {port} is in use" in capsys.readouterr().err


def test_web_serves_this_machine_only_until_interrupted(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "r.rrd", "r", START_NS) as writer:
        writer.add_text("hello")
    port = free_port()
    code = "from lhdmap.cli.main import entry_point; entry_point()"
    command = [sys.executable, "-c", code, "view", str(tmp_path / "r.rrd"), "--web", "--port", str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line == f"http://127.0.0.1:{port}/?url=rerun%2Bhttp://127.0.0.1:{port + 1}/proxy\n"
        assert b"<!doctype html>" in page_of(port).lower()
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=20) == 4
        assert process.stdout.read() == "", "the address is the last line"
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", port), timeout=1)


def free_port() -> int:
    """Return a port with a free one after it."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def page_of(port: int) -> bytes:
    """Return the page once the server answers."""
    for _ in range(100):
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=5) as answer:
                return bytes(answer.read())
        except OSError:
            time.sleep(0.1)
    raise AssertionError("the server did not answer within 10 s")
