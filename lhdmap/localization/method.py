"""What each way of tracking is told and tells: the default (`tracker`) and the paper's (`paper`)."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from lhdmap.landmarks.quality import Quality
from lhdmap.messages import FloatArray


class Wheels(NamedTuple):
    """Motion by the wheels over `dt_s` since the scan before; NaN where they do not tell it, the turn apart."""

    dt_s: float
    forward_m: float
    turn_rad: float


class Corrected(NamedTuple):
    """What a scan says: share of hits that agree, information along the machine (1/m²); `source`: what corrected the pose."""

    support: float
    information_along: float
    source: str = "walls"


class Tracks(Protocol):
    """A pose (3,) in `map`, its covariance `P` (3, 3) in the map's axes, the floor's height there."""

    pose: FloatArray
    height_m: float

    @property
    def P(self) -> FloatArray:  # noqa: N802
        """Covariance (3, 3) of the pose, map axes."""

    @property
    def deviations(self) -> FloatArray:
        """Standard deviations (3,) along, across and of the heading, in the machine's axes."""

    def predict(self, step: FloatArray, covariance: FloatArray, wheels: Wheels | None = None, /) -> None:
        """Carry the pose on by a step (3,) of the odometry with its covariance (3, 3), in the axes of its end."""

    def correct(self, points: FloatArray, front: int, quality: Quality, /) -> Corrected:
        """Take hits (N, 2) in the machine's frame, the first `front` of the front scanner."""

    def turn_if_better(self, points: FloatArray) -> None:
        """Turn round where hits (N, 2) fit the walls clearly better so."""
