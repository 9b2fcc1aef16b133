"""Dense check of a plan, independent of how it was made: from tip and orientation over time, by differences, without Jacobians."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.cylinders import CYLINDER_JOINT, rho_of_theta
from lhdmap.rockbreaker.flow import LIMITS, flows_m3ps, speed_loads
from lhdmap.rockbreaker.kinematics import theta_of_pose
from lhdmap.rockbreaker.machine import JOINTS, Rockbreaker
from lhdmap.rockbreaker.paths import Path
from lhdmap.rockbreaker.timing import TimeLaw

SAMPLES = 20_001
_LENGTH_M, _ANGLE = 1e-6, 1e-6  # what rounding may add


@dataclass(frozen=True, slots=True)
class PathVerdict:
    """What the check found: highest load of the five limits (5,), when each was highest (5,), and what is wrong, if anything."""

    highest: FloatArray
    at_s: FloatArray
    problems: tuple[str, ...]

    @property
    def limiting(self) -> str:
        """Name of the limit that is used most."""
        return LIMITS[int(np.argmax(self.highest))]

    @property
    def limit_reached_at_s(self) -> float:
        """When that limit is used most (first within 0.1 %)."""
        return float(self.at_s[int(np.argmax(self.highest))])


def check(path: Path, law: TimeLaw, *, executable: bool = True, samples: int = SAMPLES) -> PathVerdict:
    """Return the verdict on a timed path; `executable`: must start and end at rest."""
    machine = path.machine
    t = np.linspace(0.0, law.duration_s, samples)
    sigma, rate = law(t)
    theta = theta_of_pose(machine, np.column_stack([path.tip(sigma), path.turning(sigma)[0]]))
    rho = rho_of_theta(machine, theta)
    rho_rates = np.diff(rho, axis=0) / np.diff(t)[:, None]
    loads = flows_m3ps(machine, rho_rates) / machine.flow_limits_m3ps
    problems = [*_beyond_limits(machine, theta, rho), *_overloaded(loads, speed_loads(machine, rho_rates))]
    if np.diff(sigma).min() < -1e-12 or rate.min() < 0.0:
        problems.append("sigma goes back")
    if abs(sigma[0]) > 1e-9 or abs(sigma[-1] - 1.0) > 1e-9:
        problems.append("the path is not run from its start to its end")
    if executable and max(abs(rate[0]), abs(rate[-1])) > 1e-9:
        problems.append("not at rest at its ends")
    highest = loads.max(axis=0)
    return PathVerdict(highest, t[np.argmax(loads >= 0.999 * highest, axis=0)], tuple(problems))


def _beyond_limits(machine: Rockbreaker, theta: FloatArray, rho: FloatArray) -> list[str]:
    if np.isnan(theta).any():
        return ["the tip leaves the arm's reach"]
    low, high = machine.theta_limits
    shortest, longest = (machine.per_joint(name)[CYLINDER_JOINT] for name in ("shortest_m", "longest_m"))
    joints = np.any((theta < low - _ANGLE) | (theta > high + _ANGLE), axis=0)
    strokes = np.any((rho < shortest - _LENGTH_M) | (rho > longest + _LENGTH_M), axis=0)
    problems = [f"joint {name} leaves its limits" for name, bad in zip(JOINTS, joints, strict=True) if bad]
    return problems + [f"cylinder {j} leaves its limits" for j in np.flatnonzero(strokes)]


def _overloaded(loads: FloatArray, speeds: FloatArray) -> list[str]:
    """Return what asks for more than the hydraulics give, loads (N, 5) and speeds of cylinders over their limits (N, 5)."""
    problems = [
        f"{name} at {load:.5f} of its limit"
        for name, load in zip(LIMITS, loads.max(axis=0), strict=True)
        if load > 1.0001
    ]
    return problems + [f"cylinder {j} too fast" for j in np.flatnonzero(speeds.max(axis=0) > 1.0001)]
