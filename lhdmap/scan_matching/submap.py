"""A piece of map that scans are matched against: walls, what was seen of them, and the two ways to place a scan in it."""

from __future__ import annotations

from typing import Self

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.matching import Hits, Match, MatchModel, Prior, match
from lhdmap.scan_matching.search import SearchGrid, search
from lhdmap.scan_matching.surface_map import empty_map, insert_all

OTHER_VISIT = MatchModel(noise_m=0.02, cutoff_sigmas=3.0, min_cells=3.0, coarse_noise=0.05, rounds=8)
"""How well a scan fits walls that were seen at another time."""
_PLAIN_GRID = SearchGrid()
_WINDOW_CELLS, _HIT_LIMIT = 2048, 50.0
_HARDLY_HELD = np.diag([1e-2, 1e-2, 1e-1])  # 10 m and 3 rad
_WEAKER = 0.01


class Submap:
    """Walls in a frame of their own (`of`, `insert`); `align` places a scan from near by, `locate` from metres away.

    Args:
        cell_m: finest cell in which hits are averaged (`surface_map`).
        model: how far hits may be from a wall; may be replaced at any time.
        grid: how `locate` searches.
        window_cells: width of the finest grid, a power of two; what is farther apart than that shares its memory.
        hit_limit: hits after which the mean of a cell forgets.
        remembers: so many of the scans inserted last are what a search compares with; None: all of them.
    """

    def __init__(
        self,
        cell_m: float,
        *,
        model: MatchModel = OTHER_VISIT,
        grid: SearchGrid = _PLAIN_GRID,
        window_cells: int = _WINDOW_CELLS,
        hit_limit: float = _HIT_LIMIT,
        remembers: int | None = None,
    ) -> None:
        self.cell_m, self.model = cell_m, model
        self.walls = empty_map(cell_m, window_cells)
        self._grid, self._hit_limit, self._remembers = grid, hit_limit, remembers
        self._seen: list[FloatArray] = []

    @classmethod
    def of(
        cls,
        points: FloatArray,
        cell_m: float,
        *,
        model: MatchModel = OTHER_VISIT,
        grid: SearchGrid = _PLAIN_GRID,
        window_cells: int = _WINDOW_CELLS,
    ) -> Self:
        """Return the submap of points (N, 3), x, y and height in its frame."""
        submap = cls(cell_m, model=model, grid=grid, window_cells=window_cells)
        submap.insert(points, np.zeros(3))
        return submap

    @property
    def scans(self) -> int:
        """How many scans a search compares with."""
        return len(self._seen)

    def insert(self, points: FloatArray, pose: FloatArray) -> None:
        """Take the hits of a scan, shape (N, 3), level frame of the machine, heights absolute, seen at `pose` (3,)."""
        hits = se2.transform(pose, points)
        insert_all(self.walls, hits, self._hit_limit)
        self._seen.append(hits)
        if self._remembers is not None:
            del self._seen[: -self._remembers]

    def align(self, hits: Hits, prior: Prior, start: FloatArray | None = None) -> Match:
        """Return the match of a scan with the walls: maximum a posteriori under `prior`, from its pose or from `start` (3,).

        It finds what is some centimetres and about a degree away. Where the walls do not hold a direction, the prior does.
        """
        return match(self.walls, hits, prior, prior.pose if start is None else start, self.model)

    def locate(self, hits: Hits, predicted: Prior, reach: FloatArray) -> list[Match]:
        """Return where a scan may be, best first, by the share of its hits that agree; none where nothing is like it.

        Each match is at a place of its own. Whether the first is good enough, and better enough than the second, is the caller's
        to say.

        Args:
            hits: the scan; the search uses the front scanner's hits.
            predicted: where it is thought to be (`unsure`, where nothing tells how well). It breaks ties between the poses that
                matches start from, and holds a match where walls do not; it does not hold it back elsewhere.
            reach: how far from there matches start, metres and radians, shape (2,); one may end a little beyond.
        """
        kept: list[Match] = []
        for one in sorted(self.candidates(hits, predicted, reach), key=lambda one: one.support, reverse=True):
            if one.support > 0.0 and not any(self._same(one, better) for better in kept):
                kept.append(one)
        return kept

    def candidates(self, hits: Hits, predicted: Prior, reach: FloatArray) -> list[Match]:
        """Return the matches from all starts that the search finds, the likeliest start first; several may end at one place.

        For those who judge by more than support; arguments as for `locate`.
        """
        points = hits.points[: hits.front]
        if not len(points) or not self._seen:
            return []
        thin = points[:: max(len(points) // self._grid.beams, 1)]
        starts = search(np.concatenate(self._seen), thin, predicted.pose, predicted.information, reach, self._grid)
        held = weakened(predicted)
        return [self.align(hits, held, start) for start in starts]

    def _same(self, a: Match, b: Match) -> bool:
        """Return whether the search cannot tell two places apart."""
        apart = se2.between(a.pose, b.pose)
        return bool(np.hypot(apart[0], apart[1]) < self._grid.cell_m and abs(apart[2]) < self._grid.step_rad)


def unsure(pose: FloatArray) -> Prior:
    """Return a prior that says hardly anything: a pose (3,) that may be metres off."""
    return Prior(pose, _HARDLY_HELD)


def weakened(prior: Prior) -> Prior:
    """Return a prior that holds a match back only where the scan says nothing."""
    return Prior(prior.pose, _WEAKER * prior.information)
