"""The report: self-contained, all parts drawn, missing parts said in words, quick."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from lhdmap.report.data import ReportData
from lhdmap.report.page import render_report, write_report
from lhdmap.report.text import headline

from tests.report.synthetic import report_data

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def data() -> ReportData:
    return report_data(scans=1500, points=20_000)


@pytest.fixture(scope="module")
def page(data: ReportData) -> str:
    return render_report(data)


class Pictures(HTMLParser):
    """Collects pictures, addresses and unclosed elements of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.sources: list[str] = []
        self.addresses: list[str] = []
        self.open: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)
        for name, value in attrs:
            if name == "src":
                self.sources.append(value or "")
            if name in ("href", "action", "data"):
                self.addresses.append(value or "")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def svgs(page: str) -> list[ET.Element]:
    prefix = "data:image/svg+xml;base64,"
    return [
        ET.fromstring(base64.b64decode(source.removeprefix(prefix)))  # noqa: S314  # our own output
        for source in Pictures(page).sources
    ]


def words(picture: ET.Element) -> str:
    return " | ".join("".join(text.itertext()) for text in picture.iter(f"{SVG}text"))


def test_page_is_well_formed_and_needs_no_network(page: str) -> None:
    found = Pictures(page)
    assert found.open == []
    assert found.addresses == []
    assert all(source.startswith("data:image/svg+xml;base64,") for source in found.sources)
    assert not re.search(r"@import|url\(\s*['\"]?https?:|<script", page)


def test_pictures_have_axes_with_units(page: str) -> None:
    texts = [words(picture) for picture in svgs(page)]
    assert len(texts) == 7
    wanted = [
        ("x, m", "y, m", "final trajectory", "odometry alone", "truth", "start", "end"),
        ("distance driven, m", "height, m"),
        ("true distance, m", "error, ", "along", "across"),
        ("x, m", "y, m", "height, m"),
        ("distance along the path, m", "height, m"),
        ("speed, m/s", "slip, %", "time since the first scan, s", "tachometer", "odometry"),
        ("along, mm", "across, mm", "heading, °", "a direction was not observed"),
    ]
    for text, labels in zip(texts, wanted, strict=True):
        assert all(label in text for label in labels), (labels, text)


def test_pictures_follow_the_readers_light_or_dark_setting(page: str) -> None:
    for picture in svgs(page):
        text = ET.tostring(picture, encoding="unicode")
        assert "prefers-color-scheme:dark" in text
        assert "currentColor" in text
        assert "#010203" not in text


def test_headline_says_figures_and_what_they_mean(page: str) -> None:
    for text in ("60.0 m", "in 30.0 s", "lost stretches", "12.0 %", "weak scans", "mean drift over 10 m of driving"):
        assert text in page


def test_tables_hold_topics_segments_settings_and_provenance(page: str) -> None:
    for text in ("/lidar/front/scan", "sensor_msgs/Imu", "spacing_m = 0.5", "SHA-256 2cf24dba5fb0", "rotation, °/m"):
        assert text in page


def test_what_is_missing_is_said_in_words(data: ReportData) -> None:
    bare = ReportData(data.title, data.summary, [], data.trajectory, has_inclinometer=False)
    page = render_report(bare)
    for text in (
        "no tachometer", "no inclinometer", "No cloud was integrated", "No diagnostics were recorded",
        "No ground truth was given", "No speed was recorded",
    ):  # fmt: skip
        assert text in page
    assert len(svgs(page)) == 1
    assert "nan" not in re.sub(r"base64,[^\"]*", "", page).lower()


def test_names_from_the_log_cannot_break_the_page(data: ReportData) -> None:
    nasty = replace(data, title="<b>&", warnings=["<script>alert(1)</script>"], cloud=None, diagnostics=None)
    page = render_report(nasty)
    assert "<script" not in page
    assert "&lt;b&gt;&amp;" in page


def test_one_scan_and_standing_still_are_drawn(data: ReportData) -> None:
    path = data.trajectory
    one = path._replace(
        stamps_ns=path.stamps_ns[:1], positions_m=path.positions_m[:1], quaternions_xyzw=path.quaternions_xyzw[:1]
    )
    still = path._replace(positions_m=np.zeros_like(path.positions_m))
    for trajectory in (one, still):
        part = replace(data, trajectory=trajectory, odometry=None, evaluation=None)
        assert len(svgs(render_report(part))) == 6


def test_same_data_gives_the_same_file(data: ReportData, page: str, tmp_path: Path) -> None:
    write_report(data, tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == page


def test_a_long_drive_gives_a_small_page() -> None:
    big = report_data(scans=10_000, points=500_000)
    assert len(render_report(big)) < 1_500_000


@pytest.mark.parametrize(
    ("share", "lost", "words"),
    [(0.12, 0, "followed all the way"), (0.99, 0, "not proven"), (0.99, 2, "may be bent there")],
)
def test_what_is_said_of_lost_stretches(data: ReportData, share: float, lost: int, words: str) -> None:
    """None lost, but nearly all weak: that is no praise."""
    data = replace(data, summary=replace(data.summary, degenerate_share=share, lost_stretches=lost))
    found = next(figure for figure in headline(data) if figure.name == "lost stretches")
    assert words in found.meaning
