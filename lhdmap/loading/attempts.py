"""Whether another attempt pays: the question that the paper leaves open (section 4.1), as a renewal problem.

A cycle is a haul and some attempts. Tonnes per second are the most where one goes on as long as the tonnes that another attempt
is expected to bring, per second of it, exceed the best rate of whole cycles. That rate depends on the rule itself, so both are
found together (Dinkelbach's iteration).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lhdmap.loading.weighing_settings import AttemptSettings

_QUANTILES = 41
_ROUNDS = 50


class Gains(NamedTuple):
    """What attempts bring: fill after the first (mean, deviation), then a line of the gain over the fill before it."""

    first: float
    first_std: float
    empty: float
    full: float

    def gain(self, fill: float) -> float:
        """Return what another attempt is expected to bring."""
        return max(self.empty + (self.full - self.empty) * fill, 0.0)


class Decision(NamedTuple):
    """Whether to go on, why in a sentence, and the figures of that sentence."""

    go_on: bool
    text: str
    values: tuple[tuple[str, float], ...] = ()


class Attempts:
    """The rule with its figures; `best_per_s` is the best rate of whole cycles, in fills per second."""

    def __init__(self, settings: AttemptSettings, full_t: float, gains: Gains | None = None) -> None:
        self._settings, self._full_t = settings, full_t
        self.gains = gains or gains_of(settings)
        self.best_per_s = best_rate(self.gains, settings)

    def decide(self, fill: float, fill_std: float, attempt: int) -> Decision:
        """Return what to do after the `attempt`-th attempt (1 is the first) with a fill as weighed; NaN: go on."""
        one = self._settings
        said = f"fill {fill:.2f} ± {fill_std:.2f} after attempt {attempt}"
        if attempt >= one.most:
            return Decision(False, f"{said}: {one.most} attempts are the most", (("fill", fill),))
        if one.rule == "threshold":
            on = not fill >= one.full
            return Decision(on, f"{said}: {'below' if on else 'at least'} {one.full:.2f}", (("fill", fill),))
        gain = self.gains.gain(fill) if math.isfinite(fill) else self.gains.first
        per_s = gain / one.attempt_s
        on = per_s > self.best_per_s
        text = (
            f"{said}: another one is expected to bring {gain * self._full_t:.1f} t in {one.attempt_s:.0f} s, "
            f"{per_s * self._full_t * 3600.0:.0f} t/h; whole cycles with a haul of {one.haul_s:.0f} s bring "
            f"{self.best_per_s * self._full_t * 3600.0:.0f} t/h at best: {'another attempt' if on else 'enough'}"
        )
        return Decision(
            on, text, (("fill", fill), ("gain", gain), ("gain_per_s", per_s), ("best_per_s", self.best_per_s))
        )


def gains_of(settings: AttemptSettings) -> Gains:
    """Return the gains that the settings tell."""
    return Gains(settings.first_fill, settings.first_std, settings.gain_empty, settings.gain_full)


def fit_gains(loads: Sequence[Sequence[float]]) -> Gains:
    """Return the gains of loads: of each the fills after its attempts, as weighed. Least squares.

    A fill that is weighed too high is followed by a gain that looks too small: the line is that of the fill as weighed, which is
    what is known when it is decided.
    """
    first = np.array([load[0] for load in loads], dtype=float)
    before = np.array([fill for load in loads for fill in load[:-1]], dtype=float)
    gain = np.array([b - a for load in loads for a, b in itertools.pairwise(load)], dtype=float)
    if len(before) < 2 or float(np.ptp(before)) <= 0.0:
        return Gains(float(first.mean()), float(first.std()), float(gain.mean()) if len(gain) else 0.0, 0.0)
    slope, empty = np.polyfit(before, gain, 1)
    return Gains(float(first.mean()), float(first.std()), float(empty), float(empty + slope))


def best_rate(gains: Gains, settings: AttemptSettings) -> float:
    """Return the best fills per second of whole cycles with these gains: that of the rule which it makes itself."""
    if settings.haul_s <= 0.0:
        return gains.first / settings.attempt_s
    rate = 0.0
    for _ in range(_ROUNDS):
        filled, time_s = 0.0, 0.0
        for fill in _first_fills(gains):
            attempts = 1
            while attempts < settings.most and gains.gain(fill) > rate * settings.attempt_s:
                fill, attempts = fill + gains.gain(fill), attempts + 1
            filled, time_s = filled + fill, time_s + settings.haul_s + attempts * settings.attempt_s
        if abs(filled / time_s - rate) < 1e-12:
            break
        rate = filled / time_s
    return rate


def _first_fills(gains: Gains) -> list[float]:
    """Return fills that stand for those after a first attempt: a normal distribution at equal steps of chance."""
    from scipy.special import ndtri

    steps = (np.arange(_QUANTILES) + 0.5) / _QUANTILES
    return [max(float(one), 0.0) for one in gains.first + gains.first_std * ndtri(steps)]
