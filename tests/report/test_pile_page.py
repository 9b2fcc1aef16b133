"""The pile's page: self-contained, what was found in words and pictures, nothing drawn of what was not found."""

from __future__ import annotations

import base64
import math
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from lhdmap.messages import FloatArray
from lhdmap.pile.result import AttackPoint, Boulder, PileApproach, PileEstimate, PileReport, Snapshot
from lhdmap.report.page import render_report
from lhdmap.report.pile_charts import Ahead
from lhdmap.report.pile_page import pile_sections, write_pile_report

from tests.report.synthetic import report_data

HEADING_RAD = 2.2
TOE_M = np.array([100.0, -40.0, 7.0])


def _map(x: float, y: float, z: float) -> FloatArray:
    """Return a point of the pile's frame (x into the pile from the middle of the toe) in the map."""
    c, s = math.cos(HEADING_RAD), math.sin(HEADING_RAD)
    return TOE_M + np.array([c * x - s * y, s * x + c * y, z])


def pile(**changes: object) -> PileEstimate:
    """Return a pile of 45 degrees and 4 m, with a boulder."""
    y, z = (axis.ravel() for axis in np.meshgrid(np.arange(-1.9, 2.0, 0.1), np.arange(0.2, 1.6, 0.1)))
    found = PileEstimate(
        status="loadable",
        probabilities={"loadable": 0.93, "hang_up": 0.07},
        center_m=_map(0.9, 0.0, 0.9),
        left_limit_m=_map(0.0, 2.0, 0.0),
        right_limit_m=_map(0.0, -2.0, 0.0),
        width_m=4.0,
        width_std_m=0.07,
        inclination_deg=-45.0,
        inclination_std_deg=1.3,
        volume_m3=5.5,
        volume_std_m3=0.4,
        boulders=(Boulder(_map(0.8, 0.5, 0.8), 1.2),),
        attack=AttackPoint(_map(0.0, 0.1, 0.0), HEADING_RAD),
        toe_m=np.array([_map(0.0, side, 0.0) for side in np.linspace(2.0, -2.0, 15)]),
        face_m=np.array([_map(b, a, b) for a, b in zip(y.tolist(), z.tolist(), strict=True)]),
        residuals_m=np.zeros(len(y)),
        warnings=("the <scanner> looks lower",),
    )
    return replace(found, **changes)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def report() -> PileReport:
    history = tuple(Snapshot(i, 30.0 - i, pile(inclination_std_deg=5.0 - 0.2 * i)) for i in range(20))
    nothing = Snapshot(0, math.nan, PileEstimate())
    around = np.array([_map(-0.1 * i, side * 2.0, 0.5) for i in range(60) for side in (-1.0, 1.0)])
    return PileReport(history[8], history[-1], (nothing, *history), around_m=around)


def _pictures(page: str) -> list[ET.Element]:
    found = re.findall(r'src="data:image/svg\+xml;base64,([^"]+)"', page)
    return [ET.fromstring(base64.b64decode(one)) for one in found]  # noqa: S314 (written here)


def _words(picture: ET.Element) -> str:
    return " ".join("".join(text.itertext()) for text in picture.iter("{http://www.w3.org/2000/svg}text"))


def test_page_is_one_file_with_figures_and_pictures(report: PileReport, tmp_path: Path) -> None:
    write_pile_report(report, tmp_path / "report.html", "a <pile> & more")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "a &lt;pile&gt; &amp; more" in page
    assert "the &lt;scanner&gt; looks lower" in page
    for words in ("4.00 m", "± 0.07 m", "-45.0°", "5.5 m³", "22.0 m", "loadable"):
        assert words in page
    assert not re.search(r'(src|href)="(?!data:)', page)
    assert len(_pictures(page)) == 5


def test_pictures_name_what_they_show(report: PileReport) -> None:
    above, cut, relief, normals, course = (_words(picture) for picture in _pictures(pile_sections(report)))
    assert all(word in above for word in ("toe", "attack", "boulder", "limits", "walls"))
    assert "fit, -45.0°" in cut
    assert "stands out, m" in relief
    assert all(word in normals for word in ("toe", "limits"))
    assert all(word in course for word in ("width, m", "inclination, °", "loadable", "hang up", "decided"))


def test_nothing_found_is_said_and_not_drawn() -> None:
    page = pile_sections(PileReport(None, None))
    assert "No face was found" in page
    assert not _pictures(page)


def test_what_was_not_looked_for_has_no_status_and_no_probability() -> None:
    page = pile_sections(
        PileReport(None, None, reason="no pile was looked for: it was off", warnings=("the <log> is short",))
    )
    assert "No pile was looked for: it was off." in page
    assert "the &lt;log&gt; is short" in page
    assert "%" not in page
    assert "none" not in page


def test_none_is_said_without_measures_and_without_a_contradiction() -> None:
    """The last estimate was of a wall of the bend: its width and slope are not those of a pile."""
    wall = pile(status="none", probabilities={"none": 1.0}, width_m=9.82, inclination_deg=-90.5)
    page = pile_sections(PileReport(None, Snapshot(0, 12.0, wall), (Snapshot(0, 12.0, wall),)))
    assert "nothing closes the drift; probability 100 %" in page
    for wrong in ("9.82", "-90.5", "sure enough", "identified"):
        assert wrong not in page


def test_a_none_that_is_not_the_likeliest_has_no_probability() -> None:
    """Where the inclination is hardly known the status is none, whatever the probabilities say."""
    unsure = pile(status="none", probabilities={"loadable": 0.6, "none": 0.1, "hang_up": 0.3})
    page = pile_sections(PileReport(None, Snapshot(0, 12.0, unsure)))
    assert "not known well enough" in page
    assert "10 %" not in page


def test_the_distance_of_the_decision_is_said_in_words(report: PileReport) -> None:
    page = pile_sections(report)
    assert "decided 22.0 m before the toe, the foot of the pile" in page
    assert "sure enough that this is loadable" in page


def test_face_without_surroundings_or_course_is_drawn() -> None:
    only = PileReport(None, Snapshot(0, 12.0, pile(attack=None, boulders=())))
    page = pile_sections(only)
    assert len(_pictures(page)) == 4
    assert "it was never sure enough that it is loadable" in page


@pytest.mark.parametrize("inclination_deg", [-15.0, -90.0, -120.0])
def test_any_inclination_is_drawn(report: PileReport, inclination_deg: float) -> None:
    last = Snapshot(0, 12.0, pile(inclination_deg=inclination_deg))
    assert len(_pictures(pile_sections(replace(report, last=last)))) == 5


def test_fit_that_misses_its_own_face_is_drawn(report: PileReport) -> None:
    """As those of the paper's constants may be: nothing is left to colour, and nothing falls over."""
    far = pile(face_m=pile().face_m + np.array([0.0, 0.0, 50.0]))
    assert len(_pictures(pile_sections(replace(report, last=Snapshot(0, 12.0, far), around_m=np.zeros((0, 3)))))) == 5


def test_unknown_deviations_are_said(report: PileReport) -> None:
    """The paper's method states none."""
    nan = math.nan
    bare = pile(width_std_m=nan, inclination_std_deg=nan, volume_m3=nan, volume_std_m3=nan, toe_m=np.zeros((0, 3)))
    page = pile_sections(replace(report, last=Snapshot(0, 12.0, bare), history=(Snapshot(0, 12.0, bare),)))
    assert len(_pictures(page)) == 5
    assert "± unknown" in page
    assert "nan" not in re.sub(r'src="[^"]+"', "", page)


def test_own_frame_of_the_pile() -> None:
    frame = Ahead.of(pile())
    assert math.remainder(frame.heading_rad - HEADING_RAD, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert frame.half_m == pytest.approx(2.0)
    assert frame.local(_map(1.0, -0.5, 0.3))[0] == pytest.approx([1.0, -0.5, 0.3])


def test_section_of_build_map(report: PileReport) -> None:
    data = report_data(scans=300, points=2_000)
    assert "Ore pile" not in render_report(data)
    page = render_report(replace(data, pile=report))
    assert "<h2>Ore pile</h2>" in page
    assert "4.00 m" in page


def test_estimates_of_something_else_are_not_joined_to_the_course(report: PileReport) -> None:
    wrong = pile(width_m=99.0, center_m=_map(-20.0, 0.0, 0.9))
    with_wrong = replace(report, history=(Snapshot(0, 12.0, wrong), *report.history))
    *_, course = (_words(picture) for picture in _pictures(pile_sections(with_wrong)))
    assert course == _words(_pictures(pile_sections(report))[-1])


def test_all_that_was_decided_is_listed(report: PileReport) -> None:
    """Two piles on one drive: the page draws one, and lists both."""
    assert report.last is not None
    other = report.last._replace(estimate=replace(report.last.estimate, status="wall", width_m=3.21))
    both = replace(report, piles=(PileApproach(other, other), PileApproach(report.last, report.last)))
    page = pile_sections(both)
    assert "All that was decided on this drive" in page
    assert "3.21" in page
    assert page.count("(the one above)") == 1
    assert "All that was decided" not in pile_sections(report)
