"""Finds the place of a machine on the map, confirms it, and keeps checking it: when a search is due, and what became of it."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from lhdmap.geometry import se2
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.localization.recent_way import RecentWay
from lhdmap.localization.search import CHECK, CONFIRM, FIND, GlobalSearch, Question, Search
from lhdmap.localization.search_thread import SearchThread
from lhdmap.localization.settings import LocalizationSettings
from lhdmap.messages import FloatArray

_CHECKED_M = 12.0  # what lies farther back says nothing of a machine that was moved since
_GROWS = 0.1  # a search needs so much more wall than the one before
_KEPT = 20_000  # searches: of a day; older ones are forgotten


class Finder:
    """`searches`: what they said, in order. `waits`: as for `SearchThread`."""

    def __init__(
        self, search: GlobalSearch, settings: LocalizationSettings, landmarks: LandmarkSettings, *, waits: bool = True
    ) -> None:
        self._settings, self._landmarks = settings, landmarks
        self._thread = SearchThread(search, waits=waits)
        self._way = RecentWay(settings.window_m, landmarks)
        self._asked_m = -math.inf
        self.searches: deque[Search] = deque(maxlen=_KEPT)

    def add(self, pose_odom_base: FloatArray, points: FloatArray) -> None:
        """Take the hits (N, 2) of a scan in the machine's frame, at a pose (3,) in `odom`."""
        self._way.add(pose_odom_base, points)

    def forget(self) -> None:
        """Forget the walls so far: they may be of another place."""
        self._way = RecentWay(self._settings.window_m, self._landmarks)

    def again(self) -> None:
        """Search again as soon as may be."""
        self._asked_m = -math.inf

    def ask(
        self,
        purpose: str,
        stamp_ns: int,
        travelled_m: float,
        pose_odom_base: FloatArray,
        claimed: FloatArray | None,
        came: Callable[[FloatArray], npt.NDArray[np.bool_]] | None = None,
    ) -> None:
        """Begin a search if one is due; `claimed` (4,): place x, y, yaw, height that is on trial or tracked.

        `came`: tells which hits (N, 2) in `odom` are of what came since the map was made; they are left out.
        """
        finding_m = max(self._settings.search_every_m, _GROWS * self._way.length_m)
        every_m = {FIND: finding_m, CHECK: self._settings.check_every_m, CONFIRM: 0.0}[purpose]
        # Standing still tells nothing new.
        if self._thread.busy or travelled_m - self._asked_m < every_m or self._way.length_m < self._settings.search_m:
            return
        self._asked_m = travelled_m
        window = self._way.snapshot(_CHECKED_M if purpose == CHECK else math.inf)
        if came is not None:
            kept = ~came(window.points)
            window = window._replace(points=window.points[kept], counts=window.counts[kept])
        self._thread.ask(Question(stamp_ns, travelled_m, purpose, window, pose_odom_base.copy(), claimed))

    def answer(self, stamp_ns: int, pose_odom_base: FloatArray) -> Search | None:
        """Return the answer that is due, its places carried on to where the machine is now."""
        due = self._thread.answer(stamp_ns)
        if due is None:
            return None
        asked, said = due
        self.searches.append(said)
        moved = se2.between(asked.pose_odom_base, pose_odom_base)
        return said._replace(
            candidates=tuple(one._replace(pose=se2.compose(one.pose, moved)) for one in said.candidates),
            claimed=said.claimed and said.claimed._replace(pose=se2.compose(said.claimed.pose, moved)),
        )

    @property
    def waited_s(self) -> float:
        """How long searches have been waited for: nothing does on a running machine."""
        return self._thread.waited_s

    def close(self) -> None:
        """End the thread."""
        self._thread.close()
