"""What the loading task remembers of a mission between two calls."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from lhdmap.loading.moment import Mission, Target
from lhdmap.loading.states import State
from lhdmap.pile.result import PileEstimate

_MOST_TRIED = 50


@dataclass
class Memory:
    """State and since when; what the bucket and operators have done since the last weighing.

    `active`: a mission is under way; `touched`: the bucket has been in the pile, or may have been; `loaded`: an operator finished
    by hand; `valid_ns`: since when all that re-validation asks for has held; `marked`: a pile that an operator marked; `seen_ns`:
    of the pile only what is younger counts; `face_m`: how far behind the toe the scan hit the face before the bucket went in.
    """

    state: State = State.IDLE
    since_ns: int = 0
    mission: Mission | None = None
    target: Target | None = None
    marked: PileEstimate | None = None
    active: bool = False
    touched: bool = False
    loaded: bool = False
    seen_ns: int = 0
    face_m: float = math.nan
    valid_ns: int | None = None
    holds: int = 0
    tried: list[str] = field(default_factory=list)
    last_ns: int | None = None

    def begin(self, mission: Mission) -> None:
        """Begin a mission; what was before is forgotten."""
        self.mission, self.target, self.marked = mission, None, None
        self.active, self.touched, self.loaded = True, False, False
        self.holds, self.seen_ns, self.tried, self.face_m = 0, 0, [], math.nan

    def note(self, text: str) -> None:
        """Remember what was tried, for a request; the oldest is forgotten."""
        self.tried.append(text)
        del self.tried[:-_MOST_TRIED]
