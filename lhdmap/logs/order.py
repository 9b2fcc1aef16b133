"""The order of a file against that of its log times: a recorder that wrote out of order, or a clock that was set back."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

_FEWEST, _FEWEST_IN_PIECE = 12, 3  # fewer messages tell nothing
_FALLS_LEAST, _FALLS_SHARE = 3, 0.02
_GAP_STEPS, _GAP_NS = 20, 1_000_000_000

IntArray = npt.NDArray[np.int64]


def clock_was_set_back(times_ns: IntArray, channels: IntArray) -> bool:
    """Return whether log times (N,) in the order of the file tell of a clock that was set back.

    A channel's times then fall once or so, and what follows lies over what was before, or far away from it. Where a file was
    only written out of order, the pieces between falls fit to each other without overlap, or there are many of them.
    """
    said = [_channel_says(times_ns[channels == channel]) for channel in np.unique(channels)]
    return any(word is True for word in said) and not any(word is False for word in said)


def _channel_says(times_ns: IntArray) -> bool | None:
    """Return what one channel says: True for a clock set back, False for disorder, None for neither."""
    steps = np.diff(times_ns)
    falls = np.flatnonzero(steps < 0)
    if len(times_ns) < _FEWEST or not len(falls):
        return None
    if len(falls) > max(_FALLS_LEAST, _FALLS_SHARE * len(times_ns)):
        return False
    split = [piece for piece in np.split(times_ns, falls + 1) if len(piece) >= _FEWEST_IN_PIECE]
    usual = float(np.median(steps[steps >= 0])) if (steps >= 0).any() else 0.0
    return not pieces_fit([(int(piece[0]), int(piece[-1])) for piece in split], usual)


def pieces_fit(pieces: Sequence[tuple[int, int]], usual_ns: float = 0.0) -> bool:
    """Return whether pieces (first and last log time), sorted by time, make one recording: no overlap, and no long gap."""
    apart = np.array([after[0] - before[1] for before, after in itertools.pairwise(sorted(pieces))])
    return not ((apart < 0).any() or (apart > max(_GAP_STEPS * usual_ns, _GAP_NS)).any())
