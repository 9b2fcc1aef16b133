"""Whether boom and bucket follow: a joint that is commanded and reads the same to the bit is frozen, or its cylinder is."""

from __future__ import annotations

from lhdmap.loading.signals import Pedals, Signals

_COMMANDED = (("boom_rad", "lift"), ("bucket_rad", "tilt"))


class Follows:
    """Adds up, for each joint, the command since its reading has last changed; pulses of a lift count together."""

    def __init__(self, limit_s: float) -> None:
        self._limit_s = limit_s
        self._read: dict[str, float] = {}
        self._asked_s: dict[str, float] = {}
        self._last_ns: int | None = None

    def update(self, now_ns: int, signals: Signals, pedals: Pedals | None) -> tuple[str, ...]:
        """Return the joints that do not follow; `pedals`: what has been asked for since the last call."""
        gone_s = 0.0 if self._last_ns is None else max(now_ns - self._last_ns, 0) * 1e-9
        self._last_ns = now_ns
        for name, pedal in _COMMANDED:
            value = float(getattr(signals, name))
            asked = 0.0 if pedals is None else abs(float(getattr(pedals, pedal)))
            same = self._read.get(name) == value
            self._asked_s[name] = self._asked_s.get(name, 0.0) + asked * gone_s if same else 0.0
            self._read[name] = value
        return tuple(f"{name} does not follow" for name, asked_s in self._asked_s.items() if asked_s > self._limit_s)
