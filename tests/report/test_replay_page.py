"""The page of a replay: what it shows of a machine that drives itself, and without one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from lhdmap.report import charts, replay_charts
from lhdmap.report.replay_drive_charts import extent_m, limit_shares
from lhdmap.report.replay_page import render

from tests.report.drives import START_NS, drive, replayed, rows
from tests.report.test_page import Pictures, svgs, words


@pytest.fixture(scope="module")
def page() -> str:
    return render(replayed())


def test_it_has_map_legs_plans_place_and_limits(page: str) -> None:
    found = Pictures(page)
    assert found.open == []
    told = " ".join(words(one) for one in svgs(page))
    for one in ("tunnel of the map", "leg, forward", "leg, reverse", "predicted way", "both bodies", "T1", "planned",
                "commanded", "predicted", "steering command", "speed limited by", "3 deviations, told", "across"):  # fmt: skip
        assert one in told
    assert "5 cm" in page  # 3 along, 4 across
    assert "limits the speed in" in page


def test_stops_say_why_and_are_escaped(page: str) -> None:
    assert "contact on the braking path" in page
    assert "guard: &lt;points&gt;" in page


def test_limits_are_a_lane_with_a_gap_where_nothing_is_planned() -> None:
    ((name, changes),) = replay_charts.limit_lane(replayed())
    assert name == "speed limited by"
    assert [one.state for one in changes] == [
        "limit",
        "stop",
        replay_charts.NOT_PLANNED,
        "stop",
        replay_charts.NOT_PLANNED,
    ]
    assert [round((one.t_ns - START_NS) * 1e-9, 1) for one in changes] == [1.0, 6.2, 8.8, 12.0, 17.8]


def test_shares_of_the_limits_are_those_of_the_plans() -> None:
    shares = dict(limit_shares(drive()))
    assert shares["limit"] == pytest.approx(26 / 70)
    assert sum(shares.values()) == pytest.approx(1.0)


def test_the_plan_looks_at_the_drive_with_all_its_names_within() -> None:
    corners = extent_m(drive(), rows()[:, 1:4])
    assert (corners[1] - corners[0] > [20.0, 0.0]).all()
    with charts.styled():
        (axes,) = replay_charts.plan_chart(replayed()).axes
    low, high = np.sort(axes.get_xlim()), np.sort(axes.get_ylim())
    assert low[0] <= 0.0 <= 20.0 <= low[1]
    assert high[0] <= 0.0 <= high[1]


@pytest.mark.parametrize("left_out", ["topology", "plans", "places", "legs"])
def test_what_is_not_known_is_left_out(left_out: str) -> None:
    empty: dict[str, Any] = {"topology": None, "plans": np.empty((0, 5)), "places": np.empty((0, 5)), "legs": []}
    assert render(replace(replayed(), drive=replace(drive(), **{left_out: empty[left_out]})))
    assert "Place on the map" not in render(replace(replayed(), drive=None))
