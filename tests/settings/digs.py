"""What the controllers of loading ask for on the small loader of their tests, for the probes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Any

from lhdmap.config import Settings
from lhdmap.loading.attempts import Attempts
from lhdmap.loading.charge import Charge
from lhdmap.loading.excavation import DigSettings, excavation_of
from lhdmap.loading.shake import Shake
from lhdmap.loading.weighing import Weighing

from tests.loading.digging.rig import Loader, World, run

_BUMP = (2.2, 140.0, 0.3)
_WORLDS = (
    World(toe_m=3.0, noise=1.0, lag_ticks=10),
    World(toe_m=5.0, noise=1.0, bump=_BUMP),
    World(toe_m=3.0, noise=1.0, grip_kn=25.0),
    World(toe_m=3.0, noise=1.0, hardness_kn=1.0),
    World(toe_m=0.1, noise=1.0, hardness_kn=400.0, top_mps=3.0, lag_ticks=15),
)
_PILES = (
    World(toe_m=0.2, hardness_kn=90.0, noise=1.0),
    World(toe_m=0.2, hardness_kn=200.0, noise=1.0),
    World(toe_m=0.2, hardness_kn=120.0, grip_kn=80.0, noise=1.0),
    World(toe_m=0.2, hardness_kn=20.0, noise=1.0),
)


def charges(settings: Settings, detector: str = "") -> Iterator[Any]:
    """Yield what is asked for while charging: plain, over a bump, on ice, into nothing, into a wall."""
    for world in _WORLDS:
        yield run(Charge(settings.charging, detector), Loader(world), 9.0)[1]


def digs(settings: Settings, method: str = "") -> Iterator[Any]:
    """Yield what is asked for in piles: soft, hard, slippery, next to none; and before a wall that holds the bucket."""
    sections = DigSettings(settings.excavation, settings.excavation_paper, settings.excavation_tuned)
    for world in _PILES:
        yield run(excavation_of(sections, method), Loader(world, speed_mps=0.8), 15.0)[1]
    wall = World(toe_m=0.2, hardness_kn=2000.0, grip_kn=500.0)
    yield run(excavation_of(sections, method), Loader(wall, way_m=0.6), 6.0)[1]


def weighings(settings: Settings) -> Iterator[Any]:
    """Yield shakes and weighings of two buckets, one of which never comes to rest."""

    class Restless(Loader):
        def lift_bar(self) -> float:
            return 90.0 + 9.0 * math.sin(7.0 * self.now_ns * 1e-9)

    for loader in (Loader(World(fill=0.8, noise=1.0), boom_rad=0.3), Restless(World(fill=0.8), boom_rad=-0.3)):
        loader.bucket_rad = -0.8
        shaken = run(Shake(settings.weighing, settings.excavation), loader, 20.0)[1]
        yield shaken
        yield run(Weighing(settings.weighing), loader, 40.0)[1]


def decisions(settings: Settings) -> Iterator[Any]:
    """Yield what the rule says of fills after each attempt."""
    rule = Attempts(settings.attempts, 11.0)
    fills = [0.1 * k for k in range(13)]
    for fill, attempt in itertools.product(fills, range(1, 9)):
        yield rule.decide(fill, 0.03, attempt)
