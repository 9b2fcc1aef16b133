"""What a `Localizer` takes from the odometry: its steps with what they may be off, and the hits that are matched with the map."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.localization.method import Wheels
from lhdmap.localization.settings import LocalizationSettings
from lhdmap.messages import FloatArray
from lhdmap.odometry.anchored.rear_view import behind
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.steps import OdometryStep
from lhdmap.pipeline.mapping import MappingPipeline

_GUESSED = np.array([0.5, 0.1, 0.1])  # m/s, m/s, rad/s: a step that neither walls nor wheels told


class FromOdometry:
    """`motion` over a step, `hits` of a scan."""

    def __init__(self, pipeline: MappingPipeline, settings: LocalizationSettings, floor_m: float) -> None:
        self._pipeline, self._settings, self._floor_m = pipeline, settings, floor_m
        self._was_lost = False

    def motion(self, moved: FloatArray, step: OdometryStep, since_ns: int) -> tuple[FloatArray, FloatArray, Wheels]:
        """Return the motion (3,) over a step, its covariance (3, 3), and the wheels' motion over it, `since_ns` on.

        `moved` (3,) by the odometry. Where a scan could not be placed it is the wheels' own, as sure as these are, or a guess:
        scans that came late or stood still carry an odometry away, and back again with the first that fits.
        """
        covariance = step.error.covariance if step.processed else np.zeros((3, 3))
        dt_s = (step.time_ns - since_ns) * 1e-9
        motion = self._pipeline.front_end.wheels.motion_between(since_ns, step.time_ns)
        lost, self._was_lost = step.lost or self._was_lost, step.lost
        if lost:
            covariance = covariance + (np.diag((_GUESSED * dt_s) ** 2) if motion is None else motion.covariance)
            moved = moved if motion is None or motion.source == "tachometer" else motion.delta
        if motion is None:
            return moved, covariance, Wheels(dt_s, math.nan, math.nan)
        forward_m = math.copysign(math.hypot(motion.delta[0], motion.delta[1]), motion.delta[0])
        turn_rad = math.nan if motion.source == "tachometer" else float(motion.delta[2])
        return moved, covariance, Wheels(dt_s, forward_m, turn_rad)

    def hits(self, step: OdometryStep, odometry: PlanarOdometry, *, well_held: bool) -> tuple[FloatArray, int]:
        """Return hits (N, 2) of both scanners near the machine, thinned, and how many are the front one's."""
        parts, rear = [], odometry.points_behind
        if not len(rear) or not len(
            odometry.points
        ):  # where nothing tilts, or the front one is blind, it has no use for it
            view = self._pipeline.front_end.behind_at(step.time_ns)
            rear = rear if view is None else behind(view, step.velocity, 0.0, self._floor_m, self._settings.hits).points
        most = self._settings.hits * (1 if well_held else 2)  # smooth walls tell a little with each hit
        for points in (odometry.points, rear):
            near = points[np.hypot(points[:, 0], points[:, 1]) < self._settings.range_m, :2]
            parts.append(near[:: max(-(-2 * len(near) // most), 1)])
        return np.concatenate(parts), len(parts[0])
