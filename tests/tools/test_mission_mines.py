"""Mines that are drawn at random are mines: plans load, a machine can stand at each place; the page tells of all of them."""

from __future__ import annotations

from pathlib import Path

import pytest
from lhdmap.machine import Machine
from lhdmap.mine.make_network import make_network
from lhdmap.mine.plan import load_plan
from lhdmap.mine.stands import stand_at
from tools.evaluate.mission_mines import page, plan_of


@pytest.mark.parametrize("seed", range(1, 7))
def test_a_plan_is_a_mine_with_its_places(seed: int, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(plan_of(seed), encoding="utf-8")
    network = make_network(load_plan(path))
    places = {place.name: place for place in network.plan.places}
    assert set(places) == {"Stope", "Pass", "Yard"}
    for place in places.values():
        tube, at_m, _ = stand_at(network, place, Machine())
        assert 0.0 < at_m < network.tubes[tube].length_m
    assert plan_of(seed) == plan_of(seed) != plan_of(seed + 1)


def test_the_page_hides_no_miss() -> None:
    good = {
        "seed": 2, "buckets": 2, "ok": True, "reason": "done", "cycles": 2, "tonnes": 20.5, "duration_s": 300.0,
        "min_clearance_m": 0.2, "assists": 1, "contacts": [],
    }  # fmt: skip
    touched = good | {
        "seed": 1, "ok": False, "reason": "contact: bucket", "cycles": 0, "tonnes": 0.0, "contacts": [{}],
    }  # fmt: skip
    text = page([good, touched, {"seed": 3, "buckets": 2, "ok": False, "reason": "'Stope' is not on the map"}])
    assert "| mines | 3 |" in text
    assert "| all buckets dumped, machine back home | 1 |" in text
    assert "| contacts | 1 |" in text
    assert "| requests for help | 2 |" in text
    assert "| 1 | contact: bucket | 0 of 2 |" in text
    assert "| 3 | 'Stope' is not on the map | 0 of 2 |" in text
