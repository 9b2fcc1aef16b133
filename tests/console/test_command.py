"""`lhdmap console` and `--operator` on the command line."""

from __future__ import annotations

import builtins
import importlib.util
import io
import json
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from lhdmap.cli.console import Console
from lhdmap.cli.main import main

EXTRA = all(importlib.util.find_spec(name) for name in ("starlette", "uvicorn", "websockets", "pyotp"))
needs_extra = pytest.mark.skipif(not EXTRA, reason="the extra console is not installed")


def said(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, dict[str, Any]]:
    exit_code = main([*words, "--json"])
    return exit_code, json.loads(capsys.readouterr().out or "{}")


@needs_extra
def test_an_operator_is_added_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("console", "--folder", str(tmp_path), "--new-operator", "anna")
    exit_code, told = said(capsys, *words)
    assert exit_code == 0
    assert told["uri"].startswith("otpauth://totp/")
    exit_code, told = said(capsys, *words)
    assert exit_code == 2
    assert "is there already" in told["error"]["message"]


@needs_extra
@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ((), "--new-operator"),
        (("--host", "0.0.0.0"), "--certificate"),  # noqa: S104  # that is what is refused
        (("--host", "0.0.0.0", "--origin", "https://mine.example"), "--certificate"),  # noqa: S104
        (("--viewer", "javascript:alert(1)"), "--viewer"),
        (("--certificate", "x.pem"), "both or none"),
        (("--kept", "journal.jsonl"), "--check-audit"),
        (("--set", "console.tick_s=0.4"), "three ticks"),
    ],
)
def test_what_would_not_be_safe_or_does_not_fit_is_refused(
    words: tuple[str, ...], wanted: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    exit_code, told = said(capsys, "console", "--folder", str(tmp_path), *words)
    assert exit_code == 2
    assert wanted in told["error"]["message"]


@needs_extra
def test_a_port_that_is_taken_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said(capsys, "console", "--folder", str(tmp_path), "--new-operator", "anna")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        exit_code, told = said(capsys, "console", "--folder", str(tmp_path), "--port", port)
    assert exit_code == 3
    assert "cannot listen" in told["error"]["message"]


@needs_extra
def test_it_serves_until_ctrl_c_on_this_machine_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said(capsys, "console", "--folder", str(tmp_path), "--new-operator", "anna")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "lhdmap", "console", "--folder", str(tmp_path), "--port", str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline().split() == ["console", f"http://127.0.0.1:{port}"]
        with socket.create_connection(("127.0.0.1", port), 5.0):
            pass
        assert _bound(port) == {"0100007F"}
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 4
        assert process.stderr is not None
        assert process.stderr.read().strip() == "lhdmap: interrupted"


def _bound(port: int) -> set[str]:
    """Return the addresses (as the kernel writes them) that this port is listened on; the test needs Linux for it."""
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return {row[1].split(":")[0] for row in rows if row[3] == "0A" and int(row[1].split(":")[1], 16) == port}


@pytest.fixture
def without_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    real = builtins.__import__

    def refuse(name: str, *more: Any) -> Any:
        if name.partition(".")[0] in ("starlette", "uvicorn", "websockets", "pyotp"):
            raise ImportError(name)
        return real(name, *more)

    monkeypatch.setattr(builtins, "__import__", refuse)


@pytest.mark.usefixtures("without_extra")
@pytest.mark.parametrize("words", [("console",), ("replay", "tram_short", "--operator", "console")])
def test_what_is_not_installed_is_told_with_the_line_that_installs_it(
    words: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    exit_code, told = said(capsys, *words)
    assert exit_code == 3
    assert "uvicorn" in told["error"]["message"]
    assert "; pip install 'lhdmap[console]'" in told["error"]["message"]


@pytest.mark.parametrize(
    ("words", "exit_code", "wanted"),
    [
        (("tram_short", "--operator", "nobody"), 2, "script, terminal, console"),
        (("tram_short", "--operator", "console:ftp://x"), 2, "http://HOST:PORT"),
        (("tram_short", "--operator", "console", "--speed", "0"), 2, "0.01 to 100"),
        (("tram_short", "--operator", "console"), 3, "machine.key"),
        (("ring_manual", "--operator", "terminal"), 2, "nobody asks"),
        (("grizzly_twelve", "--operator", "terminal"), 2, "nobody asks"),
        (("tram_short", "--view-port", "9000"), 2, "--view"),
        (("tram_short", "--operator", "terminal", "--quiet"), 2, "a terminal asks"),
    ],
)
def test_an_operator_that_cannot_be_is_refused(
    words: tuple[str, ...], exit_code: int, wanted: str, tmp_path: Path,
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    if not EXTRA and "console" in " ".join(words):
        pytest.skip("the extra console is not installed")
    monkeypatch.chdir(tmp_path)
    got, told = said(capsys, "replay", *words, "--folder", str(tmp_path / "none"))
    assert got == exit_code
    assert wanted in told["error"]["message"]


@needs_extra
def test_a_console_that_does_not_answer_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from lhdmap.console.link import MachineLink
    from lhdmap.console.operators import machine_key

    machine_key(tmp_path, make=True)
    monkeypatch.setattr(MachineLink.connect, "__defaults__", (0.3,))
    monkeypatch.chdir(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    words = ("replay", "tram_short", "--operator", f"console:http://127.0.0.1:{port}", "--folder", str(tmp_path))
    exit_code, told = said(capsys, *words)
    assert exit_code == 3
    assert "`lhdmap console` starts one" in told["error"]["message"]


def test_a_prompt_is_on_standard_error_alone(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
    assert Console(json=True).ask("arm? ") == "y"
    assert capsys.readouterr() == ("", "arm? ")
