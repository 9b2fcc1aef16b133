"""Measure what `pip install lhdmap` and each extra take: a fresh environment for each. `python -m tools.install_sizes`.

Writes the table of docs/install.md anew. A size is the sum of the files' sizes, compiled files with them, without
lhdmap's own; 1 MB = 1e6 bytes.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import tomllib
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "install.md"
BEGIN, END = "<!-- sizes: written by tools/install_sizes.py -->", "<!-- end of sizes -->"


class Size(NamedTuple):
    """What an environment takes: bytes, number of distributions, the largest of them with their bytes."""

    total_bytes: int
    distributions: int
    largest: list[tuple[str, int]]


def measured(python: str, wanted: str, folder: Path) -> Size:
    """Install a requirement into a fresh environment of a Python, and return what it takes."""
    subprocess.run([python, "-m", "venv", "--without-pip", str(folder)], check=True)
    own = folder / "bin" / "python"
    # as pip does it, but from a cache: a dozen environments in minutes
    install = [
        sys.executable,
        "-m",
        "uv",
        "pip",
        "install",
        "--quiet",
        "--compile-bytecode",
        "--python",
        str(own),
        wanted,
    ]
    subprocess.run(install, check=True, cwd=ROOT)
    (site,) = folder.glob("lib/python*/site-packages")
    own_bytes = _bytes(site / "lhdmap")
    sizes = {
        one.name: _of_distribution(one) for one in metadata.distributions(path=[str(site)]) if one.name != "lhdmap"
    }
    return Size(_bytes(site) - own_bytes, len(sizes), sorted(sizes.items(), key=lambda one: -one[1]))


def _bytes(folder: Path) -> int:
    return sum(file.lstat().st_size for file in folder.rglob("*") if file.is_file())


def _of_distribution(one: metadata.Distribution) -> int:
    """Return the size of a distribution as its wheel lists it, without compiled files."""
    files = [Path(str(one.locate_file(file))) for file in one.files or ()]
    return sum(file.stat().st_size for file in files if file.is_file())


def extras() -> list[str]:
    """Return the extras that users install."""
    table = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return [name for name in table["project"]["optional-dependencies"] if name not in ("dev", "docs")]


def rows(python: str, names: list[str]) -> list[str]:
    """Return the lines of the table, each as soon as it is measured."""
    lines = ["| install | MB | more than the core, MB | distributions | largest |", "| --- | --- | --- | --- | --- |"]
    core = 0
    for name in ["", *names]:
        with tempfile.TemporaryDirectory(prefix="sizes-") as folder:
            size = measured(python, f".[{name}]" if name else ".", Path(folder) / "env")
        core = core or size.total_bytes
        more = f"{(size.total_bytes - core) / 1e6:.0f}" if name else ""
        largest = ", ".join(f"{one} {count / 1e6:.0f}" for one, count in size.largest[:5])
        what = f"`lhdmap[{name}]`" if name else "`lhdmap`"
        lines.append(f"| {what} | {size.total_bytes / 1e6:.0f} | {more} | {size.distributions} | {largest} |")
        print(lines[-1], flush=True)
    return lines


def main() -> None:
    """Measure, and write the table into the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("extras", nargs="*", help="those to measure beside the core (default: all)")
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--print", action="store_true", help="leave docs/install.md as it is")
    arguments = parser.parse_args()
    lines = rows(arguments.python, arguments.extras or extras())
    if not arguments.print:
        text = PAGE.read_text(encoding="utf-8")
        head, _, rest = text.partition(BEGIN)
        PAGE.write_text("\n".join([head + BEGIN, *lines, END]) + rest.partition(END)[2], encoding="utf-8")


if __name__ == "__main__":
    main()
