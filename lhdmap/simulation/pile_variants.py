"""What makes a variant: how a scene of each differs from that of a loadable pile in its drift."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from lhdmap.simulation.pile_draws import between, normal, rounded, signed, tilt_error
from lhdmap.simulation.pile_sections import MountingSettings, SimulatedPileSettings
from lhdmap.simulation.scenario import DriftScenario


def _stope(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """The face stands in a stope: the walls step back at a mouth before the toe."""
    mouth = between(rng, 0.5, 2.0)
    return _piled(_opened(scenario, mouth, rng), mouth_m=mouth, bulge_m=rounded(rng.normal(0.2, 0.2)))


def _opened(scenario: DriftScenario, mouth_m: float, rng: np.random.Generator) -> DriftScenario:
    """Return the scenario with a stope whose mouth lies `mouth_m` before the toe."""
    pile, drift = _pile(scenario), scenario.drift
    at = pile.toe_m - mouth_m
    left, right, roof = rng.uniform(0.8, 3.5), rng.uniform(0.8, 3.5), rng.uniform(0.3, 2.5)
    _, last_left, last_right, _ = drift.widenings[-1]
    step = (rounded(at + 0.25), rounded(last_left + left), rounded(last_right + right), rounded(roof))
    before = tuple(row for row in drift.widenings if row[0] < at)
    widenings = (*before, (rounded(at), last_left, last_right, 0.0), step)
    return replace(scenario, drift=replace(drift, widenings=widenings))


def _skewed(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    return _piled(scenario, skew_deg=signed(rng, 10.0, 25.0))


def _bulging(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    return _piled(scenario, bulge_m=between(rng, 0.4, 1.3))


def _asymmetric(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    side = signed(rng, 0.5, 1.0) * scenario.drift.half_width_m
    change = signed(rng, 0.1, 0.25)
    return _piled(scenario, lobe_m=between(rng, 0.5, 1.5), lobe_lateral_m=rounded(side), slope_change=change)


def _concave(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """The sides stand before the middle, and the face gets steeper upwards."""
    slope = _pile(scenario).slope_deg
    steeper = between(rng, 5.0, 12.0)
    bend = {"slope_deg": max(slope - steeper, 33.0), "upper_slope_deg": min(slope + steeper, 62.0)}
    return _piled(scenario, bulge_m=-between(rng, 0.3, 1.0), bend_m=between(rng, 0.7, 1.3), **bend)


def _too_shallow(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    slope = between(rng, 12.0, 23.5)
    return _not_loadable(
        scenario,
        rng,
        "too_shallow",
        slope_deg=slope,
        upper_slope_deg=slope,
        back_m=between(rng, 11.0, 14.0),
        slope_change=0.0,
    )


def _wall(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """The drift ends in rock, as rough as its walls."""
    slope = float(np.clip(rng.normal(90.0, 2.0), 85.0, 95.0))
    shape = {"d50_m": 0.0, "roughness_m": min(scenario.drift.roughness_m, 0.09), "back_m": 3.0, "crest_m": 20.0}
    return _not_loadable(
        scenario, rng, "wall", slope_deg=rounded(slope), upper_slope_deg=rounded(slope), slope_change=0.0, **shape
    )


def _hang_up(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """Rubble that hangs: too steep, overhanging, or with a brow over a steep foot."""
    kind = rng.choice(["steep", "overhanging", "brow"], p=[0.45, 0.3, 0.25])
    low, high = {"steep": (65.0, 80.0), "overhanging": (100.0, 114.0), "brow": (62.0, 75.0)}[str(kind)]
    slope = between(rng, low, high)
    upper = between(rng, 100.0, 116.0) if kind == "brow" else slope
    shape = {"bend_m": between(rng, 0.6, 0.9), "crest_m": 20.0, "d50_m": between(rng, 0.2, 0.5), "slope_change": 0.0}
    return _not_loadable(scenario, rng, "hang_up", slope_deg=slope, upper_slope_deg=upper, **shape)


def _boulder(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """One rock of 1 to 1.5 m stands out of the face; its rubble is not so coarse that it drowns in it."""
    size = between(rng, 1.0, 1.5)
    room = max(scenario.drift.half_width_m - 0.5 * size - 0.1, 0.2)
    place = (rounded(rng.uniform(-room, room)), between(rng, 0.45, 1.0), size, between(rng, 0.5, 0.75))
    return _piled(scenario, boulders=(place,), d50_m=between(rng, 0.1, 0.35))


def _spill(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    return _piled(
        scenario,
        spill=int(rng.integers(4, 16)),
        spill_reach_m=between(rng, 1.5, 4.5),
        spill_size_m=between(rng, 0.2, 0.45),
    )


def _dust(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    dust, lost = between(rng, 0.02, 0.08), between(rng, 0.01, 0.03)
    return replace(scenario, scanner=replace(scenario.scanner, dust_share=dust, drop_out_share=lost))


def _low_wall(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """A pile of less than 10° lies before the end wall."""
    slope = between(rng, 4.0, 9.0)
    shape = {"d50_m": between(rng, 0.08, 0.2), "roughness_m": 0.02, "back_m": between(rng, 2.5, 6.0)}
    pieces = (*scenario.drift.pieces[:-1], (200.0, 0.0, normal(rng, 0.7)))
    level = replace(scenario, drift=replace(scenario.drift, pieces=pieces))
    return _not_loadable(
        level, rng, "too_shallow", slope_deg=slope, upper_slope_deg=slope, slope_change=0.0, crest_m=20.0, **shape
    )


def _empty_stope(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    deep = _piled(scenario, face=False, back_m=between(rng, 9.0, 22.0), status="none")
    return _steeper_error(_opened(deep, 0.0, rng), rng)


def _side_opening(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """A side drift opens where a pile would be; the drift goes on."""
    place = (_pile(scenario).toe_m, signed(rng, 50.0, 100.0), 14.0)
    away = _piled(scenario, face=False, back_m=between(rng, 20.0, 32.0), status="none")
    return _steeper_error(replace(away, drift=replace(away.drift, cross_drifts=(place,))), rng)


def _machine(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    turn = rounded((0.0 if rng.random() < 0.5 else 180.0) + rng.normal(0.0, 5.0))
    lateral = rounded(rng.normal(0.0, 0.2))
    turn = (turn + 180.0) % 360.0 - 180.0
    return _in_the_way(scenario, rng, obstacle="machine", obstacle_turn_deg=turn, obstacle_lateral_m=lateral)


def _post(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    lateral = rounded(rng.uniform(-0.7, 0.7) * scenario.drift.half_width_m)
    return _in_the_way(scenario, rng, obstacle="post", obstacle_lateral_m=lateral)


def _in_the_way(scenario: DriftScenario, rng: np.random.Generator, **obstacle: Any) -> DriftScenario:
    return _steeper_error(_piled(scenario, face=False, status="none", back_m=between(rng, 20.0, 35.0), **obstacle), rng)


def _not_loadable(scenario: DriftScenario, rng: np.random.Generator, status: str, **changes: Any) -> DriftScenario:
    return _steeper_error(_piled(scenario, status=status, **changes), rng)


def _steeper_error(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """Return the scenario with a larger chance of a tilt error, and a larger error."""
    error_deg = tilt_error(rng, 0.5, 0.2)
    height_m = scenario.mounting.height_m if scenario.mounting is not None else 1.8
    return replace(scenario, mounting=MountingSettings(height_m=height_m, tilt_error_deg=error_deg))


def _piled(scenario: DriftScenario, **changes: Any) -> DriftScenario:
    return replace(scenario, pile=replace(_pile(scenario), **changes))


def _pile(scenario: DriftScenario) -> SimulatedPileSettings:
    return scenario.pile if scenario.pile is not None else SimulatedPileSettings()


SHAPES: dict[str, Callable[[DriftScenario, np.random.Generator], DriftScenario]] = {
    "stope": _stope,
    "skewed": _skewed,
    "bulging": _bulging,
    "asymmetric": _asymmetric,
    "concave": _concave,
    "too_shallow": _too_shallow,
    "wall": _wall,
    "hang_up": _hang_up,
    "boulder": _boulder,
    "spill": _spill,
    "dust": _dust,
    "low_wall": _low_wall,
    "empty_stope": _empty_stope,
    "side_opening": _side_opening,
    "machine": _machine,
    "post": _post,
}
