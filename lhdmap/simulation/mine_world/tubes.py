"""The tubes of a network as drifts with rough walls over the mine's one floor."""

from __future__ import annotations

import numpy as np

from lhdmap.mine.network import Network
from lhdmap.mine.tube import Tube
from lhdmap.simulation.drift import Drift, FloorHeight
from lhdmap.simulation.sections import DriftSettings

_LEAST_HALF_M = 0.5


def drift_of(network: Network, index: int, floor: FloorHeight) -> Drift:
    """Return the drift that tube `index` is; its chance follows from the plan's seed and the index."""
    tube, walls = network.tubes[index], network.plan.walls
    half, height = 0.5 * float(tube.widths_m[0, 1]), float(tube.heights_m[0, 1])
    settings = DriftSettings(
        pieces=((tube.length_m, 0.0, 0.0),),
        profile=walls.profile,
        half_width_m=max(half, _LEAST_HALF_M),
        height_m=height,
        roughness_m=tube.roughness_m,
        roughness_octaves=walls.roughness_octaves,
        roughness_scale_m=walls.roughness_scale_m,
        roughness_gain=walls.roughness_gain,
        floor_undulation_m=0.0,
        floor_roughness_m=0.0,
        blast_round_m=walls.blast_round_m,
        blast_flare_m=walls.blast_flare_m,
        bolts_m=walls.bolts_m,
        bolt_spacing_m=walls.bolt_spacing_m,
        widenings=_widenings(tube, half, height),
        mesh_m=walls.mesh_m,
    )
    return Drift(settings, tube.line, np.random.default_rng([network.plan.seed, index, 16]), floor=floor)


def _widenings(tube: Tube, half_m: float, height_m: float) -> tuple[tuple[float, float, float, float], ...]:
    """Return how the tube's width and height differ from those of its start, at each place where the plan says them."""
    at = np.unique(np.concatenate([tube.widths_m[:, 0], tube.heights_m[:, 0]]))
    if len(at) == 1:
        return ()
    wider = 0.5 * np.interp(at, *tube.widths_m.T) - half_m
    higher = np.interp(at, *tube.heights_m.T) - height_m
    return tuple(zip(at.tolist(), wider.tolist(), wider.tolist(), higher.tolist(), strict=True))
