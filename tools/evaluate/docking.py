"""Docking, many runs: ways from anywhere on an apron, driven; a fixed way with a scattered start."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from time import thread_time

import numpy as np
from lhdmap.docking.planner import plan_dock
from lhdmap.docking.room import room_of
from tests.docking.aprons import SETTINGS, Row, apron, dock_on, docked, rear_of, rocks, start_on

APRONS = {"45 x 40": (45.0, 40.0), "35 x 24": (35.0, 24.0), "35 x 24, two rocks": (35.0, 24.0)}
STARTS, DRIVEN, SCATTERED = 50, 12, 60


def anywhere() -> Iterator[Row]:
    """Ways from anywhere; the first of them driven."""
    from tools.evaluate.tracking import FILES, machine

    for name in FILES:
        model, bodies = machine(name)
        for kind, (width, height) in APRONS.items():
            dock = dock_on(width, height, model, -float(bodies.rear_box_m[0, 0]))
            for k in range(STARTS if "rocks" not in kind else STARTS // 2):
                rng = np.random.default_rng([k, 5])
                blocked = rocks(2 if "rocks" in kind else 0, width, height, rng)
                room = room_of(apron(width, height), model, bodies, SETTINGS.margin_m, blocked)
                start = start_on(room, width, height, model, rng)
                begun = thread_time()
                plan = plan_dock(start, dock, room, model, SETTINGS)
                row: Row = {"machine": name, "apron": kind, "seed": k, "plan_s": thread_time() - begun}
                row |= {
                    "cusps": plan.cusps,
                    "reason": plan.reason,
                    "radius_m": plan.radius_m,
                    "length_m": plan.length_m,
                }
                if plan.legs and k < DRIVEN:
                    bare = room_of(apron(width, height), model, bodies, 0.0, blocked)
                    row |= docked(model, plan, rear_of(start, model), dock, k, bare)
                yield row


def scattered() -> Iterator[Row]:
    """One way with a quarter turn and 6 m straight, from starts beside its own: up to 1 m and 8 degrees, joint 4 degrees."""
    from tools.evaluate.tracking import FILES, machine

    for name in FILES:
        model, bodies = machine(name)
        dock = dock_on(45.0, 40.0, model, -float(bodies.rear_box_m[0, 0]))
        room = room_of(apron(45.0, 40.0), model, bodies, SETTINGS.margin_m)
        for side in (1.0, -1.0):
            course = math.pi if side < 0.0 else 0.0
            start = np.array([dock[0] + side * 16.0, dock[1] - 18.0, course, 0.0])
            plan = plan_dock(start, dock, room, model, SETTINGS)
            for k in range(SCATTERED // 2):
                u = np.random.default_rng([k, 9]).uniform(-1.0, 1.0, 4)
                off = np.array([u[0], u[1], math.radians(8.0) * u[2], math.radians(4.0) * u[3]])
                row = docked(
                    model,
                    plan,
                    rear_of(start, model) + off,
                    dock,
                    100 + k,
                    room_of(apron(45.0, 40.0), model, bodies, 0.0),
                )
                yield {"machine": name, "side": side, "cusps": plan.cusps, "seed": k, **row}


PARTS: dict[str, Callable[[], Iterator[Row]]] = {"scattered": scattered, "anywhere": anywhere}
