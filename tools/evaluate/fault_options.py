"""What the tools that drive with random faults are told on the command line, and how they write a page of lines printed before."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

Page = Callable[[Sequence[dict[str, Any]]], str]


def fault_parser(description: str | None, scenario: str, until_s: float, keep: str) -> argparse.ArgumentParser:
    """Return the parser: defaults are a scenario that ships, the latest begin of a fault (s), and a folder."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("scenario", nargs="?", type=Path, default=Path("pipelines/scenarios") / scenario)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0, help="of the first run")
    parser.add_argument("--most", type=int, default=3, help="faults of a run at most")
    parser.add_argument("--until", type=float, default=until_s, help="latest begin of a fault, s")
    parser.add_argument("--keep", type=Path, default=Path(keep), help="folder for the map and runs that miss")
    parser.add_argument(
        "--lines", type=Path, nargs="*", default=[], help="what runs before have printed, for the page alone"
    )
    parser.add_argument("--page", type=Path, help="page to write")
    return parser


def wrote_page(asked: argparse.Namespace, page: Page) -> bool:
    """Write the page of `--lines`, where they are given; return whether they are."""
    texts = [line for path in asked.lines for line in path.read_text(encoding="utf-8").splitlines()]
    if asked.lines:
        asked.page.write_text(page([one for one in map(json.loads, texts) if "seed" in one]), encoding="utf-8")
    return bool(asked.lines)
