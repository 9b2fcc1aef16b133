"""What `make setup` does on a machine that lacks something."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[1] / "tools" / "system_packages.sh"
LIBRARIES = "libEGL.so.1 libGL.so.1 libX11.so.6 libusb-1.0.so.0"

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the script is for Linux")


def _run(folder: Path, *, libraries: str, user: int, python: str = sys.executable) -> subprocess.CompletedProcess[str]:
    """Run the script where the machine has these shared libraries and the user has this id."""
    tools = {"ldconfig": f"echo {libraries}", "id": f"echo {user}", "apt-get": f'echo "apt-get $*" >> {folder}/called'}
    for name, body in tools.items():
        (folder / name).write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
        (folder / name).chmod(0o755)
    environment = os.environ | {"PATH": f"{folder}:{os.environ['PATH']}"}
    return subprocess.run(["sh", str(SCRIPT), python], env=environment, capture_output=True, text=True, check=False)


def test_a_complete_machine_is_left_alone(tmp_path: Path) -> None:
    done = _run(tmp_path, libraries=LIBRARIES, user=0)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert not (tmp_path / "called").exists()


def test_root_gets_what_is_missing(tmp_path: Path) -> None:
    done = _run(tmp_path, libraries="libX11.so.6 libusb-1.0.so.0", user=0)
    assert done.returncode == 0
    called = (tmp_path / "called").read_text(encoding="utf-8").splitlines()
    assert called == ["apt-get update -qq", "apt-get install -y --no-install-recommends libegl1 libgl1 -qq"]


def test_others_are_told_the_line(tmp_path: Path) -> None:
    done = _run(tmp_path, libraries="libEGL.so.1 libGL.so.1", user=1000)
    assert done.returncode == 1
    assert "sudo apt-get install -y --no-install-recommends libx11-6 libusb-1.0-0\n" in done.stderr
    assert not (tmp_path / "called").exists()


def test_a_python_without_venv_is_missing_its_package(tmp_path: Path) -> None:
    python = tmp_path / "python3.11"
    python.write_text('#!/bin/sh\ncase "$*" in *ensurepip*) exit 1;; esac\nexit 0\n', encoding="utf-8")
    python.chmod(0o755)
    done = _run(tmp_path, libraries=LIBRARIES, user=1000, python=str(python))
    assert done.returncode == 1
    assert "python3-venv" in done.stderr


@pytest.mark.parametrize("python", ["", "/bin/false"])
def test_no_fitting_python_is_said(tmp_path: Path, python: str) -> None:
    done = _run(tmp_path, libraries=LIBRARIES, user=0, python=python)
    assert done.returncode == 1
    assert "Python 3.11 to 3.13 was wanted" in done.stderr
