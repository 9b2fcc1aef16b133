"""Piles in plain clouds: cones and wedges of known slope and volume, drifts, and the real heaps and drift beside the checkout."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.errors import InputError, UsageError
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.cloud_io import write_cloud
from lhdmap.messages import FloatArray
from lhdmap.pile.clouds.axes import AXES, isolated, rotation_to_up
from lhdmap.pile.clouds.heap import CloudPile, measure_cloud, run_cloud
from lhdmap.pile.result import estimate_json
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.simulation.grizzly import simulate_grizzly

from tests.pile.piled_drift import TOE_M, PiledDrift

README_SLOPES = {
    "Bin_8A.pcd": (22.6, 28.1, 31.6),
    "Bin_4.pcd": (21.6, 26.6, 29.6),
    "last_overhead_concave.pcd": (23.5, 27.2, 29.7),
}


def _ground(extent_m: float, n: int, seed: int = 0) -> FloatArray:
    return np.random.default_rng(seed).uniform(-extent_m / 2, extent_m / 2, (n, 2))


def _cone(slope_deg: float, radius_m: float = 3.0, n: int = 40_000, noise_m: float = 0.0) -> tuple[FloatArray, float]:
    """Return a cone on a floor seen from above, shape (N, 3), and its volume."""
    xy = _ground(3.0 * radius_m, n)
    height = radius_m * math.tan(math.radians(slope_deg))
    z = np.clip(height * (1.0 - np.hypot(*xy.T) / radius_m), 0.0, None)
    z += np.random.default_rng(1).normal(0.0, noise_m, n) if noise_m else 0.0
    return np.column_stack([xy, z]), math.pi * radius_m**2 * height / 3.0


def _wedge(slope_deg: float, azimuth_rad: float = 0.0, n: int = 40_000) -> tuple[FloatArray, float]:
    """Return a floor of 3 m, then a face of 3 m (horizontal), 4 m wide, rising towards the azimuth; and its volume."""
    rng = np.random.default_rng(2)
    x, y = rng.uniform(-3.0, 3.0, n), rng.uniform(-2.0, 2.0, n)
    rise = math.tan(math.radians(slope_deg))
    points = np.column_stack([x, y, np.clip(x, 0.0, None) * rise + rng.normal(0.0, 0.01, n)])
    c, s = math.cos(azimuth_rad), math.sin(azimuth_rad)
    return points @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T, 0.5 * 3.0 * 3.0 * rise * 4.0


@pytest.mark.parametrize("slope_deg", [15.0, 30.0, 38.0, 45.0])
@pytest.mark.parametrize("noise_m", [0.0, 0.03])
def test_cone_has_its_slope_and_volume(slope_deg: float, noise_m: float) -> None:
    points, volume = _cone(slope_deg, noise_m=noise_m)
    found = measure_cloud(points, "z")
    assert found.estimate.inclination_deg == pytest.approx(-slope_deg, abs=1.0)
    assert found.estimate.volume_m3 == pytest.approx(volume, rel=0.05)
    assert found.extra["kind"] == "heap"
    assert found.extra["floor_m"] == pytest.approx(0.0, abs=0.02)
    assert found.estimate.status == ("too_shallow" if slope_deg < 28.0 else "loadable")


@pytest.mark.parametrize("slope_deg", [20.0, 35.0, 50.0])
@pytest.mark.parametrize("azimuth_rad", [0.0, 1.1, -2.4])
def test_wedge_has_its_face_where_it_is(slope_deg: float, azimuth_rad: float) -> None:
    points, volume = _wedge(slope_deg, azimuth_rad)
    found = measure_cloud(points, "z")
    estimate, (face, *others) = found.estimate, found.extra["faces"]
    assert not others
    assert estimate.inclination_deg == pytest.approx(-slope_deg, abs=0.7)
    assert estimate.volume_m3 == pytest.approx(volume, rel=0.05)
    off = math.remainder(face["downhill_deg"] - math.degrees(azimuth_rad) - 180.0, 360.0)
    assert abs(off) < 1.5
    assert estimate.width_m == pytest.approx(4.0, abs=0.3)
    uphill = np.array([math.cos(azimuth_rad), math.sin(azimuth_rad)])
    to_left = np.array([-uphill[1], uphill[0]])
    assert estimate.left_limit_m[:2] @ to_left == pytest.approx(2.0, abs=0.2)
    assert estimate.right_limit_m[:2] @ to_left == pytest.approx(-2.0, abs=0.2)
    assert np.median(estimate.toe_m[:, :2] @ uphill) == pytest.approx(0.2, abs=0.3)
    assert math.radians(slope_deg) > 0 < estimate.inclination_std_deg < 2.0


@settings(max_examples=8, deadline=None)
@given(st.floats(18.0, 50.0), st.floats(0.05, 50.0), st.sampled_from(AXES))
def test_scale_place_and_upward_axis_change_nothing(slope_deg: float, scale: float, axis: str) -> None:
    points, volume = _wedge(slope_deg, 0.4, n=15_000)
    moved = (points * scale + scale * np.array([5.0, -3.0, 2.0])) @ rotation_to_up(axis)
    found, plain = measure_cloud(moved, axis).estimate, measure_cloud(points, "z").estimate
    if scale < 1.2:  # larger ones may be long enough to be asked whether they are drifts
        assert found.inclination_deg == pytest.approx(plain.inclination_deg, abs=0.05)
    assert found.inclination_deg == pytest.approx(-slope_deg, abs=1.0)
    assert found.volume_m3 == pytest.approx(volume * scale**3, rel=0.06)


@pytest.mark.parametrize("axis", AXES)
def test_rotation_to_up_is_a_rotation_that_lifts_the_axis(axis: str) -> None:
    R = rotation_to_up(axis)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    named = np.zeros(3)
    named["xyz".index(axis[-1])] = -1.0 if axis[0] == "-" else 1.0
    np.testing.assert_allclose(R @ named, [0.0, 0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_upward_axis_is_found_where_none_is_named(axis: str) -> None:
    points, _ = _cone(35.0, n=15_000)
    found = measure_cloud(points @ rotation_to_up(axis))
    assert found.extra["up"] == axis
    assert found.estimate.inclination_deg == pytest.approx(-35.0, abs=1.5)


def test_heap_that_hides_its_floor_says_so_in_the_deviation() -> None:
    seen, volume = _cone(35.0)
    covered = seen[np.hypot(seen[:, 0], seen[:, 1]) < 2.5]
    open_found, found = measure_cloud(seen, "z"), measure_cloud(covered, "z")
    assert "lowest" in found.extra["floor_source"]
    assert found.estimate.volume_std_m3 > 3.0 * open_found.estimate.volume_std_m3
    floor = np.column_stack([_ground(9.0, 5000), np.zeros(5000)])
    above_floor = measure_cloud(covered, "z", floor).estimate
    missing = math.pi * 0.5 * math.tan(math.radians(35.0)) * (3.0**2 - 2.5**2) * 0.5
    assert above_floor.volume_m3 == pytest.approx(volume, rel=0.1)
    assert above_floor.volume_m3 == pytest.approx(volume - missing, rel=0.05)


def test_what_is_flat_is_no_pile() -> None:
    rng = np.random.default_rng(3)
    flat = np.column_stack([_ground(6.0, 20_000), rng.normal(0.0, 0.02, 20_000)])
    found = measure_cloud(flat, "z")
    assert found.estimate.status == "none"
    assert "flat" in found.extra["reason"]
    assert found.estimate.volume_m3 == pytest.approx(0.0, abs=0.3)
    tilted = flat @ np.array([[1.0, 0.0, 0.08], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    assert measure_cloud(tilted, "z").estimate.status == "none"


@pytest.mark.parametrize("slope_deg", [20.0, 35.0, 50.0, 60.0])
@pytest.mark.parametrize("heading_rad", [0.0, 2.0, -2.8])
def test_pile_in_a_drift_is_found_without_poses(slope_deg: float, heading_rad: float) -> None:
    drift = PiledDrift(slope_deg=slope_deg, heading_rad=heading_rad, rubble_m=0.04)
    found = measure_cloud(drift.cloud(), "z")
    assert found.extra["kind"] == "drift"
    assert found.estimate.inclination_deg == pytest.approx(-slope_deg, abs=2.0)
    assert found.estimate.width_m == pytest.approx(4.0, abs=0.1)
    left, right = (limit @ drift.R_map_drift for limit in (found.estimate.left_limit_m, found.estimate.right_limit_m))
    np.testing.assert_allclose(left, [TOE_M, 2.0, 0.0], atol=0.3)
    np.testing.assert_allclose(right, [TOE_M, -2.0, 0.0], atol=0.3)


@pytest.mark.parametrize("heading_rad", [0.0, 0.7, -2.0])
def test_boulder_and_attack_point_in_the_cloud_of_a_drift(heading_rad: float) -> None:
    drift = PiledDrift(slope_deg=45.0, heading_rad=heading_rad)
    plain = measure_cloud(drift.cloud(), "z").estimate
    assert plain.boulders == ()
    assert plain.attack is not None
    np.testing.assert_allclose(plain.attack.point_m, drift.R_map_drift @ [TOE_M, 0.0, 0.0], atol=0.3)
    assert abs(math.remainder(plain.attack.heading_rad - heading_rad, 2.0 * math.pi)) < 0.05

    face = drift.face()
    y, z = face[:, 1] - 0.4, face[:, 2] - 0.8
    ball = np.hypot(y, z) < 0.6
    front = TOE_M + 0.8 - np.sqrt(np.maximum(0.36 - y**2 - z**2, 0.0))
    face[ball, 0] = np.minimum(face, front[:, None])[ball, 0]
    rest = drift.cloud()[: -len(face)]
    found = measure_cloud(np.concatenate([rest, face @ drift.R_map_drift.T]), "z").estimate
    (rock,) = found.boulders
    assert rock.size_m == pytest.approx(1.2, rel=0.25)
    assert (
        np.linalg.norm(rock.center_m - drift.R_map_drift @ [TOE_M + 0.8, 0.4, 0.8]) < 0.35
    )  # its lower half is not seen


def test_drift_with_open_ends_is_none_with_a_reason() -> None:
    drift = PiledDrift(rubble_m=0.0)
    cloud = drift.cloud()
    through = cloud[cloud[:, 0] < TOE_M - 0.2]
    found = measure_cloud(through, "z")
    assert found.estimate.status == "none"
    assert "drift" in found.extra["reason"]
    assert found.estimate.warnings == (found.extra["reason"],)


def test_muck_along_one_wall_is_no_pile() -> None:
    drift = PiledDrift()
    cloud = drift.cloud()
    through = cloud[cloud[:, 0] < TOE_M - 0.2]
    x, up = np.meshgrid(np.arange(TOE_M - 12.0, TOE_M - 0.2, 0.05), np.arange(0.0, 1.2, 0.05), indexing="ij")
    muck = np.column_stack([x.ravel(), 2.0 - (1.2 - up.ravel()), up.ravel()])
    assert measure_cloud(np.concatenate([through, muck]), "z").estimate.status == "none"


def test_faults_are_told(tmp_path: Path) -> None:
    points = _cone(30.0, n=3000)[0]
    with pytest.raises(UsageError, match="--up up"):
        measure_cloud(points, "up")
    with pytest.raises(InputError, match="at least 200"):
        measure_cloud(points[:50], "z")
    write_cloud(tmp_path / "few.ply", GridCloud(points[:50].astype(np.float32)))
    with pytest.raises(InputError, match=r"few\.ply: 50 points"):
        run_cloud(tmp_path / "few.ply", "z")
    with pytest.raises(InputError, match=r"no\.pcd"):
        run_cloud(tmp_path / "no.pcd", "z")


@pytest.mark.parametrize(
    "points",
    [
        np.ones((300, 3)),
        np.column_stack([np.linspace(0.0, 5.0, 300), np.zeros(300), np.zeros(300)]),
        np.column_stack([np.zeros(300), np.zeros(300), np.linspace(0.0, 5.0, 300)]),
        np.random.default_rng(0).normal(0.0, 1.0, (300, 3)),
    ],
)
def test_degenerate_clouds_give_an_answer(points: FloatArray) -> None:
    assert measure_cloud(points, "z").estimate.status in {"none", "too_shallow", "loadable", None}


@pytest.mark.parametrize("seed", [3, 4, 11, 13])
def test_a_grizzly_is_no_drift_and_nothing_is_said_of_what_closes_one(seed: int) -> None:
    """The hopper's walls were a wall, 100 %, or a hang-up; its 8 x 8 m were a drift that nothing closes (11)."""
    found = measure_cloud(simulate_grizzly(Rockbreaker(), seed).points_m, "z")
    estimate = found.estimate
    assert estimate.status is None
    assert estimate.probabilities == {}
    assert "no drift is seen around it" in estimate.reason
    assert not estimate.found
    values = estimate_json(estimate)
    assert values["status"] is None
    assert values["probabilities"] is None
    assert values["width_m"] is None
    assert values["inclination_deg"] is None


@pytest.mark.parametrize("slope_deg", [20.0, 38.0, 80.0])
def test_a_face_cut_out_of_its_drift_is_what_its_slope_says_or_not_said(slope_deg: float) -> None:
    drift = PiledDrift(slope_deg=slope_deg, rubble_m=0.04)
    found = measure_cloud(drift.face() @ drift.R_map_drift.T, "z").estimate
    assert found.status == {20.0: "too_shallow", 38.0: "loadable", 80.0: None}[slope_deg]
    assert found.found == (found.status is not None)
    if found.found:
        assert found.inclination_deg == pytest.approx(-slope_deg, abs=1.0)


@pytest.mark.parametrize("suffix", [".ply", ".las", ".laz", ".pcd"])
def test_a_national_grid_changes_only_the_places(suffix: str, tmp_path: Path) -> None:
    import open3d as o3d

    points, _ = _wedge(35.0, 0.4, n=15_000)
    shift = np.array([412_345.0, 6_743_210.0, 312.0])
    path = tmp_path / f"wedge{suffix}"
    if suffix in (".las", ".laz"):
        write_cloud(path, GridCloud(points.astype(np.float32), origin_m=(412_345.0, 6_743_210.0, 312.0)))
    elif suffix == ".ply":
        o3d.io.write_point_cloud(path, o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points + shift)))
    else:
        head = "VERSION .7\nFIELDS X Y Z\nSIZE 8 8 8\nTYPE F F F\nWIDTH 15000\nHEIGHT 1\nPOINTS 15000\nDATA binary\n"
        path.write_bytes(head.encode() + (points + shift).tobytes())
    found, plain = run_cloud(path, "z"), measure_cloud(points, "z")
    assert found.estimate.inclination_deg == pytest.approx(plain.estimate.inclination_deg, abs=0.05)
    assert found.estimate.volume_m3 == pytest.approx(plain.estimate.volume_m3, rel=0.01)
    np.testing.assert_allclose(found.estimate.center_m, plain.estimate.center_m + shift, atol=0.05)
    np.testing.assert_allclose(found.estimate.left_limit_m, plain.estimate.left_limit_m + shift, atol=0.2)
    assert found.extra["floor_m"] == pytest.approx(312.0, abs=0.02)


def test_isolated_points_are_those_far_from_all() -> None:
    points = np.concatenate([_cone(30.0, n=5000)[0], [[0.0, 0.0, -9.0], [30.0, 0.0, 0.0]]])
    np.testing.assert_array_equal(np.flatnonzero(isolated(points)), [5000, 5001])


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".las", ".laz"])
def test_files_give_what_arrays_give(suffix: str, tmp_path: Path) -> None:
    points, _ = _cone(33.0, n=10_000)
    write_cloud(tmp_path / f"cone{suffix}", GridCloud(points.astype(np.float32)))
    found = run_cloud(tmp_path / f"cone{suffix}", "z")
    assert found.estimate.inclination_deg == pytest.approx(
        measure_cloud(points, "z").estimate.inclination_deg, abs=0.05
    )


def _real(shared_data: Path, name: str) -> CloudPile:
    return run_cloud(shared_data / "10_piles" / name, "z")


@pytest.mark.shared
@pytest.mark.parametrize("name", sorted(README_SLOPES))
def test_slopes_of_real_heaps_are_those_measured_before(name: str, shared_data: Path) -> None:
    found = _real(shared_data, name)
    slopes = [found.extra[key] for key in ("slope_median_deg", "slope_p75_deg", "slope_p90_deg")]
    np.testing.assert_allclose(slopes, README_SLOPES[name], atol=1.0)
    # steel balls at their angle of repose: no face is steeper, the largest is not far below
    assert 23.0 < -found.estimate.inclination_deg < 30.0
    assert found.extra["kind"] == "heap"
    assert found.estimate.volume_m3 > 5.0


@pytest.mark.shared
def test_volumes_of_boxes_of_balls_are_in_order_and_in_proportion(shared_data: Path) -> None:
    counts = np.array([25, 50, 100])
    empty = _real(shared_data, "box_empty.pcd")
    assert empty.estimate.status == "none"
    full = [_real(shared_data, f"box_balls_{count}_deep.pcd").estimate.volume_m3 for count in counts]
    above_empty = np.array(full) - empty.estimate.volume_m3
    assert np.all(np.diff(above_empty) > 0.0)
    each = above_empty / counts
    np.testing.assert_allclose(each, each.mean(), rtol=0.12)
    # about 52 mm across and packed to a half to three quarters: 0.10 to 0.16 l a ball
    assert 0.9e-4 < each.mean() < 1.6e-4
    assert empty.estimate.volume_m3 < 0.1 * full[0]


@pytest.mark.shared
@pytest.mark.parametrize("up", ["z", "auto"])
def test_real_drift_has_no_pile_and_says_why(up: str, shared_data: Path) -> None:
    found = run_cloud(next((shared_data / "08_mine_jinchuan").glob("*.pcd")), up)
    assert found.extra["up"] == "z"
    assert found.estimate.status == "none"
    assert "drift" in found.extra["reason"]
    assert "from wall to wall" in found.extra["reason"]
