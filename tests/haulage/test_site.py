"""The paper's site: its geometry, its sides of traffic, and what a file may not say."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import ConfigError, InputError, UsageError
from lhdmap.haulage.layout import Layout
from lhdmap.haulage.site import Site, find_site, load_site
from lhdmap.haulage.site_layout import layout_of_site
from lhdmap.haulage.states import State


@pytest.fixture(scope="module")
def site() -> Site:
    return load_site(find_site("hejase"))


@pytest.fixture(scope="module")
def layout(site: Site) -> Layout:
    return layout_of_site(site)


def edge_line(layout: Layout, start: str, end: str) -> np.ndarray:
    line = next(edge.line_m for edge in layout.edges if (edge.start, edge.end) == (start, end))
    assert line is not None
    return line


def test_ways_begin_and_end_at_checkpoints(layout: Layout) -> None:
    places: dict[str, list[np.ndarray]] = {}
    for edge in layout.edges:
        assert edge.line_m is not None
        places.setdefault(edge.start, []).append(edge.line_m[0])
        places.setdefault(edge.end, []).append(edge.line_m[-1])
    for name, own in places.items():
        assert np.ptp(np.array(own), axis=0).max() < 1e-6, name


def test_waypoints_lie_a_metre_apart_at_most(layout: Layout) -> None:
    for edge in layout.edges:
        assert edge.line_m is not None
        steps = np.hypot(*np.diff(edge.line_m, axis=0).T)
        assert steps.max() < 1.6
        assert steps.sum() == pytest.approx(edge.length_m)


def test_turns_are_those_of_the_paper(layout: Layout) -> None:
    """Stages 3 and 5 turn left, 9 and 11 right; in traffic on the left the right turns cross the opposing lane."""
    turned = {}
    for edge in layout.edges:
        if edge.kind in (State.JUNCTION_ON, State.JUNCTION_OFF) and edge.line_m is not None:
            first, last = edge.line_m[1] - edge.line_m[0], edge.line_m[-1] - edge.line_m[-2]
            turn = math.degrees(
                math.remainder(math.atan2(last[1], last[0]) - math.atan2(first[1], first[0]), 2 * math.pi)
            )
            turned[edge.area, edge.kind] = (round(turn), edge.gives_way)
    assert turned == {
        ("A1", State.JUNCTION_ON): (90, False),
        ("A3", State.JUNCTION_OFF): (90, False),
        ("A3", State.JUNCTION_ON): (-90, True),
        ("A1", State.JUNCTION_OFF): (-90, True),
    }


def test_traffic_on_the_other_side_is_geometry_alone(site: Site, layout: Layout) -> None:
    other = layout_of_site(replace(site, keeps="right"))
    assert [edge[:3] for edge in other.edges] == [edge[:3] for edge in layout.edges]
    swapped = [edge.kind for edge in other.edges if edge.gives_way]
    assert swapped
    for mine, theirs in zip(layout.edges, other.edges, strict=True):
        if mine.kind in (State.JUNCTION_ON, State.JUNCTION_OFF):
            assert mine.gives_way != theirs.gives_way


@pytest.mark.parametrize(("keeps", "sign"), [("left", 1.0), ("right", -1.0)])
def test_lanes_lie_on_the_side_that_is_kept_to(site: Site, keeps: str, sign: float) -> None:
    layout = layout_of_site(replace(site, keeps=keeps))
    ahead = edge_line(layout, "A1 out ahead", "A3 in ahead")
    back = edge_line(layout, "A3 out back", "A1 in back")
    assert ahead[0, 1] == pytest.approx(sign * 0.5 * site.road.lane_m)  # the road begins along x: left is +y
    assert back[-1, 1] == pytest.approx(-sign * 0.5 * site.road.lane_m)
    gap = np.hypot(*(ahead[::10, None] - back[None]).reshape(-1, 2).T).reshape(len(ahead[::10]), -1).min(axis=1)
    assert gap == pytest.approx(site.road.lane_m, abs=0.15)


def test_turns_have_the_radius_that_is_asked_for(site: Site, layout: Layout) -> None:
    for edge in layout.edges:
        if edge.kind in (State.JUNCTION_ON, State.JUNCTION_OFF) and edge.line_m is not None:
            steps = np.diff(edge.line_m, axis=0)
            headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
            curvature = np.abs(np.diff(headings)) / np.hypot(*steps[1:].T)
            assert curvature.max() < 1.05 / site.turn_radius_m


def test_the_dump_is_backed_into(layout: Layout) -> None:
    dock = next(edge for edge in layout.edges if edge.end == "D1")
    assert dock.line_m is not None
    assert 0.0 < dock.reverse_from_m < dock.length_m
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(dock.line_m, axis=0).T))])
    cusp = int(np.argmin(np.abs(s - dock.reverse_from_m)))
    before, after = dock.line_m[cusp] - dock.line_m[cusp - 1], dock.line_m[cusp + 1] - dock.line_m[cusp]
    assert before @ after < -0.5 * np.hypot(*before) * np.hypot(*after)


def test_a_third_area_makes_a_junction_to_drive_through(site: Site) -> None:
    middle = replace(site.areas[1], name="A4", at_m=190.0, places=(replace(site.areas[1].places[0], name="D2"),))
    layout = layout_of_site(replace(site, areas=(*site.areas, middle)))
    through = [edge for edge in layout.edges if edge.kind == State.THROUGH]
    assert {(edge.start, edge.end) for edge in through} == {
        ("A4 in ahead", "A4 out ahead"),
        ("A4 in back", "A4 out back"),
    }


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('keeps = "left"', 'keeps = "middle"', "one of"),
        ("at_m = 350.0", "at_m = 900.0", "the road is"),
        ("at_m = 350.0", "at_m = 40.0", "of road between them"),
        ('name = "P1"', 'name = "L1"', "stands twice"),
        ("lane_m = 4.2", "lanes_m = 4.2", "did you mean 'lane_m'"),
        ("line_m = [[-20.0, 0.0], [110.0, 0.0], [220.0, 70.0], [350.0, 70.0]]", "line_m = [[0.0, 0.0]]", "two points"),
    ],
)
def test_what_a_file_may_not_say(tmp_path: Path, old: str, new: str, told: str) -> None:
    text = find_site("hejase").read_text(encoding="utf-8")
    assert old in text
    file = tmp_path / "site.toml"
    file.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(ConfigError, match=told):
        layout_of_site(load_site(file))


def test_a_site_is_found_by_name_or_path(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="did you mean 'hejase'"):
        find_site("hejasse")
    with pytest.raises(InputError, match="no such file"):
        find_site(str(tmp_path / "none.toml"))
