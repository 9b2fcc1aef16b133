"""Words of the pages: they follow the numbers, say what took part and nothing of what did not, and are explained."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from lhdmap.report.data import ReportData, Summary
from lhdmap.report.glossary import TERMS, as_markdown, list_of
from lhdmap.report.page import fill_in_cost, render_report, write_report
from lhdmap.report.text import cost_figures, cost_line, headline, missing_parts, trust_line

from tests.report.synthetic import report_data

COST = {
    "scans": 300,
    "scans_processed": 75,
    "distance_m": 30.0,
    "duration_s": 120.0,
    "wall_s": 60.0,
    "realtime_factor": 2.0,
    "peak_memory_mib": 842.4,
    "compile_s": 0.0,
}


@pytest.fixture(scope="module")
def data() -> ReportData:
    return replace(report_data(scans=300, points=1_000), witness="tachometer")


def _summary(wall_s: float = 10.0, realtime_factor: float = 2.0, compile_s: float = 0.0) -> Summary:
    return Summary(10, 10, 20.0, 5.0, wall_s, realtime_factor, compile_s=compile_s)


@pytest.mark.parametrize(
    ("factor", "value", "meaning"),
    [
        (0.3, "0.30 ×", "slower than the drive"),
        (0.004, "0.00 ×", "slower than the drive"),
        (0.97, "0.97 ×", "as fast as the drive"),
        (1.04, "1.0 ×", "as fast as the drive"),
        (17.14, "17.1 ×", "faster than the drive"),
        (240.0, "240 ×", "faster than the drive"),
    ],
)
def test_the_words_follow_the_factor(factor: float, value: str, meaning: str) -> None:
    figure = cost_figures(_summary(realtime_factor=factor))[0]
    assert figure.value == value
    assert figure.meaning.startswith(meaning)


def test_the_page_begins_with_how_far_the_map_may_be_off(data: ReportData) -> None:
    error = {
        "end_m": 0.184,
        "end_pct": 0.23,
        "heading_deg": 0.31,
        "height_m": None,
        "lower_bound": False,
        "unseen_m": 1.0,
    }
    known = replace(data, summary=replace(data.summary, expected_error=error))
    first = headline(known)[0]
    assert (first.value, first.name) == ("18.4 cm", "expected error")
    assert "heading 0.31°, height not observed" in first.meaning
    assert (
        trust_line({"expected_error": error})
        == "18.4 cm at its end (0.23 %), heading 0.31°, height not observed (95 %)"
    )
    least = error | {"lower_bound": True, "unseen_m": 42.0, "height_m": 1.5}
    told = trust_line({"expected_error": least})
    assert told is not None
    assert told.startswith("at least 18.4 cm")
    assert "on up to 42 m neither walls nor wheels" in told
    assert "height 1.50 m" in told


def test_nothing_is_said_of_an_error_that_nobody_knows(data: ReportData) -> None:
    assert trust_line({"expected_error": None}) is None
    assert "expected error" not in [figure.name for figure in headline(data)]


def test_compiling_is_told_apart() -> None:
    slow = _summary(wall_s=64.0, realtime_factor=20.0 / 64.0, compile_s=60.0)
    meaning = cost_figures(slow)[0].meaning
    assert "of which 1 min 00 s compiling, once after installation (5.0 × without)" in meaning
    assert "compiling" not in cost_figures(_summary(compile_s=0.2))[0].meaning


def test_screen_and_page_have_the_same_figures(data: ReportData, tmp_path: Path) -> None:
    unknown = replace(data.summary, wall_s=None, realtime_factor=None, peak_memory_mib=None)
    write_report(replace(data, summary=unknown), tmp_path / "report.html")
    before = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "faster than the drive" not in before
    fill_in_cost(tmp_path / "report.html", COST)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<dt>real-time factor</dt>" in page
    line = cost_line(COST)
    assert line == "1 min 00 s = 2.0 × real time; 842 MiB"
    for figure in ("1 min 00 s", "2.0 ×", "842 MiB"):
        assert figure in page


def test_wheel_odometry_is_a_second_witness(data: ReportData) -> None:
    robot = replace(data, tachometer_speed=None, witness="wheel odometry")
    sentences = " ".join(missing_parts(robot))
    assert "no tachometer: wheel slip is not known" in sentences
    assert "nothing else does" not in sentences
    assert "motion there came from the wheel odometry" in render_report(robot)
    assert "nothing else does: it has no wheel odometry" in " ".join(missing_parts(replace(robot, witness="")))
    assert "motion there was carried on" in render_report(replace(robot, witness=""))


def test_what_a_warning_says_is_not_said_again(data: ReportData) -> None:
    planar = replace(data, has_inclinometer=False)
    assert any("no inclinometer" in text for text in missing_parts(planar))
    told = replace(planar, warnings=["no inclinometer in the log: the drive is treated as planar"])
    assert not any("inclinometer" in text for text in missing_parts(told))


def test_given_poses_are_said_and_nothing_of_what_took_no_part(data: ReportData) -> None:
    plain = replace(
        data, poses="survey.tum", odometry=None, evaluation=None, diagnostics=None, odometry_speed=None,
        tachometer_speed=None, witness="", warnings=(), topics=(), settings_text="", has_inclinometer=False,
    )  # fmt: skip
    page = render_report(plain)
    shown = re.sub(r"<style>.*?</style>|base64,[^\"]*|<[^>]*>", " ", page, flags=re.DOTALL)
    assert "path and map are made from survey.tum" in shown
    for word in ("wheel", "tachometer", "closure", "drift", "weak", "lost", "odometry", "slip", "inclinometer"):
        assert word not in shown.lower(), word
    assert page.count("<img") == 4  # the path from above and from the side, the map likewise


def test_a_pile_that_was_not_looked_for_is_said(data: ReportData) -> None:
    page = render_report(replace(data, pile_reason="no pile was looked for: pile.method is off"))
    assert "<h2>Ore pile</h2>\n<p>No pile was looked for: pile.method is off.</p>" in page


def test_the_glossary_is_the_page_of_the_documentation() -> None:
    page = Path(__file__).parents[2] / "docs" / "glossary.md"
    assert as_markdown() in page.read_text(encoding="utf-8")
    names = " ".join(term.word for term in TERMS)
    for word in (
        "weak",
        "degenerate",
        "drift",
        "key scan",
        "status",
        "lost",
        "closure",
        "support",
        "information",
        "toe",
    ):
        assert word in names
    assert max(len(term.meaning) for term in TERMS) < 330, "one to three lines each"


def test_a_page_explains_the_words_that_it_uses_and_no_others() -> None:
    words = list_of("<p>the toe</p><pre>slip</pre><b title='closure'>no loop closures</b>")
    assert "<dt>toe</dt>" in words
    assert "<dt>loop closure</dt>" in words
    assert "<dt>slip</dt>" not in words
    assert "E_L" not in list_of("<p>base_link</p>")
    assert list_of("<p>nothing</p>") == ""
