"""Scenes: of each variant, any number of drifts that end in a pile (or in what is not one), all at chance by a seed."""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np

from lhdmap.errors import UsageError
from lhdmap.settings import nearest
from lhdmap.simulation.pile_draws import between, normal, rounded, tilt_error
from lhdmap.simulation.pile_sections import VARIANTS, MountingSettings, SimulatedPileSettings
from lhdmap.simulation.pile_variants import SHAPES
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriftSettings, DriveSettings
from lhdmap.simulation.sensing.sections import InclinometerSettings, ScannerSettings, WheelSettings

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
    scenario = SHAPES[variant](scenario, rng) if variant in SHAPES else scenario
    if flat_floor:
        scenario = replace(
            scenario, drift=replace(scenario.drift, floor_undulation_m=0.0, floor_roughness_m=_FLAT_ROUGHNESS_M)
        )
    return scenario


def _common(variant: str, seed: int, rng: np.random.Generator) -> DriftScenario:
    """Return what all variants share: drift, drive, sensors, and a loadable pile of 35 to 55°."""
    toe_m = between(rng, 45.0, 50.0)
    drive = DriveSettings(
        distance_m=rounded(toe_m - rng.uniform(6.0, 8.0)),
        speed_kmh=between(rng, 6.0, 15.0),
        wander_m=between(rng, 0.03, 0.12),
        standstill_s=between(rng, 0.5, 1.2),
    )
    slope = between(rng, 35.0, 55.0)
    pile = SimulatedPileSettings(
        variant=variant,
        toe_m=toe_m,
        back_m=between(rng, 6.0, 10.0),
        slope_deg=slope,
        upper_slope_deg=slope,
        crest_m=20.0 if rng.random() < 0.5 else between(rng, 2.2, 3.2),
        d50_m=between(rng, 0.1, 0.5),
        roughness_m=between(rng, 0.02, 0.06),
        skew_deg=rounded(rng.normal(0.0, 3.0)),
        bulge_m=rounded(rng.normal(0.0, 0.12)),
        slope_change=rounded(rng.normal(0.0, 0.05)),
    )
    return DriftScenario(
        seed=seed,
        drift=_drift(toe_m, rng),
        drive=drive,
        scanner=_scanner(rng),
        inclinometer=InclinometerSettings(
            noise_deg=0.1, lag_s=0.1, bias_roll_deg=normal(rng, 0.05), bias_pitch_deg=normal(rng, 0.05)
        ),
        wheels=WheelSettings(scale_error=between(rng, 0.0, 0.015)),
        pile=pile,
        mounting=MountingSettings(height_m=between(rng, 1.5, 2.2), tilt_error_deg=tilt_error(rng, 0.4, 0.1)),
    )


def _drift(toe_m: float, rng: np.random.Generator) -> DriftSettings:
    """Return a drift of one or two bends before its last straight, with a taper and a grade."""
    half_m, straight_m = rng.uniform(1.68, 2.2), rng.uniform(*_LAST_STRAIGHT_M)
    bends = []
    for _ in range(int(rng.integers(0, 3))):
        bends += [
            (between(rng, 5.0, 9.0), rounded(rng.choice([-1.0, 1.0]) * rng.uniform(12.0, 30.0)), normal(rng, 2.0))
        ]
        bends += [(between(rng, 1.0, 4.0), 0.0, normal(rng, 2.0))]
    first_m = max(_BEHIND_M + toe_m - straight_m - sum(piece[0] for piece in bends), 1.0)
    end_grade = float(np.clip(rng.normal(0.0, 2.0), -5.0, 5.0))
    pieces = [(rounded(first_m), 0.0, normal(rng, 3.0)), *bends, (200.0, 0.0, rounded(end_grade))]
    taper = np.clip(rng.normal(0.0, 0.08, 4), -0.15, 0.15)
    at = (toe_m - 25.0, toe_m - 8.0, toe_m + 1.0)
    narrow = [(0.0, 0.0), (taper[0], taper[1]), (taper[0] + 0.5 * taper[2], taper[1] + 0.5 * taper[3])]
    widenings = tuple(
        (rounded(a), rounded(left), rounded(right), 0.0) for a, (left, right) in zip(at, narrow, strict=True)
    )
    return DriftSettings(
        pieces=tuple(pieces),
        profile="arched" if rng.random() < 0.6 else "box",
        half_width_m=rounded(half_m),
        height_m=between(rng, 3.2, 4.6),
        roughness_m=between(rng, 0.03, 0.14),
        roughness_scale_m=between(rng, 1.2, 3.0),
        floor_undulation_m=between(rng, 0.015, 0.045),
        floor_roughness_m=between(rng, 0.005, 0.02),
        blast_round_m=between(rng, 2.8, 4.0),
        blast_flare_m=rounded(max(rng.uniform(-0.05, 0.15), 0.0)),
        widenings=widenings,
    )


def _scanner(rng: np.random.Generator) -> ScannerSettings:
    return ScannerSettings(
        beams=381 if rng.random() < 0.5 else 761,
        rate_hz=float(rng.choice([25.0, 35.0, 50.0])),
        noise_m=between(rng, 0.012, 0.025),
        sweep=bool(rng.random() < 0.5),
        mixed_pixel_share=between(rng, 0.1, 0.4),
        drop_out_share=between(rng, 0.002, 0.01),
    )
