"""The watchdog: inputs that are old, a pose that jumps, a link that fades; and nothing moves again until it is armed.

It never looks at what an input says, only at whether it is news: finite, stamped after the one before, and not the
same content again where noise would make it differ. Time is an input.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

from lhdmap.executor.notes import Notes, Stop
from lhdmap.executor.settings import ExecutorSettings

LINK, POSE = "link", "pose"
"""Names of two inputs that have rules of their own: the station's sign of life, and pose against scan."""
MOTION, SCAN_FRONT, SCAN_REAR, OPERATOR, GUIDANCE = "motion", "scan_front", "scan_rear", "operator", "guidance"
"""Names of the other inputs that modes need; a machine has those that it is told of."""
_AHEAD_NS = 50_000_000  # a stamp so far in the future is none


class _Input:
    """What is known of an input: its period, the newest stamp that counts, its content."""

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self.stamp_ns: int | None = None
        self.content: int | None = None

    def older(self, now_ns: int, limit_s: float) -> bool:
        """Return whether the newest news is older than a limit, or there was none."""
        return self.stamp_ns is None or now_ns - self.stamp_ns > round(limit_s * 1e9)


class Watchdog:
    """Says how hard to stop. `inputs`: their names and periods (s). Begins disarmed."""

    def __init__(self, inputs: Mapping[str, float], settings: ExecutorSettings) -> None:
        self.settings, self.notes = settings, Notes()
        self.armed = False
        self.causes: tuple[str, ...] = ("not armed yet",)
        self.standing = True
        self._inputs = {name: _Input(period_s) for name, period_s in inputs.items()}
        self._agreed, self._apart = 0, (0.0, 0.0)
        self._held = False

    def saw(
        self, name: str, stamp_ns: int, now_ns: int, values: Sequence[float] = (), content: int | None = None
    ) -> bool:
        """Take a message of an input; False where it counts as none.

        `values`: figures that must be finite; `content`: a hash of what noise would change, so that one that is frozen is found.
        """
        one = self._inputs[name]
        if not all(math.isfinite(value) for value in values) or stamp_ns > now_ns + _AHEAD_NS:
            return False
        if one.stamp_ns is not None and stamp_ns <= one.stamp_ns:
            return False
        if content is not None and content == one.content:
            return False
        one.stamp_ns, one.content = stamp_ns, content
        return True

    def disagreement(self, stamp_ns: int, now_ns: int, apart_m: float, apart_rad: float) -> bool:
        """Take by how much pose and scan disagree, infinite: altogether; it is news of the input `pose`."""
        if math.isnan(apart_m) or math.isnan(apart_rad) or not self.saw(POSE, stamp_ns, now_ns):
            return False
        self._apart = abs(apart_m), abs(apart_rad)
        self._agreed = 0 if self._jumps() else self._agreed + 1
        return True

    def check(self, now_ns: int, needed: Collection[str], *, standing: bool) -> tuple[Stop, str]:
        """Return what is asked of the executor now, and why; trips where a needed input fails while armed."""
        self.standing = standing
        reasons = self._wrong(now_ns, needed)
        if reasons and self.armed:
            self.trip(reasons)
        if not self.armed:
            return Stop.FULL, "; ".join(self.causes)
        degraded = self._degraded(now_ns, needed)
        if degraded != self._held:
            self._held = degraded
            was, now = ("good", "degraded") if degraded else ("degraded", "good")
            self.notes.add("link", was, now, "sign of life of the station")
        return (Stop.HOLD, "link degraded") if degraded else (Stop.GO, "")

    def trip(self, causes: Sequence[str]) -> None:
        """Disarm, for these causes; the pose must be validated anew."""
        if self.armed:
            self.notes.add("armed", "armed", "disarmed", "; ".join(causes))
        self.armed, self.causes, self._agreed = False, tuple(causes), 0

    def refusals(self, now_ns: int, needed: Collection[str]) -> tuple[str, ...]:
        """Return what stands against arming now."""
        reasons = list(self._wrong(now_ns, needed))
        if self._degraded(now_ns, needed):
            reasons.append("link degraded")
        if not self.standing:
            reasons.append("the machine moves")
        missing = self.settings.valid_reports - self._agreed
        if POSE in self._inputs and POSE in needed and missing > 0:
            reasons.append(f"the pose is not validated: {missing} more reports")
        return tuple(reasons)

    def rearm(self, now_ns: int, needed: Collection[str]) -> tuple[str, ...]:
        """Arm, where nothing stands against it; return what does."""
        if self.armed:
            return ()
        reasons = self.refusals(now_ns, needed)
        if reasons:
            self.notes.add("armed", "disarmed", "disarmed", f"refused: {'; '.join(reasons)}")
        else:
            self.notes.add("armed", "disarmed", "armed", "re-armed", was=list(self.causes))
            self.armed, self.causes, self._held = True, (), False
        return reasons

    def limit_s(self, name: str) -> float:
        """Return the age at which an input stops the machine, s."""
        settings = self.settings
        if name == LINK:
            return settings.link_lost_s
        return max(settings.age_s, settings.age_periods * self._inputs[name].period_s)

    def _wrong(self, now_ns: int, needed: Collection[str]) -> tuple[str, ...]:
        reasons = []
        for name, one in self._inputs.items():
            if name in needed and one.older(now_ns, self.limit_s(name)):
                lost = name == LINK and one.stamp_ns is not None
                told = "never seen" if one.stamp_ns is None else f"{(now_ns - one.stamp_ns) * 1e-9:.2f} s old"
                reasons.append("link lost" if lost else f"{name} {told}")
        if POSE in needed and self._jumps():
            apart_m, apart_rad = self._apart
            lost = math.isinf(apart_m) or math.isinf(apart_rad)
            by = "altogether" if lost else f"by {apart_m:.2f} m, {math.degrees(apart_rad):.1f} deg"
            reasons.append(f"pose and scan disagree {by}")
        return tuple(reasons)

    def _jumps(self) -> bool:
        return self.settings.jumps(*self._apart)

    def _degraded(self, now_ns: int, needed: Collection[str]) -> bool:
        link = self._inputs.get(LINK)
        if link is None or LINK not in needed:
            return False
        return link.older(now_ns, max(self.settings.age_s, self.settings.age_periods * link.period_s))
