"""The paper's speed profile: polynomial ramps to and from a constant σ̇ (Section 3.5), and the best of its family.

With s = t / t_r the ramp of Eqs. (13) to (15) is σ = σ̇_c t_r g(s), σ̇ = σ̇_c g'(s) with
g = (10 κ - 4) s³ + (7 - 15 κ) s⁴ + (6 κ - 3) s⁵, κ = d_r / (σ̇_c t_r). C3 (erratum 6) is 0.4 ≤ κ ≤ 0.6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray

KAPPA = (0.4, 0.6)  # C3 with erratum 6
_RAMP_SAMPLES = (128, 1024)  # of a ramp in the search: more where a narrow dip of the curve slipped through
_DENSE_SAMPLES = 8192
_HALVINGS = 36


@dataclass(frozen=True, slots=True)
class Ramps:
    """One profile of the family: ramp duration, κ, and cruising rate σ̇_c in 1/s."""

    t_r_s: float
    kappa: float
    cruise: float

    @property
    def d_r(self) -> float:
        """σ that a ramp covers."""
        return self.kappa * self.cruise * self.t_r_s

    @property
    def duration_s(self) -> float:
        """t_f of Eq. (16)."""
        return (1.0 - 2.0 * self.d_r) / self.cruise + 2.0 * self.t_r_s

    @property
    def peaks(self) -> tuple[float, float]:
        """Largest |σ̈| and |σ⃛| of the ramp, 1/s² and 1/s³."""
        s = np.linspace(0.0, 1.0, 2001)
        c3, c4, c5 = coefficients(self.kappa)
        second = 6.0 * c3 * s + 12.0 * c4 * s**2 + 20.0 * c5 * s**3
        third = 6.0 * c3 + 24.0 * c4 * s + 60.0 * c5 * s**2
        scale = self.cruise / self.t_r_s
        return float(np.abs(second).max() * scale), float(np.abs(third).max() * scale / self.t_r_s)

    def slower(self, factor: float) -> Ramps:
        """Return the same in `factor` times the time."""
        return Ramps(self.t_r_s * factor, self.kappa, self.cruise / factor)

    def __call__(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return σ and σ̇ (N,) at times (N,) in [0, t_f]."""
        late = t_s > 0.5 * self.duration_s
        mirrored = np.where(late, self.duration_s - t_s, t_s)
        s = np.clip(mirrored / self.t_r_s, 0.0, 1.0)
        c3, c4, c5 = coefficients(self.kappa)
        travelled = self.cruise * self.t_r_s * (s**3 * (c3 + s * (c4 + s * c5)))
        travelled = travelled + self.cruise * np.maximum(mirrored - self.t_r_s, 0.0)
        rate = self.cruise * s**2 * (3.0 * c3 + s * (4.0 * c4 + 5.0 * s * c5))
        return np.where(late, 1.0 - travelled, travelled), rate


@nb.njit(cache=True, nogil=True)
def coefficients(kappa: float) -> tuple[float, float, float]:
    """Return the coefficients of s³, s⁴ and s⁵ of g."""
    return 10.0 * kappa - 4.0, 7.0 - 15.0 * kappa, 6.0 * kappa - 3.0


def best_ramp(highest: FloatArray, t_r_min_s: float) -> Ramps:
    """Return the fastest profile with t_r = `t_r_min_s` below the curve σ̇ ≤ F(σ) on an even grid (N,)."""
    curve, least = _folded(highest)
    for samples in _RAMP_SAMPLES:
        found = Ramps(t_r_min_s, *_best_kappa(curve, least, samples, t_r_min_s))
        if _holds(curve, least, found):
            break
    return found


def best_profile(highest: FloatArray, t_r_min_s: float) -> Ramps:
    """Return the fastest of the whole three-parameter family (erratum 12), found by a search over all t_r."""
    curve, least = _folded(highest)
    for samples in _RAMP_SAMPLES:
        longest = max(_best_duration(curve, least, samples, t_r_min_s) * 0.5, t_r_min_s * 1.01)
        found = Ramps(*_best_of_family(curve, least, samples, t_r_min_s, longest))
        if _holds(curve, least, found):
            break
    return found


def _holds(curve: FloatArray, least: FloatArray, found: Ramps) -> bool:
    """Return whether a profile stays below the curve between the samples of its search too, but for 1e-4."""
    return bool(_below(curve, least, _DENSE_SAMPLES, found.t_r_s, found.kappa, found.cruise * (1.0 - 1e-4)))


def _folded(highest: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the curve of the first half under that of the second, mirrored, and the least of it from each σ to the middle."""
    half = (len(highest) + 1) // 2
    folded = np.minimum(highest, highest[::-1])[:half]
    return folded, np.minimum.accumulate(folded[::-1])[::-1].copy()


@nb.njit(cache=True, nogil=True)
def _below(curve: FloatArray, least: FloatArray, samples: int, t_r: float, kappa: float, cruise: float) -> bool:
    """Return whether the profile stays below the folded curve; its last node is σ = 0.5."""
    last = len(curve) - 1
    scale = 2.0 * last
    d_r = kappa * cruise * t_r
    if d_r > 0.5 or cruise > least[min(int(d_r * scale), last)]:
        return False
    c3, c4, c5 = coefficients(kappa)
    for k in range(1, samples):
        s = k / samples
        rate = cruise * s * s * (3.0 * c3 + s * (4.0 * c4 + 5.0 * s * c5))
        at = cruise * t_r * s * s * s * (c3 + s * (c4 + s * c5)) * scale
        node = min(int(at), last - 1)
        share = at - node
        if rate > (1.0 - share) * curve[node] + share * curve[node + 1]:
            return False
    return True


@nb.njit(cache=True, nogil=True)
def _highest_cruise(curve: FloatArray, least: FloatArray, samples: int, t_r: float, kappa: float) -> float:
    """Return the highest cruising rate; what is feasible is an interval, as σ̇ at each σ rises with σ̇_c."""
    low, high = 0.0, least[-1]
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if _below(curve, least, samples, t_r, kappa, middle):
            low = middle
        else:
            high = middle
    return low


@nb.njit(cache=True, nogil=True)
def _duration(curve: FloatArray, least: FloatArray, samples: int, t_r: float, kappa: float) -> float:
    cruise = _highest_cruise(curve, least, samples, t_r, kappa)
    return 1.0 / max(cruise, 1e-12) + 2.0 * t_r * (1.0 - kappa)


@nb.njit(cache=True, nogil=True)
def _best_kappa(curve: FloatArray, least: FloatArray, samples: int, t_r: float) -> tuple[float, float]:
    """Return κ and σ̇_c of the shortest profile at a given ramp duration: a grid, made finer around its best."""
    best, width = 0.5 * (KAPPA[0] + KAPPA[1]), 0.5 * (KAPPA[1] - KAPPA[0])
    for _ in range(5):
        centre, found = best, np.inf
        for k in range(-5, 6):
            kappa = min(max(centre + width * k / 5.0, KAPPA[0]), KAPPA[1])
            duration = _duration(curve, least, samples, t_r, kappa)
            if duration < found - 1e-12:
                best, found = kappa, duration
        width *= 0.2
    return best, _highest_cruise(curve, least, samples, t_r, best)


@nb.njit(cache=True, nogil=True)
def _best_duration(curve: FloatArray, least: FloatArray, samples: int, t_r: float) -> float:
    kappa, cruise = _best_kappa(curve, least, samples, t_r)
    return 1.0 / max(cruise, 1e-12) + 2.0 * t_r * (1.0 - kappa)


@nb.njit(cache=True, nogil=True)
def _best_of_family(
    curve: FloatArray, least: FloatArray, samples: int, shortest: float, longest: float
) -> tuple[float, float, float]:
    """Return t_r, κ and σ̇_c of the shortest profile: t_r over an even grid, then made finer around the best of it."""
    best, width, found = shortest, 0.5 * (longest - shortest), np.inf
    centre = shortest + width
    for _ in range(4):
        for k in range(-12, 13):
            t_r = min(max(centre + width * k / 12.0, shortest), longest)
            duration = _best_duration(curve, least, samples, t_r)
            if duration < found - 1e-12:
                best, found = t_r, duration
        centre = best
        width *= 0.1
    kappa, cruise = _best_kappa(curve, least, samples, best)
    return best, kappa, cruise
