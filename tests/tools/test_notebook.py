"""The notebook that the docs show runs cell by cell, and ships with what it shows."""

from __future__ import annotations

import json
import re
from pathlib import Path

from tools.notebook import run_notebook, write_notebook

NOTEBOOK = Path(__file__).resolve().parents[2] / "docs" / "first_map.ipynb"


def test_the_notebook_runs_and_shows_what_it_shows() -> None:
    """Figures that were measured may differ in the last digits: of the outputs only the kinds are compared."""
    shown = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    found = run_notebook(NOTEBOOK)
    kinds = [
        [[output["output_type"] for output in cell.get("outputs", [])] for cell in book["cells"]]
        for book in (shown, found)
    ]
    assert kinds[0] == kinds[1]
    assert sum(kind.count("display_data") for kind in kinds[0]) >= 2
    said = "".join(
        line for cell in found["cells"] for output in cell.get("outputs", []) for line in output.get("text", [])
    )
    (end_pct,) = re.findall(r"error at the end: ([\d.]+) %", said)
    assert float(end_pct) < 1.0
    assert "loadable (truth: loadable)" in said


def test_the_notebook_ships_with_its_outputs_and_without_paths_of_a_machine() -> None:
    text = NOTEBOOK.read_text(encoding="utf-8")
    assert '"image/png"' in text
    assert "/tmp" not in re.sub(r'"image/png": "[^"]*"', "", text)  # noqa: S108
    assert len(text) < 300_000


def test_outputs_are_what_jupyter_would_show(tmp_path: Path) -> None:
    cell = {"cell_type": "code", "source": ["print('said')\n", "6 * 7"], "outputs": [], "execution_count": None}
    path = tmp_path / "small.ipynb"
    write_notebook(path, {"cells": [cell, {"cell_type": "markdown", "source": ["# A"]}]})
    (first, second), _ = (c.get("outputs", ((), ())) for c in run_notebook(path)["cells"])
    assert first == {"name": "stdout", "output_type": "stream", "text": ["said\n"]}
    assert second["data"] == {"text/plain": ["42"]}
