"""One machine description for both machines: the truck's file has the loader's sections, and the findings' numbers."""

from __future__ import annotations

import math
import tomllib

import pytest
from lhdmap.docking.planner import least_radius_m
from lhdmap.resources import resource

from tests.tracking.machines import BODIES, LENGTHS, MODELS


def test_the_truck_has_the_sections_and_keys_of_the_loader() -> None:
    truck, loader = (
        tomllib.loads(resource(f"pipelines/machines/{name}.toml").read_text(encoding="utf-8"))
        for name in ("truck_28t", "lhd_11t")
    )
    assert truck.keys() == loader.keys() - {"digging"}  # it has no bucket
    for section in ("dimensions", "drive", "steering", "brakes", "linkage", "spread"):
        assert truck[section].keys() == loader[section].keys()


def test_each_value_of_the_truck_says_that_it_is_assumed() -> None:
    lines = resource("pipelines/machines/truck_28t.toml").read_text(encoding="utf-8").splitlines()
    assert "EVERY VALUE IS ASSUMED" in lines[1]
    sections = lines[: lines.index("[spread]")]
    told = [line for line in sections if "Source:" in line]
    assert all(
        "assumed" in line or "the loader's" in line or "frames of the log" in line or "lhdmap" in line for line in told
    )


def test_the_truck_is_that_of_the_findings() -> None:
    model = MODELS["truck"]
    assert LENGTHS["truck"] == (1.30, 3.02)
    assert math.degrees(model.max_articulation_rad) == pytest.approx(45.0)
    assert math.degrees(model.max_rate_rps) == pytest.approx(18.0)
    assert (model.steering_lag_s, model.dead_time_s) == (0.15, 0.2)
    (_, y0), (x1, y1) = BODIES["truck"].front_box_m
    assert (y1 - y0, x1) == pytest.approx((2.9, 2.6))
    assert BODIES["truck"].rear_box_m[0, 0] == pytest.approx(-3.4)


@pytest.mark.parametrize(("name", "radius"), [("truck", 5.2), ("loader", 4.7)])
def test_the_least_radius_is_that_of_the_largest_joint_angle(name: str, radius: float) -> None:
    """Both axles on circles about one point, as far inside as outside of the path: L0 = L1 gives L / tan(β / 2)."""
    assert least_radius_m(MODELS[name]) == pytest.approx(radius, abs=0.05)
    if name == "loader":
        assert least_radius_m(MODELS[name]) == pytest.approx(1.7 / math.tan(math.radians(20.0)), rel=1e-6)
