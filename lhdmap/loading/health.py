"""What the task must hear to go on: each state and phase needs its signals finite, fresh and alive; the rest may be broken."""

from __future__ import annotations

import math
from collections.abc import Mapping

from lhdmap.loading.follows import Follows
from lhdmap.loading.moment import LoadingInput
from lhdmap.loading.positioning_steps import ALIGN, LOWER
from lhdmap.loading.pull_back import RACK, SHAKE
from lhdmap.loading.signals import Pedals, Signals
from lhdmap.loading.states import State
from lhdmap.loading.task_settings import LoadingSettings

_DRIVES = ("tacho_mps", "scan_mps", "travel_m", "transmission_bar", "articulation_rad")
NEEDS: Mapping[tuple[State, str], tuple[str, ...]] = {
    (State.POSITIONING, LOWER): ("bucket_rad", "boom_rad", "tilt_bar"),
    (State.CHARGING, ""): _DRIVES,
    (State.EXCAVATION, ""): (*_DRIVES, "boom_rad", "bucket_rad"),
    (State.PULL_BACK, RACK): ("bucket_rad",),
    (State.PULL_BACK, SHAKE): ("bucket_rad",),
    (State.WEIGHING, ""): ("boom_rad", "lift_bar"),
}
"""Signals that a state's phase cannot do without, beside the motion and a sign of life of all signals."""
_PRESSURES = ("transmission_bar", "lift_bar", "tilt_bar")
_WATCHED = ("tacho_mps", *_PRESSURES)
_AHEAD_NS = 50_000_000


class LoadingHealth:
    """Watches inputs, call by call."""

    def __init__(self, settings: LoadingSettings) -> None:
        self._settings, self._follows = settings, Follows(settings.follows_s)
        self._last_ns: int | None = None
        self._changed: dict[str, tuple[float, int]] = {}

    def check(self, told: LoadingInput, state: State, phase: str, asked: Pedals | None = None) -> tuple[str, ...]:
        """Return what is wrong for a state and its phase; empty: nothing. `asked`: the pedals since the call before."""
        found = [*self._clock(told.now_ns), *self._sources(told)]
        if told.signals is not None:
            self._watch(told.signals, told.now_ns)
            needs = NEEDS.get((state, phase), ())
            found += self._follows.update(told.now_ns, told.signals, asked)
            found += self._values(told.signals, needs, told.now_ns)
            if state in (State.CHARGING, State.EXCAVATION):
                found += self._age("scan odometry", told.signals.scan_ns, told.now_ns, self._settings.scan_age_s)
        if state == State.POSITIONING and phase in (ALIGN, LOWER) and told.walls_m is None:
            found.append("no wall points")
        if not told.pose_good:
            found.append("pose not trusted")
        return tuple(found)

    def _clock(self, now_ns: int) -> list[str]:
        last, self._last_ns = self._last_ns, now_ns
        if last is None:
            return []
        if now_ns < last:
            return ["the clock ran backwards"]
        late = now_ns - last > round(self._settings.age_s * 1e9)
        return [f"not called for {(now_ns - last) * 1e-9:.2f} s"] if late else []

    def _sources(self, told: LoadingInput) -> list[str]:
        found = []
        if told.signals is None:
            found.append("no signals")
        else:
            found += self._age("signals", told.signals.now_ns, told.now_ns, self._settings.age_s)
        if told.motion is None or not all(math.isfinite(value) for value in told.motion):
            found.append("no motion")
        else:
            found += self._age("motion", told.motion.stamp_ns, told.now_ns, self._settings.age_s)
        return found

    def _age(self, name: str, stamp_ns: int, now_ns: int, limit_s: float) -> list[str]:
        old_s = (now_ns - stamp_ns) * 1e-9
        if old_s > limit_s:
            return [f"{name} {old_s:.2f} s old"]
        return [f"{name} from the future"] if stamp_ns > now_ns + _AHEAD_NS else []

    def _watch(self, signals: Signals, now_ns: int) -> None:
        """Note since when the wheels' speed and each pressure have had their value; wheels that stand have none."""
        for name in _WATCHED:
            value = float(getattr(signals, name))
            before = self._changed.get(name)
            stands = name == "tacho_mps" and value == 0.0
            if before is None or before[0] != value or now_ns < before[1] or stands:
                self._changed[name] = value, now_ns

    def _values(self, signals: Signals, needs: tuple[str, ...], now_ns: int) -> list[str]:
        found = [f"{name} is missing" for name in needs if not math.isfinite(getattr(signals, name))]
        for name in set(needs) & set(self._changed):
            still_s = (now_ns - self._changed[name][1]) * 1e-9
            if still_s > self._settings.frozen_s:
                found.append(f"{name} is frozen")
        return sorted(found)
