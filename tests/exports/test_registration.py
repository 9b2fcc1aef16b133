"""The map's place in the grid: true rigid transforms are found again, lengths stay, bad points are refused."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from lhdmap.errors import EvaluationShortfall, InputError
from lhdmap.exports.judgement import refuse_misfit, remarks
from lhdmap.exports.registration import ControlPoint, Transform, read_transform, register, solve
from lhdmap.messages import FloatArray

from tests.exports.folders import SHIFT_M, TURN_RAD, in_grid

SQUARE = np.array([[0.0, 0.0, 0.0], [80.0, 5.0, 1.0], [70.0, 60.0, -4.0], [-5.0, 40.0, 2.0]])
coordinates = st.floats(-500.0, 500.0)
clouds = st.lists(st.tuples(coordinates, coordinates, st.floats(-50.0, 50.0)), min_size=3, max_size=8)


def points(map_m: FloatArray, grid_m: FloatArray, std_m: float = 0.03) -> list[ControlPoint]:
    return [ControlPoint(f"P{k}", p, q, std_m) for k, (p, q) in enumerate(zip(map_m, grid_m, strict=True))]


def well_spread(map_m: FloatArray) -> bool:
    apart = min(np.linalg.norm(a[:2] - b[:2]) for a, b in itertools.combinations(map_m, 2))
    spread = np.linalg.svd(map_m[:, :2] - map_m[:, :2].mean(axis=0))[1]
    return bool(apart > 10.0 and spread[1] > 10.0)


@given(clouds, st.floats(-np.pi, np.pi), st.tuples(*[st.floats(-1e7, 1e7)] * 3))
def test_a_rigid_transform_is_found_again(
    rows: list[tuple[float, ...]], turn_rad: float, shift: tuple[float, ...]
) -> None:
    map_m = np.array(rows)
    assume(well_spread(map_m))
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    grid_m = map_m @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + np.array(shift)
    found = register(points(map_m, grid_m))
    assert found.rms_m < 1e-6
    assert found.left_out_m.max() < 1e-5
    assert abs(np.angle(np.exp(1j * (found.T_grid_map.rotation_rad - turn_rad)))) < 1e-9
    assert found.scale == pytest.approx(1.0, abs=1e-8)
    refuse_misfit(found)
    assert not remarks(found)
    there = found.T_grid_map.points(map_m)
    np.testing.assert_allclose(there, grid_m, atol=1e-6)
    np.testing.assert_allclose(found.T_grid_map.inverse().points(there), map_m, atol=1e-6)


@given(clouds, clouds, st.floats(0.5, 2.0))
def test_lengths_never_change(rows: list[tuple[float, ...]], noise: list[tuple[float, ...]], scale: float) -> None:
    map_m = np.array(rows)
    grid_m = scale * map_m + np.resize(np.array(noise), map_m.shape) / 100.0
    found = solve(map_m, grid_m, np.ones(len(map_m)))
    there = found.points(map_m)
    for a, b in itertools.combinations(range(len(map_m)), 2):
        assert np.linalg.norm(there[a] - there[b]) == pytest.approx(np.linalg.norm(map_m[a] - map_m[b]), abs=1e-8)


def test_the_answer_is_the_least_squares_one() -> None:
    """Against a general minimizer, with weights and noise."""
    from scipy.optimize import least_squares

    rng = np.random.default_rng(3)
    grid_m = in_grid(SQUARE) - SHIFT_M + rng.normal(0.0, 0.05, SQUARE.shape)
    std_m = np.array([0.01, 0.05, 0.02, 0.08])

    def misses(x: FloatArray) -> FloatArray:
        c, s = np.cos(x[0]), np.sin(x[0])
        there = SQUARE @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + x[1:]
        return ((there - grid_m) / std_m[:, None]).ravel()

    wanted = least_squares(misses, np.zeros(4), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    found = solve(SQUARE, grid_m, std_m**-2.0)
    assert found.rotation_rad == pytest.approx(wanted.x[0], abs=1e-7)
    np.testing.assert_allclose(found.translation_m, wanted.x[1:], atol=1e-6)
    heading_std_deg = np.degrees(np.sqrt(np.linalg.inv(wanted.jac.T @ wanted.jac)[0, 0]))
    excess = max(np.sqrt(2.0 * wanted.cost / 8), 1.0)
    told = register([one._replace(std_m=s) for one, s in zip(points(SQUARE, grid_m), std_m, strict=True)])
    assert told.heading_std_deg == pytest.approx(heading_std_deg * excess, rel=1e-4)


def test_the_standard_deviation_of_the_heading_is_what_noise_does() -> None:
    rng = np.random.default_rng(5)
    turns = []
    for _ in range(400):
        noisy = in_grid(SQUARE) + rng.normal(0.0, 0.03, SQUARE.shape)
        turns.append(solve(SQUARE, noisy, np.ones(4)).rotation_rad - TURN_RAD)
    told = register(points(SQUARE, in_grid(SQUARE))).heading_std_deg
    assert np.degrees(np.std(turns)) == pytest.approx(told, rel=0.12)


def test_a_point_that_is_off_is_named() -> None:
    grid_m = in_grid(SQUARE)
    grid_m[2] += (0.0, 0.0, 1.0)
    found = register(points(SQUARE, grid_m))
    assert found.left_out_m.argmax() == 2
    assert found.left_out_m[2] == pytest.approx(1.0, abs=1e-6)  # what the others alone give is the truth
    with pytest.raises(EvaluationShortfall, match=r"P2: residual 0\.75. m, at most 0\.1 m"):
        refuse_misfit(found)


def test_leaving_out_finds_what_the_residual_hides() -> None:
    """A point far from the others turns the map: its residual is small, what the others say of it is not."""
    map_m = np.array([[0.0, 0.0, 0.0], [6.0, 5.0, 0.0], [3.0, -6.0, 0.0], [300.0, 0.0, 0.0]])
    grid_m = in_grid(map_m)
    grid_m[3] += (0.0, 1.5, 0.0)
    found = register(points(map_m, grid_m), 0.7)
    assert found.misses_m.max() < 0.7 < found.left_out_m[3]
    with pytest.raises(EvaluationShortfall, match="P3: leave-one-out"):
        refuse_misfit(found)


def test_the_scale_is_told_and_not_taken() -> None:
    found = register(points(SQUARE, in_grid(1.004 * SQUARE)), 0.5)
    assert found.scale == pytest.approx(1.004, abs=1e-9)
    (text,) = remarks(found)
    assert "+0.40 %" in text
    assert not remarks(register(points(SQUARE, in_grid(1.0015 * SQUARE)), 0.5))
    with pytest.raises(EvaluationShortfall, match=r"\+2\.00 %"):
        refuse_misfit(register(points(SQUARE, in_grid(1.02 * SQUARE))))


def test_exchanged_axes_are_recognized() -> None:
    with pytest.raises(EvaluationShortfall, match="easting and northing exchanged they would fit"):
        refuse_misfit(register(points(SQUARE, in_grid(SQUARE)[:, [1, 0, 2]])))


def test_a_heading_that_swings_the_far_end_is_told() -> None:
    map_m = np.array([[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, 6.0, 0.0]])
    found = register(points(map_m, in_grid(map_m)))
    (text,) = remarks(found, 300.0)
    assert "heading" in text
    assert f"{np.radians(found.heading_std_deg) * 300.0:.2f} m" in text


@pytest.mark.parametrize(
    ("map_m", "told"),
    [
        (SQUARE[:2], "2 control points; 3 or more"),
        (SQUARE[[0, 1, 1]], "at 2 places in plan"),
        (SQUARE[[0, 0, 0]] + [[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [0.0, 0.0, 3.0]], "at 1 place in plan"),
        (np.array([[0.0, 0.0, 0.0], [40.0, 20.0, 3.0], [80.0, 40.0, 9.0], [100.0, 50.0, 1.0]]), "on one line"),
        (np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]]), "too near together"),
    ],
)
def test_points_that_do_not_fix_a_map_are_refused(map_m: FloatArray, told: str) -> None:
    with pytest.raises(InputError, match=told):
        register(points(map_m, in_grid(map_m)))


def test_a_mark_in_the_roof_above_one_on_the_floor_is_no_trouble() -> None:
    map_m = np.vstack([SQUARE, SQUARE[:1] + np.array([0.0, 0.0, 4.0])])
    assert register(points(map_m, in_grid(map_m))).rms_m < 1e-6


def test_a_registration_is_read_back() -> None:
    found = register(points(SQUARE, in_grid(SQUARE)))
    again = read_transform(json.loads(json.dumps(found.to_json())), "topology.geojson")
    np.testing.assert_allclose(again.points(SQUARE), in_grid(SQUARE), atol=1e-5)
    for damaged in ({}, {"rotation_deg": 1.0}, {"rotation_deg": None, "translation_m": [0, 0, 0]}):
        with pytest.raises(InputError, match=r"topology\.geojson"):
            read_transform(damaged, "topology.geojson")


def test_poses_turn_with_the_map() -> None:
    pose = Transform(np.pi / 2, np.array([10.0, 0.0, 1.0])).pose(np.array([1.0, 0.0, 0.0, np.pi]))
    np.testing.assert_allclose(pose, [10.0, 1.0, 1.0, -np.pi / 2], atol=1e-12)


def test_control_points_of_a_registration_are_checked() -> None:
    member = register(points(SQUARE, in_grid(SQUARE))).to_json()
    member["control_points"][1]["grid_m"] = [1.0, None, 3.0]
    with pytest.raises(InputError, match="damaged"):
        read_transform(member, "topology.geojson")
