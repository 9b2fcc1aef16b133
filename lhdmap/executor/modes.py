"""The modes of `/operation/mode`: whose commands count, and what must be fresh for it. A change never moves the machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from lhdmap.driving.motion import Setpoint, Setpoints
from lhdmap.executor.notes import Notes
from lhdmap.executor.watchdog import GUIDANCE, LINK, MOTION, OPERATOR, POSE, SCAN_FRONT, SCAN_REAR

_SCANS = (SCAN_FRONT, SCAN_REAR)


class Mode(NamedTuple):
    """A mode: whose setpoints count (`guidance`, `operator`, none), who steers and gives the speed, inputs it needs.

    All commands pass the executor's limits and the guard, an operator's as well.
    """

    source: str
    speed_by: str
    steering_by: str
    needs: tuple[str, ...]


MODES: dict[str, Mode] = {
    "idle": Mode("", "", "", ()),
    "autonomous": Mode("guidance", "navigation", "guidance", (MOTION, *_SCANS, POSE, GUIDANCE, LINK)),
    "assisted": Mode("guidance", "operator", "guidance", (MOTION, *_SCANS, POSE, GUIDANCE, OPERATOR, LINK)),
    "teleoperated": Mode("operator", "operator", "operator", (MOTION, *_SCANS, OPERATOR, LINK)),
    "manual": Mode("operator", "operator", "operator", (MOTION, *_SCANS, OPERATOR)),
}
"""`assisted`: the operator gives speed and branch, guidance steers and keeps off the walls. `manual`: the operator is on board,
no link is needed."""
IDLE = "idle"


class Modes:
    """The mode in force. A change empties the queue (who composes does it) and waits for a command given after it."""

    def __init__(self) -> None:
        self.name, self.notes = IDLE, Notes()
        self._since_ns: int | None = None

    @property
    def mode(self) -> Mode:
        """What the mode in force means."""
        return MODES[self.name]

    def change(self, name: str, now_ns: int, *, refused: Sequence[str] = (), cause: str = "") -> bool:
        """Go to a mode; False where it is unknown or refused, such as one that moves while the machine is not armed."""
        why = "unknown mode" if name not in MODES else "; ".join(refused)
        if why:
            self.notes.add("mode", self.name, self.name, f"'{name}' refused: {why}")
            return False
        if name != self.name:
            self.notes.add("mode", self.name, name, cause)
            self.name, self._since_ns = name, now_ns
        return True

    def renew(self, now_ns: int) -> None:
        """Want commands given from now on alone, as after a change."""
        self._since_ns = now_ns

    def takes(self, source: str, given_ns: int) -> bool:
        """Return whether setpoints of a source that were made at `given_ns` count: what was made before the change does not."""
        return bool(source) and source == self.mode.source and (self._since_ns is None or given_ns >= self._since_ns)


def operator_setpoints(
    speed_mps: float, steering_rate_rps: float, now_ns: int, hold_s: float, steer_s: float
) -> Setpoints:
    """Return an operator's command as a plan: his speed for `hold_s`, so that Eq. (20) allows it, his steering for `steer_s`.

    Where he falls silent the machine must not bend on and on while it brakes: after `steer_s` the joint is held.
    """
    steer_s = min(steer_s, 0.5 * hold_s)

    def at(after_s: float, rate_rps: float) -> Setpoint:
        return Setpoint(now_ns + round(after_s * 1e9), speed_mps, rate_rps)

    return (at(0.0, steering_rate_rps), at(steer_s, steering_rate_rps), at(steer_s + 0.05, 0.0), at(hold_s, 0.0))
