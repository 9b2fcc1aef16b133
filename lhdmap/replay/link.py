"""The link between machine and station: what is lost on it, how late the rest is, and where it fades."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lhdmap.errors import ConfigError
from lhdmap.replay.faults import Fault, Faults, Position
from lhdmap.settings import setting
from lhdmap.simulation.history import SECOND_NS
from lhdmap.simulation.sensing.chance import Chance

LINK = "link"
_DEGRADED_SHARE = 0.3
_SPREAD = 0.5  # a delay is between half of it and one and a half times


@dataclass(frozen=True, slots=True)
class LinkSettings:
    """The link between machine and station."""

    delay_s: float = setting(0.03, unit="s", minimum=0.0, maximum=10.0, doc="Delay of a message, on average.")
    loss_share: float = setting(0.0, minimum=0.0, maximum=1.0, doc="Share of messages that are lost.")
    degraded_delay_s: float = setting(
        0.3, unit="s", minimum=0.0, maximum=10.0, doc="Delay while the link is degraded (fault link_degraded)."
    )
    fades_m: tuple[tuple[float, float, float], ...] = setting(
        (), unit="m", doc="Points (x, y, z) where it fades, such as between two access points of the network."
    )
    fade_radius_m: float = setting(10.0, unit="m", minimum=0.1, doc="How far from such a point a fade reaches.")
    fade_loss_share: float = setting(
        0.9, minimum=0.0, maximum=1.0, doc="Share of messages lost in the middle of a fade."
    )

    def __post_init__(self) -> None:
        """Check what a field alone cannot; raises ConfigError."""
        if any(not math.isfinite(value) for point in self.fades_m for value in point):
            raise ConfigError("fades_m: finite numbers were wanted")


class Link:
    """Decides on each message by chance from (seed, topic, number of the message) alone. `position_m` is the machine's."""

    def __init__(self, settings: LinkSettings, faults: Faults, seed: int) -> None:
        self._settings, self._faults, self._seed = settings, faults, seed
        self._counts: dict[str, int] = {}
        self._chances: dict[str, Chance] = {}
        self._last_ns: dict[tuple[str, str], int] = {}
        self.position_m: Position | None = None
        self.lost = 0

    @property
    def at_fault(self) -> bool:
        """Whether topics that do not cross the link may have a fault."""
        return bool(self._faults.active)

    def arrival_ns(self, topic: str, receiver: str, sent_ns: int, *, crosses: bool) -> int | None:
        """Return when a message arrives at a receiver; None: never. Messages of a topic do not overtake each other."""
        loss, delay_s = (self._loss(), self._settings.delay_s) if crosses else (0.0, 0.0)
        for fault in self._of(topic, crosses=crosses):
            share, more_s = self._by_fault(fault)
            loss, delay_s = 1.0 - (1.0 - loss) * (1.0 - share), delay_s + more_s
        if loss == 0.0 and delay_s == 0.0:
            return self._in_order(topic, receiver, sent_ns)
        key = f"{topic} to {receiver}"
        index = self._counts.get(key, 0)
        self._counts[key] = index + 1
        chance = self._chance(key).of(index).random(2)
        if chance[0] < loss:
            self.lost += 1
            return None
        late_ns = round((1.0 + _SPREAD * (2.0 * float(chance[1]) - 1.0)) * delay_s * SECOND_NS)
        return self._in_order(topic, receiver, sent_ns + late_ns)

    def _chance(self, key: str) -> Chance:
        found = self._chances.get(key)
        if found is None:
            found = self._chances[key] = Chance(self._seed, f"link {key}")
        return found

    def _in_order(self, topic: str, receiver: str, at_ns: int) -> int:
        key = topic, receiver
        at_ns = max(at_ns, self._last_ns.get(key, at_ns))
        self._last_ns[key] = at_ns
        return at_ns

    def _of(self, topic: str, *, crosses: bool) -> list[Fault]:
        targets = (topic, LINK) if crosses else (topic,)
        return [
            one
            for one in self._faults.active
            if one.settings.target in targets and one.settings.kind in ("link_lost", "link_degraded")
        ]

    def _by_fault(self, fault: Fault) -> tuple[float, float]:
        if fault.settings.kind == "link_lost":
            return 1.0, 0.0
        return fault.settings.size or _DEGRADED_SHARE, self._settings.degraded_delay_s

    def _loss(self) -> float:
        """Return the share that is lost where the machine is."""
        kept = 1.0 - self._settings.loss_share
        if self.position_m is not None:
            for point in self._settings.fades_m:
                apart = math.dist(point, self.position_m) / self._settings.fade_radius_m
                kept *= 1.0 - self._settings.fade_loss_share * math.exp(-(apart**2))
        return 1.0 - kept


class ConsoleRadio:
    """The link as an operator's console meets it (`lhdmap.console.crossing.Radio`).

    What it loses is counted apart: a run that is done again from its journal has no console, and comes out the same.
    """

    def __init__(self, settings: LinkSettings, faults: Faults, seed: int, beside: Link) -> None:
        self._link, self._beside = Link(settings, faults, seed), beside

    def __call__(self, topic: str, now_ns: int) -> int | None:
        """Return the delay of a message that is sent now (ns), None where it is lost."""
        self._link.position_m = self._beside.position_m
        at_ns = self._link.arrival_ns(topic, "console", now_ns, crosses=True)
        return None if at_ns is None else at_ns - now_ns
