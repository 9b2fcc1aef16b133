"""Poses that tests share: the corners of Table 2, and random poses of the workspace."""

from __future__ import annotations

import math

import numpy as np
from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.kinematics import pose_of_theta
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.rockbreaker.orientation import unwrapped

NL = np.array([2.20, 2.15, -1.0, math.radians(270.0)])
NR = np.array([2.20, -2.15, -1.0, math.radians(270.0)])
FL = np.array([6.27, 2.15, -1.0, math.radians(293.6)])
FR = np.array([6.27, -2.15, -1.0, math.radians(293.6)])
ENDS = {"T1": (NL, FR), "T2": (FR, NL), "T3": (NL, FL), "T4": (FL, NL), "T5": (NL, NR), "T6": (FL, FR)}


def random_poses(machine: Rockbreaker, count: int, seed: int) -> FloatArray:
    """Return poses (count, 4) before the machine, within all limits; the arm does not reach back over the post."""
    rng = np.random.default_rng(seed)
    low, high = machine.theta_limits
    poses = np.zeros((0, 4))
    while len(poses) < count:
        theta = rng.uniform(low, high, (4 * count, 4))
        found = pose_of_theta(machine, theta)
        ahead = np.abs(np.arctan2(found[:, 1], found[:, 0]) - theta[:, 0]) < 1e-9
        poses = np.concatenate([poses, found[ahead]])
    poses = poses[:count]
    poses[:, 3] = unwrapped(machine, poses[:, 3])
    return poses
