"""The walls that scans are matched against: when a scan enters them, and how noisy the scanner really is."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.settings import AnchorSettings, OdometrySettings, SearchSettings
from lhdmap.scan_matching.matching import MatchModel
from lhdmap.scan_matching.search import SearchGrid
from lhdmap.scan_matching.submap import Submap

_RECENT_SCANS = (
    12  # that a wide search compares with: at `insert_m` of 0.06 m those of the last 0.7 m, which see the same walls
)
_YOUNG_SCANS = 4  # the first scans of a map enter it also at rest: their mean is less noisy than one of them
_USUAL_RESIDUAL = (
    0.75  # weighted rms in sigmas that matches have whose noise is stated rightly: Tukey's weights take the tails
)
# Share (as an exponent) of a scan's residual that goes into the noise, and the most that one scan may say: a memory of twenty
# scans, which one scan full of dust hardly moves.
_NOISE_GAIN, _MOST_RESIDUAL = 0.05, (0.5, 2.0)
_NOISE_SCALES = (
    0.8,
    6.0,
)  # of the noise that is set: six times covers rounding to several centimetres, and dust


class LocalMap:
    """A `Submap` with the odometry's rules for what enters it."""

    def __init__(self, settings: OdometrySettings, anchor: AnchorSettings, wide: SearchSettings) -> None:
        self.anchor = anchor
        self._wide, self._noise_m = wide, settings.range_noise_m
        self._noise_scale = 1.0
        self._inserted: FloatArray | None = None
        self.walls = self._empty(_model(settings, anchor))

    @property
    def begun(self) -> bool:
        """Whether a scan has entered."""
        return self._inserted is not None

    @property
    def model(self) -> MatchModel:
        """How far hits may be from the walls now."""
        return self.walls.model

    def clear(self) -> None:
        """Forget all walls; what was learned of the scanner stays."""
        self.walls = self._empty(self.walls.model)

    def mixes_heights(self) -> None:
        """Take it that the scanner tilts: coarse cells mix heights then."""
        self.walls.model = self.walls.model._replace(coarse_noise=self.anchor.coarse_noise)

    def learn_noise(self, residual_sigmas: float) -> None:
        """Follow the scanner's real noise (rounding to centimetres, dust) from the size of the residuals."""
        said = min(max(residual_sigmas / _USUAL_RESIDUAL, _MOST_RESIDUAL[0]), _MOST_RESIDUAL[1])
        self._noise_scale = min(max(self._noise_scale * said**_NOISE_GAIN, _NOISE_SCALES[0]), _NOISE_SCALES[1])
        self.walls.model = self.walls.model._replace(noise_m=self._noise_m * self._noise_scale)

    def grow(self, points: FloatArray, pose: FloatArray, *, smooth: bool) -> None:
        """Insert hits (N, 3) seen at `pose` (3,) where it has moved on since the last ones that were; the first ones always.

        But not where walls are smooth: chords between the same far hits, again and again, hold a machine where it stood.
        """
        step = pose - (self._inserted if self._inserted is not None else np.zeros(3))
        moved = np.hypot(*step[:2]) >= self.anchor.insert_m
        turned = abs(se2.wrap(step[2])) >= math.radians(self.anchor.insert_deg)
        if moved or turned or (self.walls.scans < _YOUNG_SCANS and not smooth):
            self.insert(points, pose)

    def insert(self, points: FloatArray, pose: FloatArray) -> None:
        """Take hits (N, 3) seen at `pose` (3,)."""
        self.walls.insert(points, pose)
        self._inserted = pose

    def _empty(self, model: MatchModel) -> Submap:
        wide, anchor = self._wide, self.anchor
        grid = SearchGrid(wide.cell_m, math.radians(wide.step_deg), wide.beams, apart_m=math.inf)
        return Submap(anchor.cell_m, model=model, grid=grid, hit_limit=anchor.hit_limit, remembers=_RECENT_SCANS)


def _model(settings: OdometrySettings, anchor: AnchorSettings) -> MatchModel:
    """Return how far a level scanner's hits may be from the walls that it saw a moment ago."""
    return MatchModel(
        settings.range_noise_m,
        anchor.cutoff_sigmas,
        anchor.min_cells,
        0.0,
        anchor.rounds,
        anchor.lean,
        anchor.lean_patch_m,
    )
