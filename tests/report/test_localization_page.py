"""The report of a localization: figures with units, pictures, reasons and changes, also where nothing was known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.localization.changes import CAME, Change
from lhdmap.localization.episodes import Episode
from lhdmap.localization.rows import NOWHERE, TRACKING, LocalizationRow
from lhdmap.localization.search import FIND, PlaceCandidate, Search
from lhdmap.machine import Machine
from lhdmap.report.localization_data import LocalizationData
from lhdmap.report.localization_page import write_localization_report
from lhdmap.report.localization_recording import ellipse, record_localization
from lhdmap.report.recording import RecordingWriter

from tests.exports.folders import street
from tests.report.test_recording import read
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
        stamp_ns=k * 100_000_000, status=TRACKING, x_m=0.1 * k, y_m=0.0, z_m=1.0, yaw_rad=0.3, std_along_m=0.01,
        std_across_m=0.002, std_heading_rad=0.001, probability=1.0, latency_ms=0.7,
    )
    for k in range(25, 200)
]  # fmt: skip
UNKNOWN_ROWS = [NOWHERE._replace(stamp_ns=k * 100_000_000, latency_ms=0.1) for k in range(25)]
NODE = ladder().tunnels[0].id


def candidate(x_m: float, probability: float) -> PlaceCandidate:
    told = {"pose": np.array([x_m, 0.0, 0.1]), "node": NODE, "probability": probability}
    return PlaceCandidate(**dict.fromkeys(PlaceCandidate._fields, 0.0) | told)  # type: ignore[arg-type]


def data(
    rows: list[LocalizationRow], summary: dict[str, Any], warnings: list[str] | None = None, *, full: bool = True
) -> LocalizationData:
    places = candidate(5.0, 0.7), candidate(9.0, 0.3)
    change = Change(CAME, NODE, "left", 12.0, 18.0, 6.0, 0.7, (15.0, 1.0, 0.0), 3_000_000_000, 9_000_000_000, 9)
    lost = Episode("lost", 2_000_000_000, 4_000_000_000, NODE, 7.0, (7.0, 0.0), "no wall <agrees>")
    return LocalizationData(
        "second <drive>",
        ladder(),
        [street()],
        np.random.default_rng(0).uniform(0.0, 20.0, (50, 3)),
        rows,
        [Search(1_000_000_000, 9.0, 8.0, FIND, places, "the next place is as likely")] if full else [],
        [change] if full else [],
        [lost] if full else [],
        summary,
        warnings or [],
        None,
        "lhdmap update-map MAP second.mcap" if full else "",
    )


def page(path: Path, given: LocalizationData) -> str:
    write_localization_report(path, given)
    return path.read_text(encoding="utf-8")


def test_figures_pictures_reasons_and_warnings(tmp_path: Path) -> None:
    text = page(tmp_path / "report.html", data(UNKNOWN_ROWS + TRACKED, SUMMARY, ["wheels <slip>"]))
    for part in (
        "87.5 %",
        "of 200 scans",
        "8.4 s",
        "after 11.2 m",
        "0.7 ms",
        "wheels &lt;slip&gt;",
        "second &lt;drive&gt;",
        "no wall &lt;agrees&gt;",
        "12.0 to 18.0",
        "something stands there now",
        "lhdmap update-map MAP second.mcap",
    ):
        assert part in text
    assert text.count("data:image/svg+xml") == 3
    assert "http" not in text.replace("http://www.w3.org", "")  # self-contained


@pytest.mark.parametrize("count", [1, 25])
def test_where_nothing_was_known_it_says_so(tmp_path: Path, count: int) -> None:
    summary = SUMMARY | {"tracking_share": 0.0, "first_fix_s": None, "first_fix_m": None}
    text = page(tmp_path / "report.html", data(UNKNOWN_ROWS[:count], summary, full=False))
    assert "none" in text
    assert "0.0 %" in text
    assert text.count("data:image/svg+xml") == 3
    assert "not as in the map" not in text.replace("stretches that are not as in the map", "")


def test_an_ellipse_lies_along_the_machine() -> None:
    row = TRACKED[0]
    off = ellipse(row)[:, :2] - [row.x_m, row.y_m]
    long_way = off[np.linalg.norm(off, axis=1).argmax()]
    assert abs(np.arctan2(long_way[1], long_way[0]) - row.yaw_rad) % np.pi == pytest.approx(0.0, abs=1e-6)
    assert np.linalg.norm(off, axis=1).max() / np.linalg.norm(off, axis=1).min() == pytest.approx(5.0, rel=0.01)


@pytest.mark.parametrize("full", [True, False])
def test_the_recording_holds_all_of_it(tmp_path: Path, full: bool) -> None:
    path = tmp_path / "recording.rrd"
    with RecordingWriter(path, "second", 0) as writer:
        writer.add_scan(3_000_000_000, np.zeros((10, 3)))
        given = data(UNKNOWN_ROWS + TRACKED if full else UNKNOWN_ROWS, SUMMARY, full=full)
        record_localization(writer, given, Machine())
    found = read(path)
    wanted = ["map/walls", "state/status", "map/scan/front"]
    wanted += ["map/uncertainty", "map/candidates", "map/changes", "map/base_link", "deviation/along"] if full else []
    assert set(wanted) <= set(found)
    assert "map/topology/tunnels/driven" in found or "map/topology/tunnels/seen" in found
