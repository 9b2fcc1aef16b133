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

    def motion(self, step: OdometryStep, since_ns: int) -> tuple[FloatArray, Wheels]:
        """Return the covariance (3, 3) of the odometry's step, and the wheels' motion over it, `since_ns` on.

        Where a scan could not be placed the step is the wheels' own, or a guess, and as sure as these are.
        """
        covariance = step.error.covariance if step.processed else np.zeros((3, 3))
        dt_s = (step.time_ns - since_ns) * 1e-9
        motion = self._pipeline.front_end.wheels.motion_between(since_ns, step.time_ns)
        if step.lost:
            covariance = covariance + (np.diag((_GUESSED * dt_s) ** 2) if motion is None else motion.covariance)
        if motion is None:
            return covariance, Wheels(dt_s, math.nan, math.nan)
        forward_m = math.copysign(math.hypot(motion.delta[0], motion.delta[1]), motion.delta[0])
        turn_rad = math.nan if motion.source == "tachometer" else float(motion.delta[2])
        return covariance, Wheels(dt_s, forward_m, turn_rad)

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
