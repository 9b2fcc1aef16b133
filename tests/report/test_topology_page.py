"""The topology on the page: every name is there, each level has its picture, nothing is said of nothing, sizes are bounded."""

from __future__ import annotations

import re
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from lhdmap.report import charts
from lhdmap.report.bounded import MOST_CELLS, bounded
from lhdmap.report.data import ClosureRow, ReportData
from lhdmap.report.page import render_report
from lhdmap.report.topology_charts import level_figure, route_figure
from lhdmap.report.topology_levels import Levels, coarser, middle, summary
from lhdmap.report.topology_page import sections
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.sheet import OCCUPIED, Sheet

from tests.report.synthetic import report_data
from tests.report.test_page import SVG, svgs, words
from tests.report.topologies import board, sheet, told, two_levels
from tests.topology.maps import ladder

BASE = replace(report_data(scans=60, points=100), evaluation=None)
CLOSURE = ClosureRow(np.array([0.0, 0.0, 0.0]), np.array([1.5, 0.5, 0.0]), True, 0.031, 2.5e4)
REFUSED = CLOSURE._replace(accepted=False, reason="walls <alike> along the tunnel")

UNMEASURED = REFUSED._replace(residual_m=float("nan"), information=float("nan"), reason="too far away")


def drawn(topology: TopologicalMap, **more: object) -> str:
    with charts.styled():
        return sections(replace(BASE, topology=topology, **more))  # type: ignore[arg-type]


def plain_text(page: str) -> str:
    return re.sub(r"base64,[^\"]*|<[^>]*>", " ", page)


def texts(page: str) -> set[str]:
    return {text for picture in svgs(page) for text in words(picture).split(" | ")}


def all_names(topology: TopologicalMap) -> set[str]:
    return set(topology.names()) - set(topology.points) - set(topology.nodes)


@pytest.mark.parametrize("topology", [ladder(), told(), board(3, 7)], ids=["ladder", "told", "board"])
def test_every_name_stands_in_the_picture_and_in_the_tables(topology: TopologicalMap) -> None:
    page = drawn(topology)
    assert all_names(topology) <= texts(page)
    cells = set(re.findall(r"<td[^>]*>([^<]*)</td>", page))
    assert all_names(topology) <= cells
    assert "had no room" not in page


def test_the_tables_have_a_row_for_each_and_the_figures_of_the_geometry() -> None:
    page = drawn(told())
    rows = [re.findall(r"<td[^>]*>([^<]*)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", page)]
    rows = [row for row in rows if row]
    assert len(rows) == 3 + 2 + 1
    assert ["T1", "I1 – I2", "closed", "48.0", "4.50", "4.50", "0.0", "12"] in rows
    assert ["T2", "I1 – I2", "only seen", "108.0", "4.50", "4.50", "0.0", "12"] in rows
    assert ["T3", "I1 – unexplored", "driven", "24.0", "4.50", "4.50", "0.0", "12"] in rows
    assert ["I1", "3", "0"] in rows
    assert ["DP1", "T3", "draw point"] in rows


def test_the_legend_names_what_is_there_and_nothing_else() -> None:
    plain, all_kinds = texts(drawn(ladder())), texts(drawn(told(), closures=[CLOSURE, REFUSED]))
    always = {"intersection", "tunnel, driven", "access point", "draw point"}
    some = {
        "tunnel, only seen", "tunnel, closed", "connection, infeasible", "connection, closed", "unexplored",
        "loop closure", "loop closure, refused",
    }  # fmt: skip
    assert always <= plain
    assert not some & plain
    assert always | some <= all_kinds


def test_the_line_above_counts() -> None:
    assert summary(ladder()) == "3 tunnels, 2 intersections, 1 level, 1 waypoint, 0 ends unexplored"
    assert summary(told()) == (
        "3 tunnels (1 only seen), 2 intersections, 1 level, 1 waypoint, 1 end unexplored, 1 connection infeasible"
    )
    assert summary(TopologicalMap()) == "0 tunnels, 0 intersections, 0 levels, 0 waypoints, 0 ends unexplored"


def test_each_level_has_a_picture_of_what_is_on_it() -> None:
    topology, sheets = two_levels()
    page = drawn(topology, sheets=sheets)
    lower, upper = (set(words(picture).split(" | ")) for picture in svgs(page))
    assert {"I3", "Z", "D", "to another level"} <= lower
    assert {"I1", "I2", "T1", "T2", "DP1", "D", "to another level"} <= upper
    assert not {"I1", "T1", "DP1"} & lower
    assert not {"I3", "Z"} & upper
    assert "Level deep, from above; grey is free space, its floor at -20.0 to -10.0 m." in page
    assert "Level 0, from above; grey is free space, its floor at -9.9 to 0.5 m." in page


def test_no_part_of_a_tunnel_is_lost_between_levels() -> None:
    topology, sheets = two_levels()
    levels = Levels(topology, sheets)
    line = next(one.line_m for one in topology.tunnels if one.name == "D")
    parts = [part for number in (0, 1) for part in levels.on(number, [line])]
    length = sum(float(np.linalg.norm(np.diff(part, axis=0), axis=1).sum()) for part in parts)
    assert length == pytest.approx(np.hypot(200.0, 20.0))


def test_everything_is_drawn_within_the_picture() -> None:
    """All that has a place on the page lies within the axes: lines, outlines, marks, arrows, names."""
    topology = told()
    levels = Levels(topology, [sheet()])
    with charts.styled():
        figure, left_out = level_figure(topology, levels, 0, [CLOSURE])
        (axes,) = figure.axes
        figure.draw_without_rendering()
    assert left_out == 0
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    for line in axes.lines:
        x, y = np.asarray(line.get_data(), dtype=float)
        known = np.isfinite(x)
        assert ((x[known] >= x0) & (x[known] <= x1) & (y[known] >= y0) & (y[known] <= y1)).all()
    page = figure.bbox
    for text in axes.texts:
        box = text.get_window_extent()
        assert axes.bbox.x0 <= box.x0 + 3.0
        assert box.x1 <= page.x1
        assert axes.bbox.y0 <= box.y0 + 3.0
        assert box.y1 <= page.y1
    scales = np.array([axes.bbox.width / (x1 - x0), axes.bbox.height / (y1 - y0)])
    assert scales[0] == pytest.approx(scales[1])


@pytest.mark.parametrize("part", ["topology", "closures"])
def test_a_section_of_which_there_is_nothing_is_left_out(part: str) -> None:
    filled = {"topology": ladder(), "closures": [CLOSURE]}
    with charts.styled():
        page = sections(replace(BASE, **{part: filled[part]}))  # type: ignore[arg-type]
    headings = {"topology": "Topology", "closures": "Loop closures"}
    assert re.findall(r"<h2>(.*?)</h2>", page) == [headings[part]]
    assert sections(BASE) == ""


def test_closures_are_told_with_their_evidence() -> None:
    with charts.styled():
        page = sections(replace(BASE, closures=[CLOSURE, REFUSED, UNMEASURED, UNMEASURED]))
    assert "1 of 4 candidates accepted. Refused: too far away (2); walls &lt;alike&gt; along the tunnel (1)." in page
    rows = [re.findall(r"<td[^>]*>([^<]*)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", page)]
    assert ["0.0 0.0 0.0", "1.5 0.5 0.0", "3.1", "2.5e+04", "yes", ""] in rows
    assert ["0.0 0.0 0.0", "1.5 0.5 0.0", "3.1", "2.5e+04", "no", "walls &lt;alike&gt; along the tunnel"] in rows
    assert len(rows) == 3  # the head, and what was measured


def test_a_drive_without_a_tunnel_says_so() -> None:
    page = drawn(TopologicalMap(remarks=("the machine hardly moved: no tunnel",)))
    assert "the machine hardly moved" in page
    assert "<img" not in page


def test_the_page_explains_its_words() -> None:
    page = render_report(replace(BASE, topology=ladder()))
    for word in ("access point", "intersection", "topology", "tunnel", "waypoint"):
        assert f"<dt>{word}</dt>" in page


def test_names_are_text_and_never_markup_or_mathematics() -> None:
    plain = ladder()
    odd = replace(plain, tunnels=(replace(plain.tunnels[0], name="A<b> $x_1$ & co"), *plain.tunnels[1:]))
    page = drawn(odd)
    assert "A&lt;b&gt; $x_1$ &amp; co" in page
    assert "A<b> $x_1$ & co" in texts(page)


@pytest.mark.parametrize("side", [12, 45])
def test_the_page_stays_bounded_for_large_mines(side: int) -> None:
    page = drawn(board(side, side), sheets=[sheet(side=3000)])
    assert len(page) < 2_500_000
    assert "more stand in topology.geojson" in page or side == 12
    assert len(re.findall("<tr>", page)) <= 3 * 401


def test_a_large_sheet_is_coarsened_and_keeps_its_walls() -> None:
    cells = np.ones((5001, 4000), dtype=np.uint8)
    cells[777, 1234] = OCCUPIED
    large = Sheet(cells, np.array([5.0, -3.0]), 0.2)
    small = coarser(large, 900)
    assert max(small.cells.shape) <= 900
    ((row, column),) = np.argwhere(small.cells == OCCUPIED)
    assert np.abs(small.middles_m(np.array([[row, column]])) - large.middles_m(np.array([[777, 1234]]))).max() < 1.2
    data: ReportData = bounded(replace(BASE, sheets=[large], closures=[CLOSURE] * 9000))
    assert max(data.sheets[0].cells.shape) <= MOST_CELLS
    assert len(data.closures) < 9000


def test_the_middle_of_a_line_is_half_way_along_it() -> None:
    assert middle(np.array([[0.0, 0.0], [1.0, 0.0], [10.0, 0.0]])) == pytest.approx([5.0, 0.0])


def test_a_map_of_nothing_but_points_at_one_place_can_be_drawn() -> None:
    topology = board(1, 1)
    flat = [replace(one, line_m=one.line_m[:1].repeat(2, axis=0)) for one in topology.tunnels]
    assert svgs(drawn(replace(topology, tunnels=tuple(flat), intersections=())))


def test_a_route_is_drawn_by_gear_with_start_goal_and_inversion() -> None:
    from lhdmap.movement.routes import route

    found = route(ladder(), "DP1", "T2")
    with charts.styled():
        picture = ET.fromstring(charts.svg_text(route_figure(ladder(), found.states, [sheet()])))  # noqa: S314  # our own
    said = {"".join(text.itertext()) for text in picture.iter(f"{SVG}text")}
    assert {"DP1", "start", "goal"} <= said
    gears = {step.gear for step in found.states[:-1]}
    assert gears == said & {"forward", "reverse"}
    assert ("inversion" in said) == any(step.inversion for step in found.states)
