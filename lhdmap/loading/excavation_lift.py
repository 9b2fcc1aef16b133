"""The traction controller: the boom is lifted while the wheels slip, which loads the front axle and frees the lip."""

from __future__ import annotations


class SlipLift:
    """On above `skid_max`; off `hysteresis` below it, and `least_s` after it came on at the earliest (finding E4)."""

    def __init__(self, skid_max: float, hysteresis: float = 0.0, least_s: float = 0.0) -> None:
        self._skid_max, self._hysteresis, self._least_ns = skid_max, hysteresis, round(least_s * 1e9)
        self.on, self._since_ns = False, 0

    def update(self, now_ns: int, skid: float) -> bool:
        """Return whether to lift now; a skid that is not known is none."""
        if skid > self._skid_max:
            if not self.on:
                self._since_ns = now_ns
            self.on = True
        elif not skid > self._skid_max - self._hysteresis and now_ns - self._since_ns >= self._least_ns:
            self.on = False
        return self.on
