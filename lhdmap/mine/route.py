"""A route as it is written: `T1,T2,-T3,DP1`, and where a drive begins."""

from __future__ import annotations

from typing import NamedTuple

from lhdmap.errors import UsageError
from lhdmap.machine import Machine
from lhdmap.mine.network import Network
from lhdmap.mine.plan import MinePlan, PlacePlan
from lhdmap.mine.stands import stand_at
from lhdmap.settings import nearest


class Stop(NamedTuple):
    """One element of a route: a drift to drive through or a place to come to, and in which gear (1, -1; 0: either)."""

    name: str
    gear: int


class Start(NamedTuple):
    """Where a machine stands at first: tube, arc length of its front axle (m), which way it faces (1: along, -1: against)."""

    tube: int
    at_m: float
    facing: int


def parse_route(text: str, plan: MinePlan) -> list[Stop]:
    """Return the elements of `T1,T2,-T3,DP1`.

    Raises:
        UsageError: a name is not in the plan.
    """
    known = [drift.name for drift in plan.drifts] + [place.name for place in plan.places]
    stops = []
    for word in (part.strip() for part in text.split(",")):
        name = word.removeprefix("-")
        if name not in known:
            raise UsageError(f"route {text}: '{name}' is no drift or place of mine '{plan.name}'{nearest(name, known)}")
        stops.append(Stop(name, -1 if word.startswith("-") else 1))
    return stops


def start_of(network: Network, machine: Machine, name: str | None) -> Start:
    """Return where a drive begins: at a place, at the start of a drift, or, without a name, where one parks or T1 begins.

    Raises:
        UsageError: the name is not in the plan.
    """
    plan = network.plan
    if name is None:
        park = next((place for place in plan.places if place.kind == "park"), None)
        name = plan.drifts[0].name if park is None else park.name
    place = next((one for one in plan.places if one.name == name), None)
    if place is not None:
        return Start(*stand_at(network, place, machine))
    if name not in [drift.name for drift in plan.drifts]:
        known = [drift.name for drift in plan.drifts] + [one.name for one in plan.places]
        raise UsageError(f"start '{name}' is no drift or place of mine '{plan.name}'{nearest(name, known)}")
    tube = network.tube(name)
    behind = PlacePlan(drift=name, kind="park", side="end", at_m=0.0, name="")
    return Start(*stand_at(network, behind, machine))._replace(tube=tube)
