"""What a mission says of its places, on maps whose names say nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest
from lhdmap.errors import UsageError
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.work_places import point_called, with_work

from tests.topology.maps import ladder


def unnamed() -> TopologicalMap:
    """The ladder, its dead end called Ore as the teaching drive said it, and the point at its end W1."""
    found = ladder()
    dead_end = next(one for one in found.tunnels if one.id == "t3")
    point = found.called("DP1")
    return replace(
        found,
        tunnels=tuple(replace(one, name="Ore") if one is dead_end else one for one in found.tunnels),
        waypoints=tuple(replace(one, name="W1", purpose="stop") if one is point else one for one in found.waypoints),
    )


@pytest.mark.parametrize("name", ["Ore", "W1"])
def test_the_point_of_a_dead_end_is_what_the_mission_says(name: str) -> None:
    found = with_work(unnamed(), [name], [])
    point = found.called(name)
    assert getattr(point, "purpose", "") == "draw_point"
    assert getattr(point, "node", "") == "t3"
    assert with_work(unnamed(), [], [name]).waypoints[0].purpose == "dump"
    assert with_work(unnamed(), [], [], [name]).waypoints[0].purpose == "park"


def test_an_id_names_a_point_and_does_not_rename_it() -> None:
    found = with_work(unnamed(), [unnamed().waypoints[0].id], []).waypoints[0]
    assert (found.name, found.purpose) == ("W1", "draw_point")


def test_a_start_that_is_no_point_or_one_of_work_stays_what_it_is() -> None:
    before = ladder()
    assert with_work(before, [], [], ["I1", "", "DP1", "nowhere"]) is before


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("I1", "'I1' is no point.*DP1"),
        ("T1", "'T1' is no point.*DP1"),
        ("DP2", "'DP2' is not on the map.*did you mean 'DP1'"),
    ],
)
def test_what_is_no_point_is_refused_with_the_points_there_are(name: str, said: str) -> None:
    with pytest.raises(UsageError, match=f"mission: {said}"):
        with_work(ladder(), [name], [])
    with pytest.raises(UsageError, match=f"mission: {said}"):
        with_work(ladder(), [], [name])


def test_a_driven_through_tunnel_has_no_end_of_its_own() -> None:
    assert point_called(ladder(), "T1") is None
    assert point_called(ladder(), "DP1") is not None
