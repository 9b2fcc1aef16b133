"""The two steps of the paper from a cloud to a rock: straight up or down to the work plane, then level to above the rock."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from lhdmap.rockbreaker.cylinders import rho_of_theta
from lhdmap.rockbreaker.flow import least_duration_s
from lhdmap.rockbreaker.plan import Plan, Planner, Request
from lhdmap.rockbreaker.rocks import Rock, Scene

_LEVEL_M = 0.01  # nearer to the work plane there is no step to it


@dataclass(frozen=True, slots=True)
class Task:
    """The steps that were planned (the last one may be refused), the rock, why that one, and the height of the work plane."""

    steps: tuple[Plan, ...]
    rock: Rock
    why: str
    work_plane_m: float

    @property
    def feasible(self) -> bool:
        """Whether both steps can be made."""
        return all(step.trajectory is not None for step in self.steps)

    @property
    def bound_s(self) -> float:
        """The any-path bound from the first pose to the last, seconds: less than the steps' together. NaN: a step is refused."""
        first, last = self.steps[0].trajectory, self.steps[-1].trajectory
        if first is None or last is None:
            return math.nan
        begin, end = first.path.theta(np.array([0.0])), last.path.theta(np.array([1.0]))
        machine = first.path.machine
        return least_duration_s(machine, rho_of_theta(machine, begin)[0], rho_of_theta(machine, end)[0])


def plan_to_rock(planner: Planner, scene: Scene, request: Request, opening_m: float) -> Task | None:
    """Plan from the request's start to above the largest oversize rock that can be reached; None: there is no oversize rock.

    `request.end_m` is not used. The work plane lies above the highest rock of all, not only of the oversize ones.
    """
    oversize = scene.oversize(opening_m)
    if not oversize:
        return None
    work_plane_m = max(float(rock.top_m[2]) for rock in scene.rocks) + planner.settings.clearance_m
    tasks: list[Task] = []
    for rock in oversize:
        steps = _steps(planner, request, rock, work_plane_m)
        tasks.append(Task(steps, rock, _why(rock, oversize, opening_m, len(tasks)), work_plane_m))
        if tasks[-1].feasible:
            return tasks[-1]
    return tasks[0]


def _steps(planner: Planner, request: Request, rock: Rock, work_plane_m: float) -> tuple[Plan, ...]:
    above_start = np.array([*request.start_m[:2], work_plane_m])
    above_rock = np.array([*rock.top_m[:2], work_plane_m])
    steps: list[Plan] = []
    if abs(request.start_m[2] - work_plane_m) > _LEVEL_M:
        steps.append(planner.plan(replace(request, end_m=above_start, phi_to=np.nan, path="cslm")))
        if steps[-1].trajectory is None:
            return tuple(steps)
    begin, phi = (above_start, steps[-1].phi_to) if steps else (request.start_m, request.phi_from)
    last = planner.plan(replace(request, start_m=begin, end_m=above_rock, phi_from=phi))
    return (*steps, last)


def _why(rock: Rock, oversize: tuple[Rock, ...], opening_m: float, passed_over: int) -> str:
    """Return in words which rock was chosen."""
    rank = "the only oversize rock" if len(oversize) == 1 else f"the largest of {len(oversize)} oversize rocks"
    size = f"{rock.length_m:.2f} x {rock.width_m:.2f} m, {rock.height_m:.2f} m high"
    text = f"{size}: it does not fall through {opening_m:.2f} m; {rank}"
    return text + (f" that can be reached ({passed_over} larger cannot)" if passed_over else "")
