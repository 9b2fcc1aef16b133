"""The bucket down to the ground before a charge: boom to its lower stop, floor of the bucket down until it presses (Fig. 14)."""

from __future__ import annotations

from lhdmap.loading.signals import Pedals, Signals, Turn
from lhdmap.loading.task_settings import LoadingSettings

_HELD_NS = 100_000_000  # a peak of the pressure when the valve opens is shorter
_BOOM_DOWN_RAD = 0.02
_RELIEVE = 0.1
_NEAR_FLOOR_RAD = -0.7  # from here on at idle speed, slowly: the floor is at about -0.83


class Lowering:
    """A controller: too little pressure leaves the lip over the ground, too much makes ground bumps look like the pile."""

    def __init__(self, settings: LoadingSettings) -> None:
        self._settings = settings
        self._since_ns: int | None = None
        self._pressed = False

    def begin(self, signals: Signals) -> None:  # noqa: ARG002
        """Begin; what was before is forgotten."""
        self._since_ns, self._pressed = None, False

    def step(self, signals: Signals) -> Turn:
        """Return what is to be done now; ended where the bucket is down and pressed, not too hard."""
        settings = self._settings
        if signals.boom_rad > _BOOM_DOWN_RAD and not self._pressed:
            return Turn(Pedals(lift=-settings.lower, full_rpm=True, brake=True))
        if self._pressed and signals.tilt_bar > settings.press_most_bar:
            return Turn(Pedals(tilt=_RELIEVE, brake=True))
        if self._pressed:
            return Turn(
                Pedals(brake=True), "pressed", (("tilt_bar", signals.tilt_bar), ("bucket_rad", signals.bucket_rad))
            )
        if signals.tilt_bar < settings.press_bar:
            self._since_ns = None
        elif self._since_ns is None:
            self._since_ns = signals.now_ns
        elif signals.now_ns - self._since_ns >= _HELD_NS:
            self._pressed = True
            return Turn(Pedals(brake=True))
        return Turn(Pedals(tilt=-settings.lower, full_rpm=signals.bucket_rad > _NEAR_FLOOR_RAD, brake=True))
