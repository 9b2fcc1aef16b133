"""Fixed-lag smoother of the poses on a map: each is final once the machine is some metres farther, seen from both sides.

Nodes each half metre, tied by the odometry's steps (walls, wheels and joint, as they were weighed there), by the turn of the
gyroscope where it is believed, and to the map by what each scan's match told: robustly, as a changed place is no measurement.
gtsam's `BatchFixedLagSmoother` solves the window and turns what leaves it into a prior (Dellaert and Kaess, *Factor Graphs for
Robot Perception*, 2017, chapter 5). What a match told is what the tracker's covariance lost by it:

    information = P⁻¹(after) - P⁻¹(before),  measured = after + information⁻¹ P⁻¹(before) (after - before)
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.localization.place_on_map import Placer
from lhdmap.localization.rows import LocalizationRow
from lhdmap.messages import FloatArray

_LAG_M, _NODE_M = 15.0, 0.5
_CAUCHY = 2.0
_LEAST_STEP_STD = np.array([1e-3, 1e-3, math.radians(0.01)])
_LEAST_INFORMATION = 1e-3
_TURN_STD_RAD = math.radians(0.02)
_LOOSE_M = 1e3
_OF_THE_MAP = np.diag([0.004**2, 0.004**2, math.radians(0.02) ** 2])  # its errors: alike for all scans of a window


class Belief(NamedTuple):
    """A pose (3,) in `map` and its covariance (3, 3) in the map's axes."""

    pose: FloatArray
    P: FloatArray


class LagPlaced(NamedTuple):
    """The final pose (3,) of a row in `map`, and its covariance (3, 3) in the machine's axes."""

    row: int
    pose: FloatArray
    covariance: FloatArray


class LagStep(NamedTuple):
    """A scan: its row, pose (3,) by odometry, covariance (3, 3) of the step to it, turn by the gyroscope (rad)."""

    row: int
    odometry: FloatArray
    covariance: FloatArray
    turn_rad: float | None = None


class _SinceNode:
    """What came since the newest node: `information` (3, 3) of the map, `covariance` (3, 3) of the way, turn by the gyroscope."""

    def __init__(self) -> None:
        self.information, self.covariance = np.zeros((3, 3)), np.zeros((3, 3))
        self.turn_rad = 0.0


class FixedLag:
    """`take` each scan; what comes back is final. `restart` where the place on the map was lost or found anew."""

    def __init__(self, lag_m: float = _LAG_M) -> None:
        self._lag_m = lag_m
        self._begin()

    def _begin(self) -> None:
        import gtsam

        self._solver = gtsam.BatchFixedLagSmoother(self._lag_m)
        self._nodes: list[int] = []  # keys in the window
        self._odometry: dict[int, FloatArray] = {}
        self._rows: dict[int, list[LagStep]] = {}  # of each node, with those up to the next one
        self._estimates: dict[int, FloatArray] = {}
        self._since = _SinceNode()
        self._travelled_m, self._key = 0.0, -1
        self._last = np.zeros(3)
        self._left_covariance = np.zeros((3, 3))

    def take(self, step: LagStep, before: Belief, after: Belief) -> list[LagPlaced]:
        """Take a scan with the tracker's belief before and after its match (alike where there was none); return what is final."""
        self._since.information = self._since.information + _told(before, after)
        if self._key < 0:
            self._add(step, after, None)
            return []
        moved = se2.between(self._last, step.odometry)
        self._since.covariance = se2.composed_covariance(self._since.covariance, moved, step.covariance)
        self._since.turn_rad += math.nan if step.turn_rad is None else step.turn_rad
        self._travelled_m += math.hypot(moved[0], moved[1])
        self._last = step.odometry
        way = se2.between(self._odometry[self._key], step.odometry)
        if math.hypot(way[0], way[1]) < _NODE_M:
            self._rows[self._key].append(step)
            return []
        return self._add(step, Belief(_measured(before, after), after.P), way)

    @property
    def newest(self) -> FloatArray | None:
        """The newest pose (3,) in `map`, None before the first scan."""
        if self._key < 0:
            return None
        pose: FloatArray = se2.compose(self._estimates[self._key], se2.between(self._odometry[self._key], self._last))
        return pose

    def restart(self) -> list[LagPlaced]:
        """Return what is in the window, and forget it."""
        out = [one for node in self._nodes for one in self._placed(node)]
        self._begin()
        return out

    def _add(self, step: LagStep, told: Belief, way: FloatArray | None) -> list[LagPlaced]:
        """Add a node: the first with a prior, the others tied to the one before and to the map."""
        import gtsam

        graph, values, key = gtsam.NonlinearFactorGraph(), gtsam.Values(), self._key + 1
        if way is None:
            self._left_covariance = _body(told.P, told.pose[2])
            noise = gtsam.noiseModel.Gaussian.Covariance(self._left_covariance)
            graph.add(gtsam.PriorFactorPose2(key, gtsam.Pose2(*told.pose), noise))
            values.insert(key, gtsam.Pose2(*told.pose))
        else:
            covariance = self._since.covariance + np.diag(_LEAST_STEP_STD**2)
            noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
            graph.add(gtsam.BetweenFactorPose2(key - 1, key, gtsam.Pose2(*way), noise))
            values.insert(key, gtsam.Pose2(*se2.compose(self._estimates[key - 1], way)))
            if math.isfinite(self._since.turn_rad):
                turn = gtsam.noiseModel.Diagonal.Sigmas(np.array([_LOOSE_M, _LOOSE_M, _TURN_STD_RAD]))
                graph.add(
                    gtsam.BetweenFactorPose2(key - 1, key, gtsam.Pose2(way[0], way[1], self._since.turn_rad), turn)
                )
            information = _body(self._since.information, told.pose[2]) + _LEAST_INFORMATION * np.eye(3)
            robust = gtsam.noiseModel.mEstimator.Cauchy.Create(_CAUCHY)
            seen = gtsam.noiseModel.Robust.Create(robust, gtsam.noiseModel.Gaussian.Information(information))
            graph.add(gtsam.PriorFactorPose2(key, gtsam.Pose2(*told.pose), seen))
        stamps: Any = gtsam.FixedLagSmootherKeyTimestampMap()
        stamps.insert((key, self._travelled_m))
        self._keep_left(way)
        self._solver.update(graph, values, stamps)
        self._key, self._last, self._odometry[key], self._rows[key] = key, step.odometry, step.odometry, [step]
        self._since = _SinceNode()
        return self._settled()

    def _keep_left(self, way: FloatArray | None) -> None:
        """Note the covariance of the oldest node: it may be about to leave."""
        import gtsam

        if way is None:
            return
        marginals = gtsam.Marginals(self._solver.getFactors(), self._solver.calculateEstimate())
        self._left_covariance = marginals.marginalCovariance(self._nodes[0])

    def _settled(self) -> list[LagPlaced]:
        """Take over the solution; return the rows of the nodes that left the window."""
        found = self._solver.calculateEstimate()
        inside = list(found.keys())
        for key in inside:
            pose = found.atPose2(key)
            self._estimates[key] = np.array([pose.x(), pose.y(), pose.theta()])
        gone = [node for node in self._nodes if node < inside[0]]
        out = [one for node in gone for one in self._placed(node)]
        for node in gone:
            del self._estimates[node], self._odometry[node], self._rows[node]
        self._nodes = inside
        return out

    def _placed(self, node: int) -> list[LagPlaced]:
        """Return the rows from a node to the next one, moved as both are."""
        here = se2.compose(self._estimates[node], se2.inverse(self._odometry[node]))
        after = node + 1 if node + 1 in self._estimates else node
        there = se2.compose(self._estimates[after], se2.inverse(self._odometry[after]))
        whole_m = math.hypot(*(self._odometry[after] - self._odometry[node])[:2])
        out = []
        for step in self._rows[node]:
            first, second = se2.compose(here, step.odometry), se2.compose(there, step.odometry)
            share = min(math.hypot(*(step.odometry - self._odometry[node])[:2]) / whole_m, 1.0) if whole_m else 0.0
            mixed = first + share * (second - first)
            mixed[2] = first[2] + share * float(se2.wrap(second[2] - first[2]))
            out.append(LagPlaced(step.row, mixed, self._left_covariance + _OF_THE_MAP))
        return out


def placed_row(row: LocalizationRow, placed: LagPlaced, placer: Placer) -> LocalizationRow:
    """Return a row at its final pose."""
    x, y, yaw = placed.pose.tolist()
    place = placer.at(placed.pose, row.z_m, 1.0)
    along, across, heading = np.sqrt(np.maximum(np.diag(placed.covariance), 0.0)).tolist()
    return row._replace(
        node=place.node,
        rho_m=place.rho_m,
        lateral_m=place.lateral_m,
        heading_rad=place.heading_rad,
        x_m=x,
        y_m=y,
        yaw_rad=math.remainder(yaw, 2.0 * math.pi),
        std_along_m=along,
        std_across_m=across,
        std_heading_rad=heading,
    )


def _told(before: Belief, after: Belief) -> FloatArray:
    """Return the information (3, 3) that a match added, in the map's axes; what it took away counts as none."""
    if np.array_equal(before.P, after.P):
        return np.zeros((3, 3))
    gained = np.linalg.inv(after.P) - np.linalg.inv(before.P)
    values, vectors = np.linalg.eigh(0.5 * (gained + gained.T))
    told: FloatArray = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return told


def _measured(before: Belief, after: Belief) -> FloatArray:
    """Return the pose (3,) that a match alone would have said, where it said something."""
    information = _told(before, after)
    moved = after.pose - before.pose
    moved[2] = float(se2.wrap(moved[2]))
    shift = np.linalg.pinv(information, rcond=1e-3, hermitian=True) @ np.linalg.solve(before.P, moved)
    out: FloatArray = after.pose + shift
    return out


def _body(information: FloatArray, heading_rad: float) -> FloatArray:
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    out: FloatArray = R.T @ information @ R
    return out
