"""Ctrl-C at some moments of some commands (`python -m tools.ctrl_c` takes all of all): exit code 4, and nothing false said."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from lhdmap.cli.main import main
from tools.ctrl_c import problem

from tests.cli.logs import write_room_log


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_room_log(tmp_path_factory.mktemp("ctrl-c") / "room.mcap", 400)


@pytest.mark.parametrize("delay_s", [0.1, 0.4, 0.9, 1.6, 2.6])
@pytest.mark.parametrize("command", ["build-map {log} -o {{out}} --json", "pile {log} -o {{out}}"])
def test_a_run_that_is_interrupted(command: str, delay_s: float, log: Path, tmp_path: Path) -> None:
    words = command.format(log=log).split()
    assert problem(words, tmp_path / "made" / "out", delay_s) == ""


@pytest.mark.parametrize("delay_s", [0.15, 0.5])
@pytest.mark.parametrize("command", ["doctor {log}", "view {log} --web --port 9377", "simulate drift -o {{out}}.mcap"])
def test_others_that_are_interrupted(command: str, delay_s: float, log: Path, tmp_path: Path) -> None:
    assert problem(command.format(log=log).split(), tmp_path / "made" / "out", delay_s) == ""


SLOW = """\
import os, signal, sys, threading
import lhdmap.{module} as module

def interrupted(*_, **__):
    os.kill(os.getpid(), signal.SIGINT)
    threading.Event().wait(30)

module.{name} = interrupted
sys.argv = ["lhdmap", *{words!r}]
from lhdmap.cli.start import entry_point
entry_point()
"""


@pytest.mark.parametrize(
    ("module", "name", "kept"),
    [("pipeline.build", "MappingPipeline", []), ("pipeline.build", "MapOutcome", ["odometry.tum", "trajectory.tum"])],
)
def test_what_is_kept_is_said_and_nothing_else(
    module: str, name: str, kept: list[str], log: Path, tmp_path: Path
) -> None:
    """Inside a part of the run that takes long."""
    words = ["build-map", str(log), "-o", str(tmp_path / "map"), "--one-process", "--json", "--quiet"]
    code = SLOW.format(module=module, name=name, words=words)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=240)
    told = json.loads(done.stdout)["error"]
    assert (done.returncode, told["exit_code"], told["kind"]) == (4, 4, "interrupted")
    partial = tmp_path / "map.partial"
    assert (f"kept in {partial}" in told["message"]) == partial.exists() == bool(kept)
    assert {path.name for path in partial.glob("*")} >= set(kept)
    assert told["message"] in done.stderr


def test_in_the_program_of_somebody_else_it_is_an_exception(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("lhdmap.cli.config.run", interrupted)
    assert main(["config", "--json"]) == 4
    told = capsys.readouterr()
    assert json.loads(told.out) == {"error": {"kind": "interrupted", "message": "interrupted", "exit_code": 4}}
    assert told.err == "lhdmap: interrupted\n"


def test_the_table_of_what_was_evaluated_before(tmp_path: Path, log: Path) -> None:
    (tmp_path / "t.csv").write_text(
        f"attempt,log,gt_width_m,gt_inclination_deg\nA,{log},3,-30\nB,{log},3,-30\n", encoding="utf-8"
    )
    words = ["eval", "pile", "--truth", str(tmp_path / "t.csv"), "--json"]
    code = f"""\
import os, signal, sys
import lhdmap.pipeline.identify as module
whole, calls = module.identify, []

def identify(*given):
    calls.append(given)
    if len(calls) == 2:
        os.kill(os.getpid(), signal.SIGINT)
    return whole(*given)

module.identify = identify
sys.argv = ["lhdmap", *{words!r}]
from lhdmap.cli.start import entry_point
entry_point()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=240)
    found = json.loads(done.stdout)
    assert done.returncode == found["error"]["exit_code"] == 4
    assert [row["attempt"] for row in found["rows"]] == ["A"]
