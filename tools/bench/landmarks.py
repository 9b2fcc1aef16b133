"""Landmarks: CPU time of a pair, of the similarity matrix, of fused walls and of the profile's gaps."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from lhdmap.geometry import se2
from lhdmap.landmarks.build import node_surface
from lhdmap.landmarks.distinct import gaps
from lhdmap.landmarks.icp import align
from lhdmap.landmarks.scans import along_tunnel
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.landmarks.similarity import icp_model, similarity
from lhdmap.landmarks.target import prepare
from tests.landmarks.worlds import ROUGH, drive, tunnel

from tools.bench.stages import reference_kernel
from tools.evaluate.figures import Figure

_GROUP = "Landmarks, two scanners, rough walls"
_REPEATS, _MATRIX = 200, 60
_LONG = 500  # landmarks of a tunnel of 1 km


def landmark_figures() -> Iterator[Figure]:
    """Measure pairs of two densities, then a matrix, then the walls of a tunnel."""
    reference = _cpu_ms(lambda: reference_kernel(50_000), 5)
    settings = LandmarkSettings()
    world = tunnel(3, ROUGH, 2.0 * _MATRIX)
    scans = drive(world, seed=1)
    for name, voxel_m, range_m, target in (
        ("a landmark", settings.voxel_m, settings.range_m, None),
        ("dense", 0.02, 20.0, 1.0),
    ):
        dense = LandmarkSettings(voxel_m=voxel_m, range_m=range_m)
        model, clouds = icp_model(dense), along_tunnel(scans[20:24], world.frame(), dense)
        prepared, source = prepare(clouds[0].points_m, model), clouds[1].points_m
        start = se2.between(clouds[0].pose_node_base, clouds[1].pose_node_base) + np.array([0.3, 0.1, 0.01])
        spent = _cpu_ms(lambda: align(prepared, source, start, model), _REPEATS)  # noqa: B023
        yield Figure(
            _GROUP,
            f"a pair, {len(source)} points ({name})",
            spent,
            "ms",
            target,
            f"{spent / reference:.2f} × reference",
        )
        spent = _cpu_ms(lambda: prepare(clouds[0].points_m, model), 20)  # noqa: B023
        yield Figure(
            _GROUP,
            f"preparing a target, {len(source)} points",
            spent,
            "ms",
            None,
            f"{spent / reference:.2f} × reference",
        )
    clouds = along_tunnel(scans, world.frame(), settings)[:_MATRIX]
    started = time.process_time()
    similarity(clouds, settings)
    each = 1e3 * (time.process_time() - started) / _MATRIX**2
    whole = each * _LONG**2 / 2e3
    yield Figure(
        _GROUP, f"similarity matrix: a pair of {_MATRIX}", each, "ms", None, f"{each / reference:.2f} × reference"
    )
    yield Figure(
        _GROUP, f"... {_LONG} landmarks (1 km) on two cores", whole, "s", 120.0, "from it: pairs × half of the CPU time"
    )
    spent = _cpu_ms(lambda: node_surface(scans, world.frame(), settings, tunnel=True), 2)
    yield Figure(
        _GROUP, f"fused walls, quality and profile of {2 * _MATRIX} m", spent, "ms", None, f"{len(scans)} scans"
    )
    profile = node_surface(scans, world.frame(), settings, tunnel=True).profile
    assert profile is not None
    long = profile._replace(
        **{name: np.tile(value, (8, 1) if value.ndim > 1 else 8) for name, value in profile._asdict().items()}
    )
    spent = _cpu_ms(lambda: gaps(long, settings), 1)
    yield Figure(
        _GROUP,
        f"gaps of the profile, {len(long.at_m) * settings.profile_m:.0f} m",
        spent / 1e3,
        "s",
        None,
        "all places, both ways",
    )


def _cpu_ms(call: Callable[[], Any], repeats: int) -> float:
    """Return the CPU time of one call, once warm."""
    call()
    started = time.process_time()
    for _ in range(repeats):
        call()
    return 1e3 * (time.process_time() - started) / repeats
