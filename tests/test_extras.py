"""Optional libraries that are missing: the main job goes on without them, and what needs one names its install line."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from lhdmap.cli.main import main
from lhdmap.errors import InstallationError
from lhdmap.extras import LIBRARIES, install_line, is_installed, library
from lhdmap.simulation.drive import simulate_drift
from lhdmap.simulation.pile_scenes import scene

from tests.exports.folders import map_folder

ROOT = Path(__file__).resolve().parents[1]
BLOCK = "import os, sys\nfor name in os.environ['BLOCKED'].split():\n    sys.modules[name] = None\n"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short drive up to a pile."""
    folder = tmp_path_factory.mktemp("log")
    scenario = scene("normal", 3)
    return simulate_drift(replace(scenario, truth=False), folder / "drive.mcap").log


def test_the_main_job_needs_no_extra(log: Path, tmp_path: Path) -> None:
    """In a Python, and in those that it starts, where no optional library can be imported."""
    map_folder(tmp_path / "mine")
    commands = [
        ["build-map", str(log), "-o", "map"],
        ["localize", str(log), "--map", "map", "-o", "run"],
        ["route", "mine", "DP1", "i2.t1"],
        ["pile", str(log), "-o", "pile"],
    ]
    built, localized, route, pile = _said(tmp_path, commands)
    warning = f"recording.rrd is left out: {install_line('rerun')}"
    assert built["warnings"].count(warning) == 1
    assert localized["tracking_share"] > 0.5
    assert warning in localized["stderr"]
    assert route["feasible"]
    assert pile["status"] == "loadable"
    for folder in ("map", "run", "pile"):
        assert (tmp_path / folder / "report.html").stat().st_size > 10_000
        assert not list((tmp_path / folder).glob("*.rrd"))


def _said(folder: Path, commands: list[list[str]]) -> list[dict[str, Any]]:
    """What commands print with --json, run one after the other in one process; `stderr` holds that of all."""
    (folder / "sitecustomize.py").write_text(BLOCK, encoding="utf-8")
    paths = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | {"BLOCKED": " ".join(LIBRARIES), "PYTHONPATH": paths}
    code = "import json, sys; from lhdmap.cli.main import main; print(*(main(one) for one in json.loads(sys.argv[1])))"
    command = [sys.executable, "-c", code, json.dumps([[*one, "--json"] for one in commands])]
    done = subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True, check=True)
    *objects, codes = done.stdout.splitlines()
    assert codes.split() == ["0"] * len(commands), done.stderr
    return [json.loads(one) | {"stderr": done.stderr} for one in objects]


@pytest.mark.parametrize(
    ("words", "extra"),
    [
        ("demo -o out", "sim"),
        ("simulate pile -o out.mcap", "sim"),
        ("view out.rrd --web", "view"),
        ("route map A B --picture out.rrd", "view"),
    ],
)
def test_what_needs_an_extra_names_it(
    words: str, extra: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in LIBRARIES:
        monkeypatch.setitem(sys.modules, name, None)
    (tmp_path / "out.rrd").touch()
    arguments = words.replace("route map", f"route {tmp_path}").split()
    assert main([*arguments, "--json", "--quiet"]) == 3
    error = json.loads(capsys.readouterr().out)["error"]
    assert error["kind"] == "installation"
    assert error["message"].startswith("not installed: ")
    assert error["message"].endswith(f"pip install 'lhdmap[{extra}]'")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.rrd"]


def test_each_library_is_named_with_an_extra_that_brings_it(monkeypatch: pytest.MonkeyPatch) -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    for name, found in LIBRARIES.items():
        assert any(one.startswith(found.distribution) for one in extras[found.extra]), name
        assert found.extra in extras["all"][0]
        monkeypatch.setitem(sys.modules, name, None)
        assert not is_installed(name)
        with pytest.raises(
            InstallationError, match=rf"not installed: {found.distribution}; pip install 'lhdmap\["
        ) as told:
            library(name)
        assert told.value.exit_code == 3


def test_a_library_that_is_there_and_does_not_load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As open3d where a shared library of the system is missing: the hint of open3d, and of nothing else."""
    text = "libGL.so.1: cannot open shared object file"
    for name in ("open3d", "ezdxf"):
        (tmp_path / f"{name}.py").write_text(f"raise ImportError({text!r})\n", encoding="utf-8")
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(InstallationError, match=rf"open3d cannot be loaded: {text}\n.*apt-get install libegl1"):
        library("open3d")
    with pytest.raises(InstallationError, match=rf"ezdxf cannot be loaded: {text}\npip install 'lhdmap\[export\]'"):
        library("ezdxf")


def test_a_missing_library_of_the_core_is_named_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    (tmp_path / "run.json").write_text("{}", encoding="utf-8")
    monkeypatch.setattr("lhdmap.cli.config.run", lambda *_: __import__("pyarrow"))
    assert main(["config"]) == 3
    said = capsys.readouterr().err
    assert "not installed: pyarrow; pip install --upgrade" in said
    assert "open3d" not in said
