from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.json_files import plain
from lhdmap.topology.geojson import content_sha256, from_geojson, to_geojson

from tests.topology.maps import ladder


def test_a_map_is_read_back_as_it_was_written() -> None:
    table = json.loads(json.dumps(plain(to_geojson(ladder()))))
    again = from_geojson(table)
    assert plain(to_geojson(again)) == table
    assert [one.ends for one in again.tunnels] == [("i1", "i2"), ("i1", "i2"), ("i1", "dead_end")]
    np.testing.assert_allclose(again.points["w1"].pose, ladder().points["w1"].pose, atol=1e-6)


def test_the_contract_s_properties_are_there() -> None:
    wanted = {
        "tunnel": "id name length_m width_min_m width_mean_m grade_max_pct speed_limit_kmh wall_preference T_map_node "
        "not_distinctive_m ends",
        "intersection": "id name degree T_map_node level",
        "access_point": "id node heading_deg joins",
        "waypoint": "id node heading_deg purpose speed_limit_kmh",
        "connection": "from to type length_m min_radius_m feasible closed cost_s",
    }
    table = to_geojson(ladder())
    assert {"format", "map_version", "content_sha256", "frame", "registration"} <= table["lhdmap"].keys()
    for feature in table["features"]:
        properties = feature["properties"]
        assert set(wanted[properties["kind"]].split()) <= properties.keys()


def test_the_hash_is_that_of_what_is_in_the_map() -> None:
    ladder_sha = to_geojson(ladder())["lhdmap"]["content_sha256"]
    assert to_geojson(replace(ladder(), version=7))["lhdmap"]["content_sha256"] == ladder_sha
    shorter = replace(ladder(), tunnels=ladder().tunnels[:2])
    assert to_geojson(shorter)["lhdmap"]["content_sha256"] != ladder_sha
    assert content_sha256([]) == content_sha256([])


@pytest.mark.parametrize(
    "damage", [{}, {"type": "FeatureCollection"}, {"type": "FeatureCollection", "lhdmap": {"format": 99}}]
)
def test_what_is_no_map_of_ours_is_refused(damage: dict[str, object]) -> None:
    with pytest.raises(InputError):
        from_geojson(damage)


def test_a_damaged_feature_is_refused() -> None:
    table = to_geojson(ladder())
    del table["features"][0]["properties"]["ends"]
    with pytest.raises(InputError, match="ends"):
        from_geojson(table)
