"""Figures of loading: measured part by part into evaluation/loading.json, and written as a page.

    python -m tools.evaluate.loading weighing detection tables methods errata attempts
    python -m tools.evaluate.loading page

Loads are seeds from 1000 on; those of the searches are below (`tools.evaluate.loading_tune`).
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from tools.evaluate import loading_figures, loading_page

DATA, PAGE = Path("evaluation/loading.json"), Path("evaluation/loading.md")


def main() -> int:
    """Measure the parts that are named, then write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="+", choices=[*loading_figures.PARTS, "page"])
    parser.add_argument("--loads", type=int, default=0, help="fewer, for a trial: nothing is written")
    asked = parser.parse_args()
    found: dict[str, Any] = json.loads(DATA.read_text(encoding="utf-8")) if DATA.is_file() else {}
    for part in asked.parts:
        if part != "page":
            print(part, file=sys.stderr, flush=True)
            found[part] = loading_figures.PARTS[part](asked.loads)
            if asked.loads:
                print(json.dumps(found[part], indent=1))
            else:
                DATA.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    if not asked.loads:
        PAGE.write_text(loading_page.page(found), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
