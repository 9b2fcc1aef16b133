"""Orientation along a path: φ(σ) of straight lines between knots, with the polynomial blends of Section 3.4."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lhdmap.messages import FloatArray


@dataclass(frozen=True, slots=True)
class Turning:
    """φ at knots over σ (both (K,), σ rising from 0 to 1), and the width of the blend at each inner knot (K - 2,)."""

    sigma: FloatArray
    phi: FloatArray
    blends: FloatArray

    def __call__(self, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return φ and dφ/dσ (N,) at σ (N,).

        The 5th-order polynomial of a blend, with value and slope given and no second derivative at both ends, has the slope of a
        smooth step; its fifth coefficient vanishes.
        """
        slopes = np.diff(self.phi) / np.diff(self.sigma)
        piece = np.clip(np.searchsorted(self.sigma, sigma, side="right") - 1, 0, len(slopes) - 1)
        phi = self.phi[piece] + slopes[piece] * (sigma - self.sigma[piece])
        rate = slopes[piece]
        for knot, width in zip(range(1, len(slopes)), self.blends, strict=True):
            begin = self.sigma[knot] - 0.5 * width
            at = (sigma - begin) / width
            inside = (at > 0.0) & (at < 1.0)
            u = at[inside]
            before, change = slopes[knot - 1], slopes[knot] - slopes[knot - 1]
            start = self.phi[knot] - 0.5 * width * before
            phi[inside] = start + width * (before * u + change * (u**3 - 0.5 * u**4))
            rate[inside] = before + change * (3.0 * u**2 - 2.0 * u**3)
        return phi, rate


def straight(phi_from: float, phi_to: float) -> Turning:
    """Return Eq. (11): one line from end to end."""
    return Turning(np.array([0.0, 1.0]), np.array([phi_from, phi_to]), np.zeros(0))


def through(sigma: FloatArray, phi: FloatArray, blend: float) -> Turning:
    """Return the lines through the knots (K,), blends of width `blend`, narrower where knots are closer than that."""
    gaps = np.diff(sigma)
    return Turning(sigma, phi, np.minimum(blend, np.minimum(gaps[:-1], gaps[1:])))
