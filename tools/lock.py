"""Write the files of requirements/: distributions pinned, with the hashes of their wheels. `python -m tools.lock`.

One file for all platforms and Pythons: markers tell them apart. No address of a registry is in it.
"""

from __future__ import annotations

import itertools
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "requirements"
FILES = {"core": ["pyproject.toml"], "all": ["pyproject.toml", "--extra", "all"], "build": ["-"]}
X86_64, AARCH64 = "x86_64-manylinux_2_35", "aarch64-manylinux_2_35"  # glibc of Ubuntu 22.04; Debian 12 has 2.36
PYTHONS = ("3.11", "3.12", "3.13")
HEAD = "# Written by tools/lock.py: pip install --require-hashes --only-binary :all: -r requirements/{}.txt\n"


def resolved(*more: str, timeout_s: float = 300.0) -> str:
    """Return what uv resolves of a file, wheels alone; an error of uv is raised as CalledProcessError."""
    command = [sys.executable, "-m", "uv", "pip", "compile", *more, "--quiet", "--only-binary", ":all:"]
    plain = ["--no-header", "--no-annotate", "--no-emit-index-url", "--no-emit-find-links"]
    return subprocess.run(
        [*command, *plain], cwd=ROOT, check=True, capture_output=True, text=True, timeout=timeout_s, input=_build()
    ).stdout


def _build() -> str:
    """Return what builds the wheel, a line each: uv reads them where `-` is asked for."""
    table = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return "\n".join(table["build-system"]["requires"])


def pinned_for(platform: str, python: str, timeout_s: float = 300.0) -> str:
    """Return what of requirements/all.txt a platform and a Python get; CalledProcessError where a wheel is missing."""
    pins = ("pyproject.toml", "--extra", "all", "--constraint", str(FOLDER / "all.txt"))
    return resolved(*pins, "--python-platform", platform, "--python-version", python, timeout_s=timeout_s)


def main() -> None:
    """Write the files anew, and see that there are wheels of all of it."""
    FOLDER.mkdir(exist_ok=True)
    for name, asked in FILES.items():
        text = resolved(*asked, "--universal", "--python-version", "3.11", "--generate-hashes")
        (FOLDER / f"{name}.txt").write_text(HEAD.format(name) + text, encoding="utf-8")
    for platform, python in itertools.product((X86_64, AARCH64), PYTHONS):
        print(f"{platform}, Python {python}: {pinned_for(platform, python).count('==')} distributions")


if __name__ == "__main__":
    main()
