"""Settings of the operator's console and of the machine's end of its link."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.errors import ConfigError
from lhdmap.settings import setting

_ISA = "ISA-18.2: about one alarm a minute can be managed for ten minutes"


@dataclass(frozen=True, slots=True)
class ConsoleSettings:
    """When a machine stops for an operator who is not there, how many alarms he gets, and how he logs in."""

    heartbeat_limit_s: float = setting(
        0.5,
        unit="s",
        minimum=0.1,
        maximum=5.0,
        doc="An armed machine stands before its operator's page was silent for so long.",
    )
    latency_limit_s: float = setting(
        0.25,
        unit="s",
        minimum=0.01,
        maximum=5.0,
        doc="Round trip machine, page, machine; five in a row above it stop the machine.",
    )
    tick_s: float = setting(
        0.1, unit="s", minimum=0.01, maximum=1.0, doc="How often a machine asks the page for a sign of life."
    )
    alarms_most: int = setting(
        10,
        minimum=1,
        maximum=1000,
        source=_ISA,
        doc="Warnings that are shown in a window; stops and requests always are.",
    )
    alarms_window_s: float = setting(600.0, unit="s", minimum=1.0, maximum=86_400.0, source=_ISA, doc="That window.")
    login_tries: int = setting(5, minimum=1, maximum=100, doc="Wrong codes in a window; then all are refused.")
    login_window_s: float = setting(60.0, unit="s", minimum=1.0, maximum=86_400.0, doc="That window.")
    session_h: float = setting(
        10.0, unit="h", minimum=0.01, maximum=24.0, doc="After so long an operator logs in again."
    )

    def __post_init__(self) -> None:
        """Check what a field alone cannot; raises ConfigError."""
        if self.heartbeat_limit_s < 3.0 * self.tick_s:
            raise ConfigError(
                f"heartbeat_limit_s = {self.heartbeat_limit_s:g} and tick_s = {self.tick_s:g}: three ticks within it were wanted"
            )
