"""The paper's localization (topological_navigation, Section 3.3), beside the default one to be compared with it.

In a tunnel the place is ρ along its axis: a Kalman filter over ρ and v, Eq. (1), corrected by the wheels' speed with each scan and
by ICP against landmarks twice a second. In an intersection pose and heading are those of wheels and ICP directly. What the paper
leaves open, and what does not work as printed (docs/localization_paper.md lists it):

* `dir` is discrete, so no Kalman filter estimates it: it is the heading against the axis.
* heading and lateral place are no part of the filter: those of the last match, carried on by the wheels' turn or the axis.
* the most similar landmark is that with the least fitness among those that meet their own threshold; the match gives where the
  scan was taken on it, and so ρ, lateral place and heading. No gate: the paper names none.
* nothing in it tells that the place is lost. So it is never lost here: its support is always 1.
"""

from __future__ import annotations

import math

import numpy as np

from lhdmap.geometry import se2
from lhdmap.landmarks.quality import Quality
from lhdmap.localization.method import Corrected, Wheels
from lhdmap.localization.paper_nodes import PaperNodes, Seen
from lhdmap.localization.place_on_map import Placer
from lhdmap.localization.tracker import MapTracker, turned
from lhdmap.messages import FloatArray
from lhdmap.topology.model import Tunnel

_EVERY_S = 0.5  # from match to match: measured prototypes
_WHEELS_MPS = 0.05  # deviation of the wheels' speed: measured prototypes
_ACCELERATION = 0.7  # m/s²/√Hz of v: an LHD's braking
_ICP_M = 0.05  # deviation of ρ by a match: 8 to 50 mm, measured prototypes
_ASIDE_M, _HEADING_RAD = (
    0.05,
    math.radians(0.5),
)  # stated across and of the heading: the paper has no deviations of them
_DRIFT_RAD = math.radians(0.3)  # of the heading by wheels, each √m
_LEAST_HITS = 30


class _OnNode:
    """The node that the pose is in; where that is a `tunnel`: lateral place, heading of the axis, and `dir` (1 or -1)."""

    def __init__(self) -> None:
        self.node = ""
        self.tunnel: Tunnel | None = None
        self.lateral_m = self.axis_rad = 0.0
        self.direction = 1.0


class PaperTracker:
    """`pose` (3,) in `map`; in a tunnel held as ρ (`x[0]`), lateral place and heading; `C` (2, 2) is the covariance of ρ, v."""

    def __init__(self, nodes: PaperNodes, placer: Placer, start: MapTracker) -> None:
        self._nodes, self._placer, self._start = nodes, placer, start
        self.pose, self.height_m = start.pose.copy(), start.height_m
        self.x = np.zeros(2)
        self.C = np.diag([float(start.deviations[0]) ** 2, 1.0])
        self._since_s, self._blind_m = math.inf, 0.0
        self._at = _OnNode()
        self._enter()

    def predict(self, _step: FloatArray, _covariance: FloatArray, wheels: Wheels | None = None, /) -> None:
        """Carry the pose on by Eq. (1), and correct v by the wheels; the odometry's step is not used."""
        if wheels is None:
            return
        dt = wheels.dt_s
        self._since_s += dt
        self.x = np.array([self.x[0] + self.x[1] * self._at.direction * dt, self.x[1]])
        F = np.array([[1.0, self._at.direction * dt], [0.0, 1.0]])
        q = _ACCELERATION**2 * np.array(
            [[dt**3 / 3.0, self._at.direction * dt**2 / 2.0], [self._at.direction * dt**2 / 2.0, dt]]
        )
        self.C = F @ self.C @ F.T + q
        if dt > 0.0 and math.isfinite(wheels.forward_m):
            self._update(np.array([0.0, 1.0]), wheels.forward_m / dt, _WHEELS_MPS**2)
        self._blind_m += abs(self.x[1]) * dt
        self._carry(dt, wheels.turn_rad)

    def _carry(self, dt_s: float, turn_rad: float) -> None:
        """Place the pose: in a tunnel at ρ, else by speed and turn; then see which node it is in."""
        tunnel = self._at.tunnel
        if tunnel is None:
            turn = turn_rad if math.isfinite(turn_rad) else 0.0
            self.pose = se2.compose(self.pose, np.array([self.x[1] * dt_s, 0.0, turn]))
        else:
            before = self._at.axis_rad
            self._at.lateral_m += self.x[1] * dt_s * math.sin(self.pose[2] - before)
            place, axis = self._nodes.on_axis(tunnel, float(self.x[0]), self._at.lateral_m)
            turn = turn_rad if math.isfinite(turn_rad) else math.remainder(axis - before, 2.0 * math.pi)
            self.pose, self._at.axis_rad = np.array([*place, self.pose[2] + turn]), axis
        self._enter()

    def _enter(self) -> None:
        """Hand over where the pose is in another node (3.3.3): it stays where it is in `map`, ρ is that of the new axis."""
        place = self._placer.at(self.pose, self.height_m, 1.0)
        if place.node in (self._at.node, ""):
            return
        node = self._nodes.topology.nodes[place.node]
        self._at.node, self._at.direction = place.node, 1.0
        self._at.tunnel = node if isinstance(node, Tunnel) else None
        if self._at.tunnel is not None:
            self._stand(place.rho_m, place.lateral_m)

    def _stand(self, rho_m: float, lateral_m: float) -> None:
        assert self._at.tunnel is not None  # noqa: S101  # asked for in tunnels alone
        self.x[0], self._at.lateral_m = rho_m, lateral_m
        _, self._at.axis_rad = self._nodes.on_axis(self._at.tunnel, rho_m, 0.0)
        self._at.direction = math.copysign(1.0, math.cos(self.pose[2] - self._at.axis_rad))

    def _update(self, H: FloatArray, value: float, variance: float) -> None:
        gain = self.C @ H / (H @ self.C @ H + variance)
        self.x = self.x + gain * (value - H @ self.x)
        self.C = (np.eye(2) - np.outer(gain, H)) @ self.C

    def correct(self, points: FloatArray, _front: int, _quality: Quality, /) -> Corrected:
        """Match hits (N, 2) in the machine's frame with landmarks, twice a second."""
        if self._since_s < _EVERY_S:
            return Corrected(1.0, 0.0, "")
        self._since_s = 0.0
        cloud = self._nodes.cloud(points)
        if len(cloud) < _LEAST_HITS:
            return Corrected(1.0, 0.0, "odometry")
        seen = self._seen(cloud)
        if seen is None:
            return Corrected(1.0, 0.0, "odometry")
        self._blind_m = 0.0
        self._take(seen.pose)
        return Corrected(1.0, _ICP_M**-2, "landmarks")

    def _seen(self, cloud: FloatArray) -> Seen | None:
        if self._at.tunnel is None:
            return self._nodes.in_intersection(self._at.node, self.pose, cloud)
        return self._nodes.most_similar(self._at.node, float(self.x[0]), self.pose, cloud)

    def _take(self, pose: FloatArray) -> None:
        """Take over a pose (3,) that a match gave: in a tunnel through the filter, in an intersection as it is."""
        if self._at.tunnel is None:
            self.pose, self.C[0] = pose, [_ICP_M**2, 0.0]
            self.C[1, 0] = 0.0
        else:
            rho, lateral = self._placer.along(self._at.tunnel, pose, self.height_m)
            self._update(np.array([1.0, 0.0]), rho, _ICP_M**2)
            place, _ = self._nodes.on_axis(self._at.tunnel, float(self.x[0]), lateral)
            self.pose = np.array([*place, pose[2]])
            self._stand(float(self.x[0]), lateral)
        self._enter()

    def turn_if_better(self, points: FloatArray) -> None:
        """Turn round where hits (N, 2) fit the walls clearly better so."""
        self._start.turn_if_better(points)
        self.pose[2] = self._start.pose[2]
        self._at.node = ""
        self._enter()

    @property
    def deviations(self) -> FloatArray:
        """Standard deviations (3,) along, across and of the heading, in the machine's axes."""
        drift = _DRIFT_RAD * math.sqrt(self._blind_m)
        aside = math.hypot(_ASIDE_M, 0.5 * drift * self._blind_m)
        return np.array([math.sqrt(self.C[0, 0]), aside, math.hypot(_HEADING_RAD, drift)])

    @property
    def P(self) -> FloatArray:  # noqa: N802
        """Covariance (3, 3) of the pose, map axes."""
        R = turned(float(self.pose[2]))
        P: FloatArray = R @ np.diag(self.deviations**2) @ R.T
        return P
