"""The report of a localization: figures with units, both pictures, also where nothing was known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from lhdmap.localization.rows import NOWHERE, TRACKING, Row
from lhdmap.report.localization_page import write_localization_report

from tests.exports.folders import street
from tests.topology.maps import ladder

SUMMARY: dict[str, Any] = {
    "scans": 200,
    "tracking_share": 0.875,
    "first_fix_s": 8.4,
    "first_fix_m": 11.25,
    "lost_stretches": 1,
    "false_fix_guard": 2,
    "latency_ms": {"median": 0.66, "p99": 5.94},
}
TRACKED = [
    NOWHERE._replace(
        stamp_ns=k * 100_000_000, status=TRACKING, x_m=0.1 * k, y_m=0.0, std_along_m=0.01, std_across_m=0.002
    )
    for k in range(25, 200)
]
UNKNOWN_ROWS = [NOWHERE._replace(stamp_ns=k * 100_000_000) for k in range(25)]


def page(path: Path, rows: list[Row], summary: dict[str, Any], warnings: list[str]) -> str:
    write_localization_report(path, ("second <drive>", ladder(), [street()]), rows, summary, warnings)
    return path.read_text(encoding="utf-8")


def test_figures_pictures_and_warnings(tmp_path: Path) -> None:
    text = page(tmp_path / "report.html", UNKNOWN_ROWS + TRACKED, SUMMARY, ["wheels <slip>"])
    for part in (
        "87.5 %",
        "of 200 scans",
        "8.4 s",
        "after 11.2 m",
        "0.7 ms",
        "wheels &lt;slip&gt;",
        "second &lt;drive&gt;",
    ):
        assert part in text
    assert text.count("data:image/svg+xml") == 2
    assert "http" not in text.replace("http://www.w3.org", "")  # self-contained


@pytest.mark.parametrize("count", [1, 25])
def test_where_nothing_was_known_it_says_so(tmp_path: Path, count: int) -> None:
    summary = SUMMARY | {"tracking_share": 0.0, "first_fix_s": None, "first_fix_m": None}
    text = page(tmp_path / "report.html", UNKNOWN_ROWS[:count], summary, [])
    assert "none" in text
    assert "0.0 %" in text
    assert text.count("data:image/svg+xml") == 2
