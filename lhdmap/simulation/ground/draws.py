"""What chance gives a load and each of its attempts, from a seed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.simulation.ground.earth import bearing_table
from lhdmap.simulation.ground.kernel import NOISE_STEP_M
from lhdmap.simulation.ground.records import Record, Rock, record
from lhdmap.simulation.ground.sections import Grounds

CELL_M = 0.05
DUG_M3 = 0.1
"""Taken from a pile in an attempt: less was no dig, and loosens nothing."""
_NOISE = 400
_WAY_M = 8.0  # of the lip in rock that has boulders


class Load(NamedTuple):
    """One load: numbers of its rock, the table of bearing factors, crest height (m), tilt rate over the file's."""

    rock: Record
    table: FloatArray
    crest_m: float
    tilt_factor: float


class Attempt(NamedTuple):
    """Chance of one attempt: noise along the way, boulders and bumps as `kernel.advance` takes them; posture of the bucket."""

    noise: FloatArray
    strikes: FloatArray
    bumps: FloatArray
    lip_high_m: float
    boulder_m3: float
    toe_error_m: float


def generator(seed: int, *parts: int) -> np.random.Generator:
    """Return the generator of a part of a load."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence([seed, *parts])))


def draw_load(ground: Grounds, seed: int) -> Load:
    """Return the load of a seed."""
    rng = generator(seed, 1)
    rock, face, floor, filling = ground.rock, ground.face, ground.floor, ground.filling
    internal, external = (math.radians(rng.uniform(*both)) for both in (rock.internal_deg, rock.external_deg))
    dry, wet = rng.uniform(*floor.friction), rng.uniform(*floor.wet_friction)
    numbers = record(
        Rock(
            density=1e3 * rock.density_t_m3 * (1.0 + rock.density_spread * rng.uniform(-1.0, 1.0)),
            hardness=rock.hardness * math.exp(rock.hardness_sigma * rng.standard_normal()),
            penetration=rock.penetration,
            rake_factor=rock.rake_factor,
            loosening=rock.loosening,
            fee_scale=rock.fee_scale,
            cohesion_pa=1e3 * rng.uniform(*rock.cohesion_kpa),
            external_rad=external,
            tensile_pa=1e3 * rock.tensile_kpa * max(1.0 + rock.tensile_sigma * rng.standard_normal(), 0.2),
            friction=wet if rng.random() < floor.wet_chance else dry,
            swell=filling.swell,
            entering=filling.entering,
            heap=filling.heap,
            level_share=filling.level_share,
            slide_per_s=face.slide_per_s,
            slope=math.tan(math.radians(rng.uniform(*face.slope_deg))),
            step_m=CELL_M,
            lateral_share=face.lateral_share,
            origin_m=0.0,
        )
    )
    tilt = ground.hydraulic.tilt_factor * max(1.0 + ground.hydraulic.tilt_spread * rng.standard_normal(), 0.4)
    return Load(numbers, bearing_table(internal, external), rng.uniform(*face.crest_m), tilt)


def draw_attempt(ground: Grounds, seed: int, attempt: int, begin_m: float, way_m: float) -> Attempt:
    """Return the chance of an attempt of a load: bumps lie on `way_m` before the lip, which begins at `begin_m`."""
    rng = generator(seed, 2, attempt)
    rock, floor, filling = ground.rock, ground.floor, ground.filling
    keep = math.exp(-NOISE_STEP_M / rock.noise_length_m)
    white, noise = rng.standard_normal(_NOISE), np.empty(_NOISE)
    noise[0] = white[0]
    for i in range(1, _NOISE):
        noise[i] = keep * noise[i - 1] + math.sqrt(1.0 - keep * keep) * white[i]
    count = rng.poisson(rng.uniform(*rock.boulders_per_m) * _WAY_M)
    strikes = np.column_stack([
        rng.uniform(0.0, _WAY_M, count), np.full(count, rock.boulder_length_m), 1e3 * rng.uniform(*rock.boulder_kn, count)
    ])  # fmt: skip
    count = rng.poisson(floor.bumps_per_m * way_m)
    bumps = np.column_stack([
        begin_m + rng.uniform(0.0, way_m, count), np.full(count, floor.bump_length_m), rng.exponential(floor.bump_factor, count)
    ])  # fmt: skip
    high, height = rng.random() < floor.high_chance, rng.uniform(*floor.high_m)
    boulder, volume = rng.random() < filling.boulder_chance, rng.uniform(*filling.boulder_m3)
    toe_error = ground.errors.toe_m * rng.standard_normal()
    factor = np.maximum(1.0 + rock.noise * noise, 0.1)
    return Attempt(factor, strikes, bumps, height if high else 0.0, volume if boulder else 0.0, toe_error)


def hardness_factor(ground: Grounds, seed: int, attempt: int) -> float:
    """Return the hardness of an attempt that digs (1 is the first) over the load's: looser each time, and by chance."""
    by_chance = ground.rock.attempt_sigma * float(generator(seed, 3, attempt).standard_normal())
    return float(ground.rock.loosened ** (attempt - 1) * math.exp(by_chance))
