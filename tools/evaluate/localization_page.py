"""The page `evaluation/localization.md`: sections by title, each written by a command of its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

RESULT = Path(__file__).resolve().parents[2] / "evaluation" / "localization.md"
_HEADING = "# Localization\n\nWritten by `python -m tools.evaluate.localization`, section by section.\n"


def replaced(title: str, lines: Sequence[str]) -> None:
    """Write a section into the page: in the place of the one of that title, or at its end."""
    parts = RESULT.read_text(encoding="utf-8").split("\n## ") if RESULT.exists() else [_HEADING]
    section = "\n".join([title, "", *lines, ""])
    titles = [part.partition("\n")[0].strip() for part in parts]
    if title in titles[1:]:
        parts[titles.index(title, 1)] = section
    else:
        parts.append(section)
    RESULT.write_text("\n## ".join(part.rstrip("\n") + "\n" for part in parts), encoding="utf-8")
