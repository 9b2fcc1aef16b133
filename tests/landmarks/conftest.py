"""Tunnels taught once for all tests of this folder."""

from __future__ import annotations

from typing import NamedTuple

import pytest
from lhdmap.landmarks.build import landmarks_of
from lhdmap.landmarks.model import Landmarks
from lhdmap.landmarks.scans import NodeScan
from lhdmap.landmarks.settings import LandmarkSettings

from tests.landmarks.worlds import MODERATE, ROUGH, SMOOTH, TunnelWorld, drive, tunnel


class Taught(NamedTuple):
    """A tunnel `t`, the drive that taught it, and what was made of it."""

    world: TunnelWorld
    scans: list[NodeScan]
    landmarks: Landmarks


def taught(world: TunnelWorld, settings: LandmarkSettings | None = None) -> Taught:
    scans = drive(world, seed=1)
    return Taught(world, scans, landmarks_of(scans, {"t": world.frame()}, {"t"}, settings or LandmarkSettings()))


@pytest.fixture(scope="session")
def rough() -> Taught:
    return taught(tunnel(3, ROUGH, 70.0))


@pytest.fixture(scope="session")
def bent() -> Taught:
    return taught(tunnel(5, MODERATE, 70.0, bends=True, niches=True))


@pytest.fixture(scope="session")
def smooth() -> Taught:
    return taught(tunnel(4, SMOOTH, 70.0))
