"""Edits of a map: each does what it says, and one about something that is not there says what is."""

from __future__ import annotations

from pathlib import Path

import pytest
from lhdmap.errors import ConfigError, InputError
from lhdmap.topology.edits import NO_EDITS, TopologyEdits, edited, load_edits, waypoints_added
from lhdmap.topology.model import TopologicalMap

from tests.topology.maps import ladder


def edits(text: str, folder: Path) -> TopologyEdits:
    file = folder / "edits.toml"
    file.write_text(text, encoding="utf-8")
    return load_edits(file)


def changed(text: str, folder: Path) -> TopologicalMap:
    return edited(ladder(), edits(text, folder))


def test_without_edits_nothing_changes() -> None:
    assert load_edits(None) is NO_EDITS
    before = ladder()
    assert edited(before, NO_EDITS) == before or edited(before, NO_EDITS).names() == before.names()


@pytest.mark.parametrize(
    ("what", "old"), [('node = "T1"', "T1"), ('node = "i2"', "I2"), ('node = "DP1"', "DP1"), ("at_m = [1, 27]", "T2")]
)
def test_rename_by_name_id_or_place(what: str, old: str, tmp_path: Path) -> None:
    found = changed(f'[[rename]]\n{what}\nname = "new"\n', tmp_path)
    assert "new" in found.names()
    assert old not in found.names()


def test_rename_at_an_intersection_means_the_intersection(tmp_path: Path) -> None:
    found = changed('[[rename]]\nat_m = [1.0, 1.0]\nname = "cross"\n', tmp_path)
    assert [node.name for node in found.intersections] == ["cross", "I2"]


def test_a_closed_tunnel_closes_its_connections(tmp_path: Path) -> None:
    found = changed('[[close]]\nnode = "T2"\n', tmp_path)
    assert [tunnel.closed for tunnel in found.tunnels] == [False, True, False]
    closed = [one for one in found.connections if one.closed]
    assert [(one.start, one.end) for one in closed] == [("t2.start", "t2.end")]


def test_a_limit_is_that_of_the_tunnel_and_its_connections(tmp_path: Path) -> None:
    found = changed('[[limit]]\nat_m = [20, 1]\nspeed_limit_kmh = 7.0\nwall_preference = "left"\n', tmp_path)
    assert (found.tunnels[0].speed_limit_kmh, found.tunnels[0].wall_preference) == (7.0, "left")
    limits = {one.start.split(".")[0]: one.speed_limit_kmh for one in found.connections}
    assert limits["t1"] == 7.0
    assert limits["t2"] == 12.0


def test_an_added_waypoint_lies_on_the_tunnel_s_line(tmp_path: Path) -> None:
    wanted = edits('[[add]]\nname = "S1"\nat_m = [25.0, 2.0]\npurpose = "stop"\nspeed_limit_kmh = 5.0\n', tmp_path)
    point = waypoints_added(ladder(), wanted)[0]
    assert (point.name, point.node, point.purpose, point.speed_limit_kmh) == ("S1", "t1", "stop", 5.0)
    assert point.pose == pytest.approx([25.0, 0.0, 0.0, 0.0], abs=0.6)


def test_merge_and_split_are_places(tmp_path: Path) -> None:
    wanted = edits("[[merge]]\nat_m = [1, 2]\n[[split]]\nat_m = [3, 4]\n[[split]]\nat_m = [5, 6]\n", tmp_path)
    assert wanted.together_m.tolist() == [[1.0, 2.0]]
    assert wanted.apart_m.tolist() == [[3.0, 4.0], [5.0, 6.0]]
    assert NO_EDITS.apart_m.shape == (0, 2)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[[rename]]\nnode = "DP2"\nname = "x"\n', "DP1"),
        ('[[close]]\nnode = "T33"\n', "T3"),
        ('[[limit]]\nnode = "I1"\nspeed_limit_kmh = 5.0\n', "no tunnel 'I1'"),
        ("[[close]]\nat_m = [500, 500]\n", "no tunnel is near"),
        ('[[rename]]\nat_m = [500, 500]\nname = "x"\n', "nothing of the map is near"),
    ],
)
def test_what_is_not_there_is_refused_with_what_is(text: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=told):
        changed(text, tmp_path)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[[renam]]\nnode = "T1"\nname = "x"\n', "rename"),
        ('[[rename]]\nnode = "T1"\n', "name"),
        ('[[add]]\nname = "W"\nat_m = [1, 2]\npurpose = "draw"\n', "draw_point"),
        ('[[limit]]\nnode = "T1"\nspeed_limit_kmh = -1.0\n', "speed_limit_kmh"),
    ],
)
def test_a_wrong_file_is_refused(text: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=told):
        edits(text, tmp_path)


def test_a_file_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        load_edits(tmp_path / "none.toml")
    with pytest.raises(InputError):
        edits("rename = [", tmp_path)
