"""Rock is the more alike the nearer: what a tilted scanner sees of a rough wall is found again at a right angle to its scans."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.config import Settings
from lhdmap.geometry.se3 import from_rpy
from lhdmap.logs.source import LogSource
from lhdmap.messages import FloatArray
from lhdmap.pipeline.inputs import ROLES_READ
from lhdmap.pipeline.mapping import MappingOptions, MappingPipeline, feed
from lhdmap.pipeline.track import resample
from lhdmap.scan_matching.slant import rise_of, slants
from lhdmap.simulation.drive import simulate_drift
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriftSettings, DriveSettings
from lhdmap.simulation.sensing.sections import ScannerSettings


def wall(direction_rad: float, away_m: float = 2.0, spacing_m: float = 0.1) -> FloatArray:
    """Return points (N, 3) of a straight wall that runs in a direction, `away_m` to the right of the origin."""
    s = np.arange(-5.0, 5.0, spacing_m)
    along, across = np.array([math.cos(direction_rad), math.sin(direction_rad)]), np.array([0.0, 0.0])
    across[:] = along[1], -along[0]
    return np.column_stack([s[:, None] * along + away_m * across, np.zeros(len(s))])


def test_the_rise_of_a_plane_is_that_of_its_points() -> None:
    T = from_rpy(0.02, 0.09, 0.4, (1.5, 0.1, 1.8))
    beams = np.column_stack([np.cos(np.arange(6)), np.sin(np.arange(6)), np.zeros(6)]) * 7.0
    points = beams @ T[:3, :3].T
    assert points[:, :2] @ rise_of(T) == pytest.approx(points[:, 2], abs=1e-9)


@given(
    st.floats(-math.pi, math.pi), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(0.3, 3.0), st.floats(0.02, 0.5)
)
@settings(max_examples=100, deadline=None)
def test_it_is_the_foot_of_the_perpendicular(
    direction_rad: float, rise_x: float, rise_y: float, above_m: float, spacing_m: float
) -> None:
    """A hit above the line that the scan draws on the wall: no point of that line is nearer than the one found."""
    points, rise = wall(direction_rad, spacing_m=spacing_m), np.array([rise_x, rise_y])
    middle = len(points) // 2
    slant = slants(points, rise)[middle]
    along = np.array([math.cos(direction_rad), math.sin(direction_rad)])
    assert abs(slant[0] * along[1] - slant[1] * along[0]) < 1e-9  # along the wall
    shift, slope = above_m * float(slant @ along), float(rise @ along)
    s = np.linspace(shift - 0.5, shift + 0.5, 201)
    apart = np.hypot(s, above_m - slope * s)
    assert apart[100] <= apart.min() + 1e-9


def test_a_wall_across_the_way_has_none_and_one_beside_it_has_all() -> None:
    downhill = np.array([-0.12, 0.0])
    assert slants(wall(math.pi / 2), downhill)[50] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert slants(wall(0.0), downhill)[50] == pytest.approx([-0.12 / (1.0 + 0.12**2), 0.0], abs=1e-12)
    assert (slants(wall(0.0), np.zeros(2)) == 0.0).all()


def test_hits_that_stand_alone_have_none() -> None:
    points = np.array([[0.0, 0.0, 0.0], [20.0, 0.0, 0.0], [40.0, 5.0, 0.0], [41.0, 30.0, 0.0]])
    assert (slants(points, np.array([0.1, 0.1])) == 0.0).all()
    assert slants(points[:1], np.array([0.1, 0.1])).shape == (1, 2)
    assert slants(points[:0], np.array([0.1, 0.1])).shape == (0, 2)


def longer_pct(seed: int, folder: Path) -> float:
    """Return by how much per cent the path of 25 m up a straight drift is too long, by the front scanner alone."""
    scenario = DriftScenario(
        seed=seed,
        drift=DriftSettings(pieces=((60.0, 0.0, 6.0),), mesh_m=0.08, floor_undulation_m=0.0, floor_roughness_m=0.0),
        drive=DriveSettings(distance_m=25.0, speed_kmh=12.0, vibration_deg=0.0),
        scanner=ScannerSettings(beams=381, rate_hz=25.0),
    )
    drive = simulate_drift(scenario, folder / f"{seed}.mcap")
    pipeline = MappingPipeline(
        replace(Settings(), pile=replace(Settings().pile, method="off")), None, MappingOptions(cloud=False)
    )
    with LogSource([drive.log]) as source:
        roles = [role for role in ROLES_READ if role in source.roles and role not in ("rear", "tachometer", "joints")]
        feed(pipeline, source.messages(roles))
    found = resample(pipeline.track.rows(), drive.truth.stamps_ns).poses[:, :2]
    true = drive.truth.positions_m[:, :2]
    return 100.0 * (math.dist(found[0], found[-1]) / math.dist(true[0], true[-1]) - 1.0)


def test_a_tilted_scanner_is_not_held_back(tmp_path: Path) -> None:
    """Over an even floor, straight on: without the slant 0.33 % were missing on the mean of these drifts."""
    longer = [longer_pct(seed, tmp_path) for seed in (21, 22, 23, 24, 25)]
    assert abs(np.mean(longer)) < 0.2
    assert max(map(abs, longer)) < 0.4
