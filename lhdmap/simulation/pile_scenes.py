"""Scenes: of each variant, any number of drifts that end in a pile (or in what is not one), all at chance by a seed."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from lhdmap.errors import UsageError
from lhdmap.settings import nearest
from lhdmap.simulation.pile_sections import VARIANTS, MountingSettings, PileSettings
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import (
    DriftSettings,
    DriveSettings,
    InclinometerSettings,
    ScannerSettings,
    WheelSettings,
)

_BEHIND_M = 14.0  # the drift before the start, as the world makes it
_LAST_STRAIGHT_M = (20.0, 26.0)
_FLAT_ROUGHNESS_M = 0.003


def scene(variant: str, seed: int, *, flat_floor: bool = False) -> DriftScenario:
    """Return the scenario `seed` of a variant; the same arguments give the same scenario.

    `flat_floor` takes the waves from the floor: the machine does not pitch, and nothing shows the odometry's scale.

    Raises:
        UsageError: there is no such variant, or the seed is negative.
    """
    if variant not in VARIANTS:
        raise UsageError(f"variant '{variant}' is not known{nearest(variant, VARIANTS)}")
    if seed < 0:
        raise UsageError(f"seed {seed}: zero or a positive number was wanted")
    rng = np.random.default_rng([seed, zlib.crc32(variant.encode()), zlib.crc32(b"scene")])
    scenario = _common(variant, seed, rng)
    scenario = _SHAPES[variant](scenario, rng) if variant in _SHAPES else scenario
    if flat_floor:
        scenario = replace(
            scenario, drift=replace(scenario.drift, floor_undulation_m=0.0, floor_roughness_m=_FLAT_ROUGHNESS_M)
        )
    return scenario


def _common(variant: str, seed: int, rng: np.random.Generator) -> DriftScenario:
    """Return what all variants share: drift, drive, sensors, and a loadable pile of 35 to 55°."""
    toe_m = _between(rng, 45.0, 50.0)
    drive = DriveSettings(
        distance_m=_round(toe_m - rng.uniform(6.0, 8.0)),
        speed_kmh=_between(rng, 6.0, 15.0),
        wander_m=_between(rng, 0.03, 0.12),
        standstill_s=_between(rng, 0.5, 1.2),
    )
    slope = _between(rng, 35.0, 55.0)
    pile = PileSettings(
        variant=variant,
        toe_m=toe_m,
        back_m=_between(rng, 6.0, 10.0),
        slope_deg=slope,
        upper_slope_deg=slope,
        crest_m=20.0 if rng.random() < 0.5 else _between(rng, 2.2, 3.2),
        d50_m=_between(rng, 0.1, 0.5),
        roughness_m=_between(rng, 0.02, 0.06),
        skew_deg=_round(rng.normal(0.0, 3.0)),
        bulge_m=_round(rng.normal(0.0, 0.12)),
        slope_change=_round(rng.normal(0.0, 0.05)),
    )
    return DriftScenario(
        seed=seed,
        drift=_drift(toe_m, rng),
        drive=drive,
        scanner=_scanner(rng),
        inclinometer=InclinometerSettings(
            noise_deg=0.1, lag_s=0.1, bias_roll_deg=_normal(rng, 0.05), bias_pitch_deg=_normal(rng, 0.05)
        ),
        wheels=WheelSettings(scale_error=_between(rng, 0.0, 0.015)),
        pile=pile,
        mounting=MountingSettings(height_m=_between(rng, 1.5, 2.2), tilt_error_deg=_tilt_error(rng, 0.4, 0.1)),
    )


def _drift(toe_m: float, rng: np.random.Generator) -> DriftSettings:
    """Return a drift of one or two bends before its last straight, with a taper and a grade."""
    half_m, straight_m = rng.uniform(1.68, 2.2), rng.uniform(*_LAST_STRAIGHT_M)
    bends = []
    for _ in range(int(rng.integers(0, 3))):
        bends += [
            (_between(rng, 5.0, 9.0), _round(rng.choice([-1.0, 1.0]) * rng.uniform(12.0, 30.0)), _normal(rng, 2.0))
        ]
        bends += [(_between(rng, 1.0, 4.0), 0.0, _normal(rng, 2.0))]
    first_m = max(_BEHIND_M + toe_m - straight_m - sum(piece[0] for piece in bends), 1.0)
    end_grade = float(np.clip(rng.normal(0.0, 2.0), -5.0, 5.0))
    pieces = [(_round(first_m), 0.0, _normal(rng, 3.0)), *bends, (200.0, 0.0, _round(end_grade))]
    taper = np.clip(rng.normal(0.0, 0.08, 4), -0.15, 0.15)
    at = (toe_m - 25.0, toe_m - 8.0, toe_m + 1.0)
    narrow = [(0.0, 0.0), (taper[0], taper[1]), (taper[0] + 0.5 * taper[2], taper[1] + 0.5 * taper[3])]
    widenings = tuple(
        (_round(a), _round(left), _round(right), 0.0) for a, (left, right) in zip(at, narrow, strict=True)
    )
    return DriftSettings(
        pieces=tuple(pieces),
        profile="arched" if rng.random() < 0.6 else "box",
        half_width_m=_round(half_m),
        height_m=_between(rng, 3.2, 4.6),
        roughness_m=_between(rng, 0.03, 0.14),
        roughness_scale_m=_between(rng, 1.2, 3.0),
        floor_undulation_m=_between(rng, 0.015, 0.045),
        floor_roughness_m=_between(rng, 0.005, 0.02),
        blast_round_m=_between(rng, 2.8, 4.0),
        blast_flare_m=_round(max(rng.uniform(-0.05, 0.15), 0.0)),
        widenings=widenings,
    )


def _scanner(rng: np.random.Generator) -> ScannerSettings:
    return ScannerSettings(
        beams=381 if rng.random() < 0.5 else 761,
        rate_hz=float(rng.choice([25.0, 35.0, 50.0])),
        noise_m=_between(rng, 0.012, 0.025),
        sweep=bool(rng.random() < 0.5),
        mixed_pixel_share=_between(rng, 0.1, 0.4),
        drop_out_share=_between(rng, 0.002, 0.01),
    )


def _stope(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """The face stands in a stope: the walls step back at a mouth before the toe."""
    mouth = _between(rng, 0.5, 2.0)
    return _piled(_opened(scenario, mouth, rng), mouth_m=mouth, bulge_m=_round(rng.normal(0.2, 0.2)))


def _opened(scenario: DriftScenario, mouth_m: float, rng: np.random.Generator) -> DriftScenario:
    """Return the scenario with a stope whose mouth lies `mouth_m` before the toe."""
    pile, drift = _pile(scenario), scenario.drift
    at = pile.toe_m - mouth_m
    left, right, roof = rng.uniform(0.8, 3.5), rng.uniform(0.8, 3.5), rng.uniform(0.3, 2.5)
    _, last_left, last_right, _ = drift.widenings[-1]
    step = (_round(at + 0.25), _round(last_left + left), _round(last_right + right), _round(roof))
    before = tuple(row for row in drift.widenings if row[0] < at)
    widenings = (*before, (_round(at), last_left, last_right, 0.0), step)
    return replace(scenario, drift=replace(drift, widenings=widenings))


def _skewed(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    return _piled(scenario, skew_deg=_signed(rng, 10.0, 25.0))


def _bulging(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    return _piled(scenario, bulge_m=_between(rng, 0.4, 1.3))


def _asymmetric(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    side = _signed(rng, 0.5, 1.0) * scenario.drift.half_width_m
    change = _signed(rng, 0.1, 0.25)
    return _piled(scenario, lobe_m=_between(rng, 0.5, 1.5), lobe_lateral_m=_round(side), slope_change=change)


def _concave(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """The sides stand before the middle, and the face gets steeper upwards."""
    slope = _pile(scenario).slope_deg
    steeper = _between(rng, 5.0, 12.0)
    bend = {"slope_deg": max(slope - steeper, 33.0), "upper_slope_deg": min(slope + steeper, 62.0)}
    return _piled(scenario, bulge_m=-_between(rng, 0.3, 1.0), bend_m=_between(rng, 0.7, 1.3), **bend)


def _too_shallow(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    slope = _between(rng, 12.0, 23.5)
    return _not_loadable(
        scenario,
        rng,
        "too_shallow",
        slope_deg=slope,
        upper_slope_deg=slope,
        back_m=_between(rng, 11.0, 14.0),
        slope_change=0.0,
    )


def _wall(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """The drift ends in rock, as rough as its walls."""
    slope = float(np.clip(rng.normal(90.0, 2.0), 85.0, 95.0))
    shape = {"d50_m": 0.0, "roughness_m": min(scenario.drift.roughness_m, 0.09), "back_m": 3.0, "crest_m": 20.0}
    return _not_loadable(
        scenario, rng, "wall", slope_deg=_round(slope), upper_slope_deg=_round(slope), slope_change=0.0, **shape
    )


def _hang_up(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """Rubble that hangs: too steep, overhanging, or with a brow over a steep foot."""
    kind = rng.choice(["steep", "overhanging", "brow"], p=[0.45, 0.3, 0.25])
    low, high = {"steep": (65.0, 80.0), "overhanging": (100.0, 114.0), "brow": (62.0, 75.0)}[str(kind)]
    slope = _between(rng, low, high)
    upper = _between(rng, 100.0, 116.0) if kind == "brow" else slope
    shape = {"bend_m": _between(rng, 0.6, 0.9), "crest_m": 20.0, "d50_m": _between(rng, 0.2, 0.5), "slope_change": 0.0}
    return _not_loadable(scenario, rng, "hang_up", slope_deg=slope, upper_slope_deg=upper, **shape)


def _boulder(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """One rock of 1 to 1.5 m stands out of the face; its rubble is not so coarse that it drowns in it."""
    size = _between(rng, 1.0, 1.5)
    room = max(scenario.drift.half_width_m - 0.5 * size - 0.1, 0.2)
    place = (_round(rng.uniform(-room, room)), _between(rng, 0.45, 1.0), size, _between(rng, 0.5, 0.75))
    return _piled(scenario, boulders=(place,), d50_m=_between(rng, 0.1, 0.35))


def _spill(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    return _piled(
        scenario,
        spill=int(rng.integers(4, 16)),
        spill_reach_m=_between(rng, 1.5, 4.5),
        spill_size_m=_between(rng, 0.2, 0.45),
    )


def _dust(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    dust, lost = _between(rng, 0.02, 0.08), _between(rng, 0.01, 0.03)
    return replace(scenario, scanner=replace(scenario.scanner, dust_share=dust, drop_out_share=lost))


def _low_wall(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """A pile of less than 10° lies before the end wall."""
    slope = _between(rng, 4.0, 9.0)
    shape = {"d50_m": _between(rng, 0.08, 0.2), "roughness_m": 0.02, "back_m": _between(rng, 2.5, 6.0)}
    pieces = (*scenario.drift.pieces[:-1], (200.0, 0.0, _normal(rng, 0.7)))
    level = replace(scenario, drift=replace(scenario.drift, pieces=pieces))
    return _not_loadable(
        level, rng, "too_shallow", slope_deg=slope, upper_slope_deg=slope, slope_change=0.0, crest_m=20.0, **shape
    )


def _empty_stope(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    deep = _piled(scenario, face=False, back_m=_between(rng, 9.0, 22.0), status="none")
    return _steeper_error(_opened(deep, 0.0, rng), rng)


def _side_opening(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """A side drift opens where a pile would be; the drift goes on."""
    place = (_pile(scenario).toe_m, _signed(rng, 50.0, 100.0), 14.0)
    away = _piled(scenario, face=False, back_m=_between(rng, 20.0, 32.0), status="none")
    return _steeper_error(replace(away, drift=replace(away.drift, cross_drifts=(place,))), rng)


def _machine(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    turn = _round((0.0 if rng.random() < 0.5 else 180.0) + rng.normal(0.0, 5.0))
    lateral = _round(rng.normal(0.0, 0.2))
    turn = (turn + 180.0) % 360.0 - 180.0
    return _in_the_way(scenario, rng, obstacle="machine", obstacle_turn_deg=turn, obstacle_lateral_m=lateral)


def _post(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    lateral = _round(rng.uniform(-0.7, 0.7) * scenario.drift.half_width_m)
    return _in_the_way(scenario, rng, obstacle="post", obstacle_lateral_m=lateral)


def _in_the_way(scenario: DriftScenario, rng: np.random.Generator, **obstacle: Any) -> DriftScenario:
    return _steeper_error(
        _piled(scenario, face=False, status="none", back_m=_between(rng, 20.0, 35.0), **obstacle), rng
    )


def _not_loadable(scenario: DriftScenario, rng: np.random.Generator, status: str, **changes: Any) -> DriftScenario:
    return _steeper_error(_piled(scenario, status=status, **changes), rng)


def _steeper_error(scenario: DriftScenario, rng: np.random.Generator) -> DriftScenario:
    """Return the scenario with a larger chance of a tilt error, and a larger error."""
    error_deg = _tilt_error(rng, 0.5, 0.2)
    height_m = scenario.mounting.height_m if scenario.mounting is not None else 1.8
    return replace(scenario, mounting=MountingSettings(height_m=height_m, tilt_error_deg=error_deg))


def _piled(scenario: DriftScenario, **changes: Any) -> DriftScenario:
    return replace(scenario, pile=replace(_pile(scenario), **changes))


def _pile(scenario: DriftScenario) -> PileSettings:
    return scenario.pile if scenario.pile is not None else PileSettings()


def _tilt_error(rng: np.random.Generator, chance: float, spread_deg: float) -> float:
    error = float(np.clip(rng.normal(0.0, spread_deg), -3 * spread_deg, 3 * spread_deg))
    return _round(error) if rng.random() < chance else 0.0


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return _round(rng.uniform(low, high))


def _normal(rng: np.random.Generator, spread: float) -> float:
    return _round(rng.normal(0.0, spread))


def _signed(rng: np.random.Generator, low: float, high: float) -> float:
    return _round(float(rng.choice([-1.0, 1.0])) * rng.uniform(low, high))


def _round(value: float) -> float:
    """Return a value as a scenario file shows it: to a tenth of a millimetre, or of a thousandth of a degree."""
    return round(float(value), 4)


_SHAPES: dict[str, Callable[[DriftScenario, np.random.Generator], DriftScenario]] = {
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
