"""What the page on scan matching shows runs, and finds the pose that it says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "scan_matching.md"


def test_the_page_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    assert len(block.strip().splitlines()) <= 10
    exec(compile(block, PAGE.name, "exec"), {})  # noqa: S102
    near, far = capsys.readouterr().out.splitlines()[:2]
    for told in (near, far):
        assert numbers(told)[:3] == pytest.approx([0.3, 0.1, 0.0], abs=0.002)


def numbers(text: str) -> list[float]:
    return [float(word) for word in re.findall(r"-?\d+\.\d*(?:e[-+]\d+)?", text)]
