"""Which node a place is in; the file of a map's views."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.topology.lookup import Lookup
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.views import Fan, View
from lhdmap.topology.views_file import read_views, write_views

from tests.topology.maps import ladder


def test_places_are_in_tunnels_intersections_and_at_waypoints() -> None:
    lookup = Lookup(ladder())
    places = np.array([[30.0, 1.0, 0.0], [0.5, -1.0, 0.0], [30.0, 29.0, 0.0], [0.0, -26.5, 0.0], [0.0, -15.0, 0.0]])
    assert lookup.nodes_at(places) == ["t1", "i1", "t2", "t3", "t3"]
    assert lookup.names_at(places) == ["T1", "I1", "T2", "DP1", "T3"]


def test_what_is_far_or_on_another_level_has_no_name() -> None:
    lookup = Lookup(ladder())
    assert lookup.names_at(np.array([[30.0, -20.0, 0.0], [30.0, 0.0, 4.0]]), 3.0) == ["", ""]
    assert lookup.names_at(np.array([[30.0, -20.0, 0.0]])) != [""]


def test_an_empty_map_names_nothing() -> None:
    assert Lookup(TopologicalMap((), (), (), (), ())).names_at(np.zeros((2, 3))) == ["", ""]


def views() -> list[View]:
    rng = np.random.default_rng(1)
    fans = [Fan(rng.normal(size=2), rng.uniform(-30.0, 30.0, (n, 3)).astype(np.float32)) for n in (5, 0, 7)]
    return [View(1_700_000_000_000_000_001, 0.0, (fans[0],)), View(1_700_000_000_500_000_002, 1.5, (fans[1], fans[2]))]


def test_views_come_back_to_the_millimetre(tmp_path: Path) -> None:
    found = read_views(write_views(tmp_path / "views.npz", views()))
    assert [(one.time_ns, one.travelled_m, len(one.fans)) for one in found] == [
        (one.time_ns, one.travelled_m, len(one.fans)) for one in views()
    ]
    for one, other in zip(found, views(), strict=True):
        assert one.hits_m == pytest.approx(other.hits_m, abs=0.0006)
        assert [fan.origin_m.tolist() for fan in one.fans] == [fan.origin_m.tolist() for fan in other.fans]


def test_hits_beyond_what_the_file_can_hold_are_left_out(tmp_path: Path) -> None:
    hits = np.array([[1.0, 2.0, 0.5], [40.0, 0.0, 0.0], [np.nan, 0.0, 0.0]], np.float32)
    (found,) = read_views(write_views(tmp_path / "views.npz", [View(1, 0.0, (Fan(np.zeros(2), hits),))]))
    assert found.hits_m == pytest.approx(hits[:1])


def test_no_views_are_none(tmp_path: Path) -> None:
    assert read_views(write_views(tmp_path / "views.npz", [])) == []


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04 half of one"])
def test_a_damaged_file_is_told(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "views.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"views\.npz.*build the map again"):
        read_views(path)


def test_half_a_file_and_another_archive_are_told(tmp_path: Path) -> None:
    path = write_views(tmp_path / "views.npz", views())
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(InputError, match="build the map again"):
        read_views(path)
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(InputError, match="build the map again"):
        read_views(tmp_path / "other.npz")
