"""Smooth random functions of two coordinates: cubic B-splines with random coefficients, several scales summed.

A value depends on the seed and the place only, not on the mesh that asks: a finer mesh shows the same world finer.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

_MEAN_SQUARE = 151.0 / 315.0  # of the sum of cubic B-splines with independent unit coefficients, per dimension


class Octave(NamedTuple):
    """One scale: knot spacing (m), amplitude (standard deviation, m) and coefficients, shape (rows, columns)."""

    spacing_m: float
    amplitude_m: float
    coefficients: FloatArray


class NoiseField:
    """A sum of octaves over (s, u) in [s0, s1] × [u0, u1], metres; outside, the border's coefficients go on."""

    def __init__(self, octaves: Sequence[Octave], origin_m: tuple[float, float]) -> None:
        self._octaves, self._origin_m = list(octaves), origin_m
        self._mean_m, self._scale = 0.0, 1.0

    def grid(self, s_m: FloatArray, u_m: FloatArray) -> FloatArray:
        """Return values (m) at all pairs, shape (len(s), len(u))."""
        total = np.zeros((len(s_m), len(u_m)))
        for octave in self._octaves:
            rows, row_weights = _basis((s_m - self._origin_m[0]) / octave.spacing_m, octave.coefficients.shape[0])
            columns, weights = _basis((u_m - self._origin_m[1]) / octave.spacing_m, octave.coefficients.shape[1])
            along = np.zeros((len(s_m), octave.coefficients.shape[1]))
            for k in range(4):
                along += row_weights[:, k, None] * octave.coefficients[rows[:, k]]
            for k in range(4):
                total += octave.amplitude_m / _MEAN_SQUARE * along[:, columns[:, k]] * weights[:, k]
        return (total - self._mean_m) * self._scale

    def at(self, s_m: FloatArray, u_m: FloatArray) -> FloatArray:
        """Return values (m) at the points (s, u), both of one shape."""
        s, u = np.ravel(s_m), np.ravel(u_m)
        total = np.zeros(s.size)
        for octave in self._octaves:
            rows, row_weights = _basis((s - self._origin_m[0]) / octave.spacing_m, octave.coefficients.shape[0])
            columns, weights = _basis((u - self._origin_m[1]) / octave.spacing_m, octave.coefficients.shape[1])
            picked = octave.coefficients[rows[:, :, None], columns[:, None, :]]
            total += octave.amplitude_m / _MEAN_SQUARE * np.einsum("nk,nkl,nl->n", row_weights, picked, weights)
        return ((total - self._mean_m) * self._scale).reshape(np.shape(s_m))

    def normalise(self, s_m: FloatArray, u_m: FloatArray, rms_m: float) -> None:
        """Shift and scale the field: over the grid (s, u) its mean becomes zero, its standard deviation `rms_m`."""
        self._mean_m, self._scale = 0.0, 1.0
        values = self.grid(s_m, u_m)
        self._mean_m, spread = float(values.mean()), float(values.std())
        self._scale = rms_m / spread if spread > 0.0 else 0.0


class Scales(NamedTuple):
    """Octaves to draw: how many, the coarsest knot spacing (m), and the amplitude of each over the coarser one."""

    octaves: int
    spacing_m: float
    gain: float


def noise_field(
    rng: np.random.Generator, scales: Scales, s_range_m: tuple[float, float], u_range_m: tuple[float, float]
) -> NoiseField:
    """Draw a field with unit total variance over the given ranges, metres."""
    amplitudes = scales.gain ** np.arange(scales.octaves)
    amplitudes /= np.sqrt(np.sum(amplitudes**2))
    octaves = []
    for index, amplitude in enumerate(amplitudes):
        spacing_m = scales.spacing_m / 2**index
        rows = int(np.ceil((s_range_m[1] - s_range_m[0]) / spacing_m)) + 4
        columns = int(np.ceil((u_range_m[1] - u_range_m[0]) / spacing_m)) + 4
        octaves.append(Octave(spacing_m, float(amplitude), rng.standard_normal((rows, columns))))
    return NoiseField(octaves, (s_range_m[0], u_range_m[0]))


def _basis(position: FloatArray, count: int) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """Return indices and weights, both (N, 4), of the cubic B-splines that are not zero at `position` (in knots)."""
    cell = np.floor(position)
    t = position - cell
    weights = np.stack([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3], axis=1) / 6.0
    return np.clip(cell.astype(np.int64)[:, None] + np.arange(4), 0, count - 1), weights
