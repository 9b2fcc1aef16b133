"""Paths of loading for guidance: to the axis of the pile and along it, and back by the way the machine came."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.driving.lead import Lead
from lhdmap.driving.motion import Motion
from lhdmap.geometry import se2
from lhdmap.guidance.directive import WAY, path_of
from lhdmap.loading.moment import Moment, Target, pose_of
from lhdmap.messages import FloatArray

_BEHIND_M, _BEYOND_M, _JOIN_M = 4.0, 12.0, 3.0
_STEP_M = 0.1
_AT_PILE_M = 2.0  # before the line through the limits: hits there are the pile's
_FREE_M = 1.0  # of walls beside the axle's way: less than half a machine, for guidance keeps off them by itself


def approach_path(motion: Motion, target: Target, before_m: float, speed_mps: float) -> FloatArray:
    """Return the path (N, 6) in `odom` of the front axle: on to the pile's axis before a place, along it through the pile.

    `before_m`: how far before the pile's middle the front axle is to be on the axis. It begins behind the machine, as guidance
    wants it.
    """
    pose = pose_of(motion)
    ahead = np.array([math.cos(pose[2]), math.sin(pose[2])])
    axis = np.array([math.cos(target.heading_rad), math.sin(target.heading_rad)])
    middle = target.limits_m.mean(axis=0)
    left_m = float((middle - pose[:2]) @ axis) - before_m
    join = middle - axis * (before_m if left_m > _JOIN_M else before_m + left_m - _JOIN_M)
    begin = pose[:2] - _BEHIND_M * ahead
    back = np.linspace(begin, pose[:2], round(_BEHIND_M / _STEP_M), endpoint=False)
    pull = float(np.hypot(*(join - pose[:2])))
    t = np.linspace(0.0, 1.0, max(round(pull / _STEP_M), 2), endpoint=False)[:, None]
    curve = (
        (2 * t**3 - 3 * t**2 + 1) * pose[:2]
        + (t**3 - 2 * t**2 + t) * pull * ahead
        + (-2 * t**3 + 3 * t**2) * join
        + (t**3 - t**2) * pull * axis
    )
    end = middle + _BEYOND_M * axis
    straight = np.linspace(join, end, max(round(float(np.hypot(*(end - join))) / _STEP_M), 2))
    return path_of(np.vstack([back, curve, straight]), speed_mps)


def is_free(path: FloatArray, moment: Moment, target: Target) -> bool:
    """Return whether no wall that is seen now is in the way of a path (N, 6) in `odom`, from the machine up to the pile."""
    pose = pose_of(moment.motion)
    axis = np.array([math.cos(target.heading_rad), math.sin(target.heading_rad)])
    before = (path[:, :2] - target.limits_m.mean(axis=0)) @ axis < -_AT_PILE_M
    ahead = path[before & (path[:, WAY] > _BEHIND_M), :2]
    if not len(ahead) or not len(moment.walls_m):
        return True
    apart = ahead[:, None] - se2.transform(pose, moment.walls_m)[None]
    return float((apart**2).sum(axis=2).min()) > _FREE_M**2


def back_path(motion: Motion, trail: list[Motion], rear: Lead, way_m: float, speed_mps: float) -> FloatArray:
    """Return the path (N, 6) in `odom` of the rear axle, driving back: by the trail, then straight on.

    `trail`: how the machine came, oldest first.
    """
    places = [np.array(rear.state(one)[:2]) for one in [*trail, motion][::-1]]
    line = [places[0]]
    for place in places[1:]:
        if float(np.hypot(*(place - line[-1]))) > 0.2:
            line.append(place)
    heading = rear.state(motion)[2]
    here = np.array([math.cos(heading), math.sin(heading)])
    on = here
    if len(line) > 3:
        last = line[-1] - line[-4]
        on = last / float(np.hypot(*last))
    begin = line[0] - _BEHIND_M * here
    return path_of(np.vstack([begin, *line, line[-1] + (way_m + _BEYOND_M) * on]), speed_mps)
