"""Fit of the face, floor check of the tilt, memory of the hits: against least squares and known truth."""

from __future__ import annotations

import math
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.messages import FloatArray
from lhdmap.pile.face import FaceRegistration, PileFace, find, fit
from lhdmap.pile.judge import StatusEvidence, probabilities
from lhdmap.pile.measure import _unseen_deg
from lhdmap.pile.result import STATUSES
from lhdmap.pile.surface import _on_face
from lhdmap.pile.tilt import TiltCheck
from lhdmap.pile.window import HitWindow

FACE = np.array([0.4, 0.15, 0.9])
EXACT = FaceRegistration(1e-6, 1e-6)
DRIFTING = FaceRegistration(0.003, math.radians(0.2))


def _face_hits(noise_m: float, climb: float = 0.0, wander_m: float = 1.0, seed: int = 1) -> FloatArray:
    """Return hits (N, 4), one in each cell of 0.1 m, on a plane; `travelled` rises with z by `climb` and wanders by itself."""
    rng = np.random.default_rng(seed)
    y, z = (axis.ravel() for axis in np.meshgrid(np.arange(-1.95, 2.0, 0.1), np.arange(0.25, 1.6, 0.1)))
    x = FACE[0] + FACE[1] * y + FACE[2] * z + rng.normal(0.0, noise_m, len(y))
    hits: FloatArray = np.column_stack([x, y, z, climb * z + rng.normal(0.0, wander_m, len(y))])
    return hits


def _by_least_squares(hits: FloatArray) -> FloatArray:
    A = np.column_stack([np.ones(len(hits)), hits[:, 1:3]])
    found: FloatArray = np.linalg.lstsq(A, hits[:, 0], rcond=None)[0].astype(np.float64)
    return found


@pytest.mark.parametrize("noise_m", [0.0, 0.01, 0.05])
def test_clean_face_is_that_of_least_squares(noise_m: float) -> None:
    hits = _face_hits(noise_m)
    face = fit(hits, FACE, EXACT)
    assert [face.a, face.b, face.c] == pytest.approx(_by_least_squares(hits), abs=0.002 + 0.1 * noise_m)
    assert face.inclination_deg == pytest.approx(-math.degrees(math.atan2(1.0, FACE[2])), abs=0.2 + 25.0 * noise_m)


def test_outliers_do_not_move_the_face() -> None:
    hits = _face_hits(0.01)
    rng = np.random.default_rng(2)
    out = rng.choice(len(hits), len(hits) // 5, replace=False)
    hits[out, 0] -= rng.uniform(0.5, 2.0, len(out))
    face = fit(hits, FACE + np.array([0.1, 0.0, -0.1]), EXACT)
    assert [face.a, face.b, face.c] == pytest.approx(FACE, abs=0.01)
    assert abs(_by_least_squares(hits)[0] - FACE[0]) > 0.1  # what they do to a fit that is not robust


def test_deviation_grows_where_height_is_travel() -> None:
    """On a flat floor the scanner climbs the face as the machine drives: height and odometry's drift are one."""
    flat = fit(_face_hits(0.02, climb=10.0, wander_m=0.0), FACE, DRIFTING)
    waved = fit(_face_hits(0.02, climb=10.0, wander_m=4.0), FACE, DRIFTING)
    exact = fit(_face_hits(0.02, climb=10.0, wander_m=0.0), FACE, EXACT)
    assert flat.inclination_std_deg > 1.3 * waved.inclination_std_deg
    assert flat.inclination_std_deg > 1.3 * exact.inclination_std_deg


def test_drift_of_the_odometry_is_told_from_the_slope_where_pitch_varies() -> None:
    hits = _face_hits(0.01, climb=10.0, wander_m=4.0)
    hits[:, 0] += 0.004 * (hits[:, 3] - hits[:, 3].mean())
    face = fit(hits, FACE, DRIFTING)
    assert face.drift == pytest.approx(0.004, abs=0.001)
    assert face.c == pytest.approx(FACE[2], abs=0.02)


def test_find_prefers_the_large_plane_and_says_none_for_nothing() -> None:
    hits = _face_hits(0.02)
    noise = np.random.default_rng(4).uniform([-8.0, -2.0, 0.0, 0.0], [0.0, 2.0, 1.6, 0.0], (60, 4))
    found = find(np.concatenate([hits, noise]), np.random.default_rng(0))
    assert found is not None
    assert found == pytest.approx(FACE, abs=0.1)
    assert find(hits[:5], np.random.default_rng(0)) is None


evidence = st.builds(
    StatusEvidence,
    inclination_deg=st.floats(-175.0, 0.0),
    std_deg=st.floats(0.0, 90.0),
    grain_m=st.floats(0.0, 2.0),
    covered=st.floats(0.0, 1.0),
    beyond=st.floats(0.0, 1.0),
    gap_m=st.floats(0.0, 99.0),
    fit_std_deg=st.floats(0.0, 90.0),
)


@settings(max_examples=200, deadline=None)
@given(evidence)
def test_probabilities_are_a_distribution(seen: StatusEvidence) -> None:
    found = probabilities(seen)
    assert set(found) == set(STATUSES)
    assert all(-1e-12 <= value <= 1.0 + 1e-12 for value in found.values())
    assert sum(found.values()) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("inclination_deg", "grain_m", "status"),
    [
        (-15.0, 0.05, "too_shallow"),
        (-45.0, 0.1, "loadable"),
        (-70.0, 0.1, "hang_up"),
        (-90.0, 0.02, "wall"),
        (-90.0, 0.3, "hang_up"),
        (-120.0, 0.1, "hang_up"),
        (-3.0, 0.02, "none"),
    ],
)
def test_each_status_owns_its_range(inclination_deg: float, grain_m: float, status: str) -> None:
    found = probabilities(StatusEvidence(inclination_deg, 0.5, grain_m, 1.0, 0.0, 0.0))
    assert max(found, key=lambda name: found[name]) == status
    assert found[status] > 0.95


def test_half_a_face_closes_nothing() -> None:
    found = probabilities(StatusEvidence(-45.0, 0.5, 0.1, 0.35, 0.0, 0.0))
    assert found["none"] == pytest.approx(1.0)


@pytest.mark.parametrize("error_deg", [0.3, -0.3, 0.0])
def test_flat_floor_tells_the_tilt(error_deg: float) -> None:
    """Floor that was seen from 9 to 30 m before and is driven over now lies too high by the angle times the range."""
    check, rng = TiltCheck(math.radians(0.5)), np.random.default_rng(5)
    for travelled_m in np.arange(0.0, 40.0, 0.5):
        ranges = rng.uniform(9.0, 30.0, 12)
        x, y = rng.uniform(-0.4, 0.4, (2, 12))
        z = math.radians(error_deg) * ranges + rng.normal(0.0, 0.02, 12)
        check.update(np.column_stack([x, y, z, travelled_m - ranges + x]), float(travelled_m))
    tilt = check.tilt()
    assert math.degrees(tilt.angle_rad) == pytest.approx(error_deg, abs=0.05)
    assert math.degrees(tilt.std_rad) < 0.1
    warning = tilt.warning()
    assert (warning is None) == (error_deg == 0.0)
    if warning is not None:
        assert ("lower" if error_deg > 0.0 else "higher") in warning


def test_without_floor_the_tilt_keeps_its_prior() -> None:
    tilt = TiltCheck(math.radians(0.4)).tilt()
    assert (tilt.angle_rad, tilt.warning()) == (0.0, None)
    assert math.degrees(tilt.std_rad) == pytest.approx(0.4)


def test_window_keeps_its_size() -> None:
    window = HitWindow(20.0)
    angles = np.radians(np.arange(-90.0, 90.0, 0.5))
    fan = 5.0 * np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])

    def drive(from_m: float, to_m: float) -> int:
        for travelled_m in np.arange(from_m, to_m, 0.1):
            here = np.array([travelled_m, 0.0, 0.0])
            window.add(fan + here, here, float(travelled_m))
        return len(window.hits(np.array([to_m, 0.0, 0.0, 0.0]), to_m))

    first = drive(0.0, 100.0)
    tracemalloc.start()
    later = drive(100.0, 200.0)
    grown, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert later == pytest.approx(first, rel=0.02)
    assert grown < 1_000_000
    assert window.hits(np.array([175.0, 0.0, 0.0, 0.0]), 200.0)[:, 3].min() > 180.0 - 0.2


def test_window_takes_nothing_twice_while_the_machine_stands() -> None:
    window, fan = HitWindow(20.0), np.column_stack([np.full(9, 5.0), np.arange(9.0), np.zeros(9)])
    for _ in range(5):
        window.add(fan, np.zeros(3), 0.0)
    assert len(window.hits(np.zeros(4), 0.0)) == 9


def test_height_that_was_not_seen_is_as_unsure_as_the_face_is_rough() -> None:
    smooth, rough = (PileFace(0.0, 0.0, 1.0, 0.0, np.eye(4), spread, 50) for spread in (0.07, 0.14))
    z = np.linspace(0.2, 1.6, 57)  # the heights that the inclination is defined over, floor at 0
    assert _unseen_deg(smooth, 0.0, z) == pytest.approx(0.0, abs=1e-9)
    assert _unseen_deg(smooth, 0.0, z[:20]) > _unseen_deg(smooth, 0.0, z[:36]) > 0.0
    assert _unseen_deg(rough, 0.0, z[:20]) == pytest.approx(2.0 * _unseen_deg(smooth, 0.0, z[:20]))
    above = np.linspace(1.4, 2.3, 37)  # hardly any of them, but much above: better than these alone, not as good as all
    assert 0.0 < _unseen_deg(smooth, 0.0, above) < _unseen_deg(smooth, 0.0, above[above < 1.6])


@pytest.mark.parametrize("lowest_m", [0.3, 1.3])
def test_a_face_that_is_only_seen_high_up_is_measured_there(lowest_m: float) -> None:
    """Downhill, a scan meets the face above most of the heights that the inclination is defined over."""
    rng = np.random.default_rng(4)
    y, z = rng.uniform(-1.8, 1.8, 4000), rng.uniform(lowest_m, 2.6, 4000)
    points = np.column_stack([1.0 + z + rng.normal(0.0, 0.03, 4000), y, z, np.zeros(4000)])
    used = np.zeros(len(points), np.bool_)
    _, _, hits = _on_face(points, np.array([1.0, 0.0, 1.0]), (2.0, -2.0), (0.0, 0.0), used)
    assert hits == used.sum()
    assert np.ptp(points[used, 2]) > 0.85
    assert points[used, 2].max() < max(1.6, lowest_m + 1.0) + 0.1


@pytest.mark.parametrize("std_deg", [4.0, 8.0])
def test_probabilities_do_not_jump_with_the_slope(std_deg: float) -> None:
    at = [StatusEvidence(angle, std_deg, 0.1, 1.0, 0.0, 0.2, std_deg) for angle in np.arange(-100.0, 0.0, 0.25)]
    steps = np.diff([[probabilities(one)[name] for name in STATUSES] for one in at], axis=0)
    assert np.abs(steps).max() < 0.05
