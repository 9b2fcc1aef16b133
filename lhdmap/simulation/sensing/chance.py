"""Chance of a sensor: what a reading draws follows from (seed, name, index of the reading) alone, not from the order of use."""

from __future__ import annotations

import zlib

import numpy as np

_WORD = (1 << 64) - 1


class Chance:
    """The source of chance of one sensor.

    Philox has a key and a counter: the key is (seed, name), the counter begins with the index. To set it costs a
    microsecond, a new generator ten.
    """

    def __init__(self, seed: int, name: str) -> None:
        self._bits = np.random.Philox(key=np.array([seed & _WORD, zlib.crc32(name.encode())], dtype=np.uint64))
        self._generator = np.random.Generator(self._bits)
        self._state = self._bits.state  # as new: nothing is buffered
        self._counter = self._state["state"]["counter"]

    def of(self, index: int) -> np.random.Generator:
        """Return the source of a reading; it holds until the next call."""
        return self._at(index, 0)

    def once(self) -> np.random.Generator:
        """Return the source of what holds for a whole run, such as an error of scale; it holds until the next call."""
        return self._at(0, 1)

    def _at(self, index: int, kind: int) -> np.random.Generator:
        self._counter[1], self._counter[2] = index, kind
        self._bits.state = self._state
        return self._generator
