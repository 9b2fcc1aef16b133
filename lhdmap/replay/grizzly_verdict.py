"""The verdict on a grizzly: the contract's keys, what was counted, and how far the time is from that of the best order."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.order import best_order, order_s
from lhdmap.rockbreaker.station import Station
from lhdmap.rockbreaker.story import Story

FREE = "free"
_ONE_PLACE_M = 0.3
_HINDSIGHT = 15  # places of blows up to which the best order is found afterwards


@dataclass
class Counts:
    """What is counted while a run goes on: oversize rocks at first and at the end, contacts, what is wrong with plans."""

    rocks: int
    left: int = 0
    contacts: list[dict[str, Any]] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    clearance_m: float = np.inf
    first_order_s: float | None = None


def verdict_of(reason: str, duration_s: float, counts: Counts, story: Story, station: Station) -> dict[str, Any]:
    """Return the values; speeds are those of the tip."""
    moving_s = sum(one.duration_s for one in story.moves)
    level_s = sum(one.duration_s for one in story.moves if one.level)
    way_m = float(sum(np.linalg.norm(np.diff(one.way_m, axis=0), axis=1).sum() for one in story.moves))
    best_s = best_level_s(story, station)
    return {
        "ok": reason == FREE and not counts.left,
        "reason": reason,
        "kind": "grizzly",
        "arrived": not counts.left,
        "contacts": counts.contacts,
        "min_clearance_m": counts.clearance_m if np.isfinite(counts.clearance_m) else None,
        "distance_m": way_m,
        "duration_s": duration_s,
        "mean_speed_kmh": 3.6 * way_m / moving_s if moving_s else 0.0,
        "max_speed_kmh": _fastest_kmh(story),
        "stops": len(story.stops),
        "assists": 0,
        "assist_s": 0.0,
        "faults": [],
        "rocks": counts.rocks,
        "rocks_left": counts.left,
        "blows": len(story.stops),
        "looks": len(story.looks),
        "plans": len(story.moves),
        "plans_invalid": len(counts.problems),
        "moving_s": moving_s,
        "level_s": level_s,
        "first_order_s": counts.first_order_s,
        "best_level_s": best_s,
        "over_best": None if best_s is None else duration_s / (duration_s - level_s + best_s),
    }


def best_level_s(story: Story, station: Station) -> float | None:
    """Return the least time of the level moves over the places of all blows, known afterwards; None: too many to be sure.

    Blows near each other count as one place, so that what was moved between them is over the best.
    """
    places: list[FloatArray] = []
    for stop in story.stops:
        if all(np.hypot(*(stop.rock.top_m - one)[:2]) > _ONE_PLACE_M for one in places):
            places.append(stop.rock.top_m)
    if not places or len(places) > _HINDSIGHT:
        return None
    park_m = station.park_m
    start_s = np.array([station.between_s(park_m, one) for one in places])
    between_s = np.array([[0.0 if a is b else station.between_s(a, b) for b in places] for a in places])
    end_s = np.array([station.between_s(one, park_m) for one in places])
    return order_s(best_order(start_s, between_s, end_s, exact=_HINDSIGHT), start_s, between_s, end_s)


def _fastest_kmh(story: Story) -> float:
    """Return the highest speed of the tip."""
    if not story.rows:
        return 0.0
    rows = story.table()
    step_s, step_m = np.diff(rows[:, 0]), np.linalg.norm(np.diff(rows[:, 12:15], axis=0), axis=1)
    moved = step_s > 1e-3
    return 3.6 * float(np.max(step_m[moved] / step_s[moved], initial=0.0))
