"""A route as it is told: the states that the machine passes, when and where, what stands in its way, what lost against it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from itertools import groupby
from typing import Any, Literal

from lhdmap.movement.rules import Name
from lhdmap.movement.ways import Why

Gear = Literal["forward", "reverse"]


@dataclass(frozen=True, slots=True)
class Step:
    """A state on a route: of `point` (id) in `node` (id), `at_m` and `at_s` from the start.

    `gear`: that in which the machine leaves (at the goal, in which it has come). `inversion`: it changes gear at this stop;
    `turn`: it turns round here before it goes on, in a turning bay.
    """

    point: str
    state: Name
    node: str
    gear: Gear
    stop: bool
    at_m: float
    at_s: float
    inversion: bool = False
    turn: bool = False


@dataclass(frozen=True, slots=True)
class Block:
    """A way that cannot be used: between two points (ids), in a node (id) or between two, why, and what is known of it."""

    start: str
    end: str
    node: str
    why: Why
    text: str = ""


@dataclass(frozen=True, slots=True)
class Alternative:
    """Another way, by its nodes (ids), and why it lost; `blocked_by` what it cannot pass."""

    nodes: tuple[str, ...]
    distance_m: float
    time_s: float
    inversions: int
    lost: str
    blocked_by: tuple[Block, ...] = ()


@dataclass(frozen=True, slots=True)
class Route:
    """A movement sequence, or why there is none.

    `start_heading` and `goal_heading`: `along` or `against` the first and the last point's. `other_heading`: what it would be
    with the other heading at the start, where that was not given.
    """

    feasible: bool
    reason: str
    distance_m: float = 0.0
    time_s: float = 0.0
    inversions: int = 0
    turns: int = 0
    states: tuple[Step, ...] = ()
    start_heading: str | None = None
    goal_heading: str | None = None
    other_heading: str = ""
    blocked_by: tuple[Block, ...] = ()
    alternatives: tuple[Alternative, ...] = field(default=())

    @property
    def nodes(self) -> tuple[str, ...]:
        """The nodes (ids) in the order in which they are passed; one that is touched at its edge alone, for a stop, is none."""
        visits = [
            (node, {step.point for step in steps}) for node, steps in groupby(self.states, lambda step: step.node)
        ]
        inside = [node for k, (node, points) in enumerate(visits) if len(points) > 1 or k in (0, len(visits) - 1)]
        return tuple(node for node, _ in groupby(inside))


def route_json(route: Route) -> dict[str, Any]:
    """Return the object that `lhdmap route --json` prints (contract: topology); no distance and no time without a route."""
    values = asdict(route)
    for step in values["states"]:
        step["at_m"], step["at_s"] = round(step["at_m"], 3), round(step["at_s"], 3)
    for part in (values, *values["alternatives"]):
        part["distance_m"], part["time_s"] = round(part["distance_m"], 3), round(part["time_s"], 3)
    if not route.feasible:
        values |= {"distance_m": None, "time_s": None, "inversions": None, "turns": None}
    return values
