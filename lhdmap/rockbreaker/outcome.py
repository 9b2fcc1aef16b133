"""Plans as the values of `lhdmap rockbreaker plan --json`."""

from __future__ import annotations

import math
from typing import Any

from lhdmap.rockbreaker.check import check
from lhdmap.rockbreaker.corridor import Refusal
from lhdmap.rockbreaker.plan import Plan, Request, Trajectory
from lhdmap.rockbreaker.profile import Ramps
from lhdmap.rockbreaker.task import Task

_UNKNOWN = (
    *("duration_s", "t_r_s", "limiting", "limit_reached_at_s", "pump_volume_l", "bound_s", "max_flow_ratio"),
    *("clearance_m", "phi_from_deg", "phi_to_deg", "planning_ms", "csv"),
)


def plan_json(plan: Plan) -> dict[str, Any]:
    """Return a plan with the verdict of the dense check; what does not apply is None."""
    values = _asked(plan.request) | {
        "feasible": plan.trajectory is not None,
        "reason": None if plan.refusal is None else _reason(plan.refusal),
        "phi_from_deg": math.degrees(plan.phi_from) % 360.0,
        "phi_to_deg": math.degrees(plan.phi_to) % 360.0,
        "planning_ms": plan.planning_ms,
    }
    return values if plan.trajectory is None else values | _timed(plan.trajectory)


def _timed(trajectory: Trajectory) -> dict[str, Any]:
    law = trajectory.law
    verdict = check(trajectory.path, law, executable=trajectory.timing != "limit")
    return {
        "duration_s": law.duration_s,
        "t_r_s": law.t_r_s if isinstance(law, Ramps) else None,
        "limiting": verdict.limiting,
        "limit_reached_at_s": verdict.limit_reached_at_s,
        "pump_volume_l": trajectory.pump_volume_l,
        "bound_s": trajectory.bound_s,
        "max_flow_ratio": float(verdict.highest.max()),
        "clearance_m": trajectory.clearance_m if math.isfinite(trajectory.clearance_m) else None,
        "checked": not verdict.problems,
        "problems": list(verdict.problems),
    }


def task_json(task: Task) -> dict[str, Any]:
    """Return a task: durations and volumes of both steps together, the bound of the whole, which rock was chosen and why."""
    steps = [plan_json(plan) for plan in task.steps]
    values = steps[-1] | {"rock": _rock_json(task), "work_plane_m": task.work_plane_m, "steps": steps}
    values |= {"from_m": steps[0]["from_m"], "phi_from_deg": steps[0]["phi_from_deg"]}
    if not task.feasible:
        return values
    at = max(range(len(steps)), key=lambda k: float(steps[k]["max_flow_ratio"]))
    worst, before_s = steps[at], sum(step["duration_s"] for step in steps[:at])
    sums = {key: sum(step[key] for step in steps) for key in ("duration_s", "pump_volume_l", "planning_ms")}
    return (
        values
        | sums
        | {
            "bound_s": task.bound_s,
            "limiting": worst["limiting"],
            "limit_reached_at_s": before_s + worst["limit_reached_at_s"],
            "max_flow_ratio": worst["max_flow_ratio"],
            "clearance_m": min(
                (step["clearance_m"] for step in steps if step["clearance_m"] is not None), default=None
            ),
            "checked": all(step["checked"] for step in steps),
        }
    )


def no_rock_json(request: Request, rocks: int, opening_m: float) -> dict[str, Any]:
    """Return the values of a request for a rock where no rock is oversize."""
    limit = f"{rocks} rocks stand on the grizzly, none of them too large for its openings of {opening_m:.2f} m"
    reason = {"joint": "rock", "limit": limit, "sigma": None, "text": f"no oversize rock: {limit}"}
    return _asked(request) | {"feasible": False, "reason": reason, "rock": None, "steps": []}


def _asked(request: Request) -> dict[str, Any]:
    """Return what was asked for, and None for all that is not known yet."""
    asked = {"path": request.path, "timing": request.timing, "from_m": request.start_m, "to_m": request.end_m}
    return asked | dict.fromkeys(_UNKNOWN) | {"checked": False, "problems": []}


def _reason(refusal: Refusal) -> dict[str, Any]:
    return {"joint": refusal.joint, "limit": refusal.limit, "sigma": refusal.sigma, "text": refusal.text}


def _rock_json(task: Task) -> dict[str, Any]:
    rock = task.rock
    sizes = {"size_m": rock.size_m, "length_m": rock.length_m, "width_m": rock.width_m, "height_m": rock.height_m}
    return {"top_m": rock.top_m, "why": task.why} | sizes
