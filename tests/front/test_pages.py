"""What docs show of the front door runs: the page on Python line by line."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"


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
