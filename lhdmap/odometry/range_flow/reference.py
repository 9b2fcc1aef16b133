"""A scan that others are compared with by range flow, and what such a comparison says of the machine's pose."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.motion import PlanarMotion
from lhdmap.odometry.range_flow.flow import flow
from lhdmap.odometry.range_flow.scan import Pyramid
from lhdmap.odometry.settings import RangeFlowSettings
from lhdmap.scan_matching.information import body_information

# Deviations of the prediction below which the finest level alone finds the pose: lines of 8 cm half width reach as far.
_SURE_SIGMA_M, _SURE_SIGMA_RAD = 0.05, math.radians(2.0)
_NO_PRIOR = 1e-3 * np.eye(3)  # 30 m and 30 rad: keeps the equations regular, holds nothing


class FlowReference(NamedTuple):
    """Pose of the scanner in `odom` (3,), its level frame, and its scan's pyramid."""

    pose_odom_scanner: FloatArray
    levels: Pyramid


class FlowPose(NamedTuple):
    """Pose of `base_link` in `odom` (3,) by one comparison, its information (3, 3) in `odom` axes, residual and support."""

    pose: FloatArray
    information: FloatArray
    residual_sigmas: float
    support: float


def scanner_pyramid(points: FloatArray, pose_base_scanner: FloatArray, settings: RangeFlowSettings) -> Pyramid:
    """Return the pyramid of hits (N, 2) in the level base frame as seen from the scanner (planar pose (3,) in that frame)."""
    return Pyramid(se2.transform(se2.inverse(pose_base_scanner), points), settings.width_m, settings.levels)


def compare(
    reference: FlowReference,
    levels: Pyramid,
    pose_base_scanner: FloatArray,
    motion: PlanarMotion,
    noise_m: float,
    settings: RangeFlowSettings,
) -> FlowPose:
    """Return where the scan `levels` says the machine is; the motion gives the start and the coarsest level, no weight."""
    guess = se2.between(reference.pose_odom_scanner, se2.compose(motion.pose, pose_base_scanner))
    sigma = np.sqrt(np.diag(motion.P)[:3])
    sure = sigma[:2].max() < _SURE_SIGMA_M and sigma[2] < _SURE_SIGMA_RAD
    coarsest = 0 if sure else settings.levels - 1
    found = flow(reference.levels, levels, guess, _NO_PRIOR, noise_m, coarsest=coarsest, iterations=settings.iterations)
    pose_scanner_base = se2.compose(found.pose_reference_current, se2.inverse(pose_base_scanner))
    # The flow's unknown is a twist about the reference: turning it moves the machine along an arc, which is undone here.
    J = np.array([[1.0, 0.0, pose_scanner_base[1]], [0.0, 1.0, -pose_scanner_base[0]], [0.0, 0.0, 1.0]])
    information = body_information(J.T @ found.information @ J, -float(reference.pose_odom_scanner[2]))
    pose = se2.compose(reference.pose_odom_scanner, pose_scanner_base)
    return FlowPose(pose, information, found.residual_sigmas, found.support)


def correct_by(motion: PlanarMotion, found: list[FlowPose]) -> FloatArray:
    """Correct the motion by the information-weighted mean of comparisons and its prior; return their information (3, 3)."""
    predicted, prior = motion.pose, motion.prior_information
    total, vector = np.zeros((3, 3)), np.zeros(3)
    for one in found:
        error = one.pose - predicted
        error[2] = se2.wrap(error[2])
        total += one.information
        vector += one.information @ error
    motion.correct(predicted + np.linalg.solve(prior + total, vector), total)
    return total
