"""What docs show of the front door runs: the page on Python line by line, and the notebook's cells."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from tools.notebook import run_notebook, write_notebook

DOCS = Path(__file__).resolve().parents[2] / "docs"
NOTEBOOK = DOCS / "first_map.ipynb"


def test_the_page_on_python_runs(beside_the_log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blocks = re.findall(
        r"^```python\n(.*?)^```", (DOCS / "python.md").read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    )
    names: dict[str, object] = {"__name__": "__main__"}
    assert len(blocks[0].strip().splitlines()) <= 10
    for block in blocks:
        exec(compile(block, "python.md", "exec"), names)  # noqa: S102
    told = capsys.readouterr().out
    assert re.search(r"<Map 'map': 15\.\d m in 1\d\.\d s, \d+ scans, \d warning\(s\)>", told)
    assert re.search(r"at most 1\d\.\d km/h", told)  # the drive goes at 10 km/h, with the noise of single scans
    (promised,) = re.findall(r"print\(error\)  # (.*)", blocks[-1])
    assert promised in told
    assert (beside_the_log / "map" / "report.html").is_file()


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
