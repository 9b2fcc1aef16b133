"""What the processes of an autonomous drive say to each other, beside the contract's topics."""

from __future__ import annotations

from typing import NamedTuple

from lhdmap.guidance.directive import Directive
from lhdmap.loading.assistance import Answer, Request
from lhdmap.localization.floor import NO_FLOOR
from lhdmap.messages import Command, FloatArray


class Seen(NamedTuple):
    """Hits (N, 2) of both scanners in `base_link` at a pose (3,) in `odom`, and how far pose and scan disagree (m, rad).

    `front`: how many of the hits, the first ones, are of the front scanner. `floor_m` (K, 3): the floor about it as the map has
    it, x, y in `odom`; none where it is flat, or not known.
    """

    stamp_ns: int
    pose_odom: FloatArray
    points_m: FloatArray
    apart_m: float
    apart_rad: float
    front: int
    floor_m: FloatArray = NO_FLOOR


class Asked(NamedTuple):
    """What navigation or the loading task asks for: a directive, or None: stand.

    `touched_m`: corners (4, 2) in `odom`, counterclockwise, of where hits are no obstacle: the bucket is in them. `pile_m`: the
    same of a pile that is driven up to: guidance takes its banks for no walls, but nothing is to be touched yet.
    """

    stamp_ns: int
    directive: Directive | None
    cause: str
    touched_m: FloatArray | None = None
    pile_m: FloatArray | None = None


class Digs(NamedTuple):
    """What the loading task asks of the pedals; corners (4, 2) in `odom`, counterclockwise, of where its bucket is to touch."""

    pedals: Command
    touched_m: FloatArray


class Orders(NamedTuple):
    """What the executive of a mission asks for.

    `number` counts what is asked of navigation: another one is another drive; no goal: stand. `loading`, `dumping`: number of the
    task that is to run, 0: none; while one of loading runs, what navigation drives goes through the loading task. `free`: nodes
    (ids of the map) that the machine may be in, None: all.
    """

    stamp_ns: int
    number: int
    goal: str
    loaded: bool
    loading: int = 0
    dumping: int = 0
    free: frozenset[str] | None = None


class Navigating(NamedTuple):
    """What navigation does: state, number of the order and goal that it is at, why, way to the goal (m, infinite: not known)."""

    stamp_ns: int
    state: str
    number: int
    goal: str
    reason: str
    left_m: float


class DumpingNow(NamedTuple):
    """What the dumping does: number of the task, and `busy`, `done` or `failed`, why."""

    stamp_ns: int
    task: int
    state: str
    reason: str = ""


class WayNow(NamedTuple):
    """What a machine drives on a site: the edges of its way; `dock`: by a planned way to the end of the last of them."""

    stamp_ns: int
    edges: tuple[int, ...]
    dock: bool = False


class WorkNow(NamedTuple):
    """A timed task: its number, `busy` or `done`, what is in the body then (t)."""

    stamp_ns: int
    task: int
    state: str
    mass_t: float


class LoadingNow(NamedTuple):
    """What the loading task does: number of its mission, state, phase, attempts, the last fill (NaN: none), the open request."""

    stamp_ns: int
    number: int
    state: str
    phase: str
    attempts: int
    fill: float
    fill_std: float
    request: Request | None


class Idle(NamedTuple):
    """Guidance lives, and has nothing to plan."""

    stamp_ns: int


class Word(NamedTuple):
    """What the station says: always a sign of life; a mode, arming, a stop, the joystick where they are wanted.

    `gave_up`: it helps no more, and why. `stop`: why the machine is to stop and disarm; armed again, it may go on.
    """

    stamp_ns: int
    mode: str = ""
    rearm: bool = False
    emergency: str = ""
    stop: str = ""
    release: bool = False
    speed_mps: float | None = None
    steering_rate_rps: float = 0.0
    go_on: bool = False
    goal: str = ""
    answer: Answer | None = None
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
