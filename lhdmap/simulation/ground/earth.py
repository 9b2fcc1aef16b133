"""Forces of the rock on the bucket: the fundamental earth-moving equation, penetration of the lip, and a lip that rises."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.simulation.ground.records import Record

RAKES_RAD = (0.5, 1.2)
"""Range of the separation plate's rake: the ore in the bucket forms it, a flat bucket's floor does not (it has no finite N)."""
_RAKES = 15
_ANGLES = 160


@nb.njit(cache=True, nogil=True)
def bearing(rake_rad: float, internal_rad: float, external_rad: float) -> tuple[float, float, float]:
    """Return N_γ, N_c, N_q of the fundamental earth-moving equation (Reece; McKyes 1985) for a plate's rake.

    The angle of failure is the one of the least N_γ, as in arXiv 2507.22356.
    """
    best, c_best, q_best = math.inf, 0.0, 0.0
    for i in range(_ANGLES):
        fail = math.radians(10.0) + i * math.radians(60.0) / _ANGLES
        below = math.cos(rake_rad + external_rad) + math.sin(rake_rad + external_rad) / math.tan(fail + internal_rad)
        if below <= 1e-3:
            continue
        spread = 1.0 / math.tan(rake_rad) + 1.0 / math.tan(fail)
        weight = spread / (2.0 * below)
        if weight < best:
            best, q_best = weight, spread / below
            c_best = (1.0 + 1.0 / (math.tan(fail) * math.tan(fail + internal_rad))) / below
    return best, max(c_best, 0.0), q_best


@nb.njit(cache=True, nogil=True)
def bearing_table(internal_rad: float, external_rad: float) -> FloatArray:
    """Return N_γ, N_c, N_q over `RAKES_RAD`, shape (15, 3)."""
    table = np.empty((_RAKES, 3))
    for i in range(_RAKES):
        rake = RAKES_RAD[0] + (RAKES_RAD[1] - RAKES_RAD[0]) * i / (_RAKES - 1)
        table[i, 0], table[i, 1], table[i, 2] = bearing(rake, internal_rad, external_rad)
    return table


@nb.njit(cache=True, nogil=True)
def plate_rake(psi_rad: float) -> float:
    """Return the rake of the separation plate for a bucket whose floor is at ψ."""
    return min(max(psi_rad + 0.6, RAKES_RAD[0]), RAKES_RAD[1])


@nb.njit(cache=True, nogil=True)
def earth_force(rock: Record, rig: Record, table: FloatArray, psi_rad: float, depth_m: float, load_n: float) -> float:
    """Return the force of the rock wedge on the plate, N: a (γ d² B N_γ + c d B N_c + 0.3 W_l N_q)."""
    place = (plate_rake(psi_rad) - RAKES_RAD[0]) / (RAKES_RAD[1] - RAKES_RAD[0]) * (_RAKES - 1)
    i = min(int(place), _RAKES - 2)
    share = place - i
    n = table[i] * (1.0 - share) + table[i + 1] * share
    weight = rock.density * 9.81 * depth_m * depth_m * rig.width_m * n[0]
    cohesion = rock.cohesion_pa * depth_m * rig.width_m * n[1]
    return rock.fee_scale * (weight + cohesion + 0.3 * load_n * n[2] * min(depth_m, 1.0))


@nb.njit(cache=True, nogil=True)
def penetration(rock: Record, rig: Record, embed_m: float, psi_rad: float, cover: float) -> float:
    """Return the lip's resistance to penetration, N: 9.8 K h B[cm] L[cm]^1.25 (1 + k_u ψ), the field's empirical law."""
    turned = max(1.0 + rock.rake_factor * psi_rad, 0.3)
    return 9.8 * rock.penetration * rock.hardness * 100.0 * rig.width_m * (100.0 * embed_m) ** 1.25 * turned * cover


@nb.njit(cache=True, nogil=True)
def breaking(rock: Record, rig: Record, embed_m: float, cover: float) -> float:
    """Return the rock's resistance to a lip that rises through it, N: 2.2 L B K_t √h."""
    return 2.2 * embed_m * rig.width_m * rock.tensile_pa * math.sqrt(rock.hardness) * cover
