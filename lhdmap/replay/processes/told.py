"""What the processes of an autonomous drive say to each other, beside the contract's topics."""

from __future__ import annotations

from typing import NamedTuple

from lhdmap.guidance.directive import Directive
from lhdmap.messages import FloatArray


class Seen(NamedTuple):
    """Hits (N, 2) of both scanners in `base_link` at a pose (3,) in `odom`, and how far pose and scan disagree (m, rad).

    `front`: how many of the hits, the first ones, are of the front scanner.
    """

    stamp_ns: int
    pose_odom: FloatArray
    points_m: FloatArray
    apart_m: float
    apart_rad: float
    front: int


class Asked(NamedTuple):
    """What navigation asks for: a directive, or None: stand."""

    stamp_ns: int
    directive: Directive | None
    cause: str


class Idle(NamedTuple):
    """Guidance lives, and has nothing to plan."""

    stamp_ns: int


class Word(NamedTuple):
    """What the station says: always a sign of life; a mode, arming, a stop, the joystick where they are wanted.

    `gave_up`: it helps no more, and why.
    """

    stamp_ns: int
    mode: str = ""
    rearm: bool = False
    emergency: str = ""
    release: bool = False
    speed_mps: float | None = None
    steering_rate_rps: float = 0.0
    go_on: bool = False
    goal: str = ""
    gave_up: str = ""


class Health(NamedTuple):
    """What the machine tells the station: armed, mode, standing, why it stopped, what help it asks for, its last gear."""

    stamp_ns: int
    armed: bool
    mode: str
    standing: bool
    causes: tuple[str, ...]
    asks: str = ""
    gear: int = 1


class ModeNow:
    """The mode in force, as the log says it (`/operation/mode`)."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __call__(self, stamp_ns: int, state: FloatArray) -> str:
        """Return it."""
        return self.text
