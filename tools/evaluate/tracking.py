"""Path tracking of both bodies and docking, many runs: `python -m tools.evaluate.tracking --json FOLDER [--part NAME ...]`.

One file a part; `tools.evaluate.tracking_page` makes `evaluation/tracking.md` and its figures of them.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from lhdmap.driving.bodies import Bodies, bodies_of
from lhdmap.driving.model import DriveModel, drive_model
from lhdmap.machine import load_machine
from lhdmap.messages import FloatArray
from lhdmap.resources import resource
from lhdmap.tracking.equations import equilibrium
from lhdmap.tracking.path import beside
from lhdmap.tracking.reference import Curve
from lhdmap.tracking.settings import TrackingSettings
from lhdmap.tracking.tracker import Tracker
from tests.tracking.paths import site, turn
from tests.tracking.plant import CALM, Drive, Errors, Plant, drive, placed

Row = dict[str, Any]
FILES = {"truck": "truck_28t", "LHD": "lhd_11t"}
SPEEDS_KMH = (5, 10, 20, 30, -3, -5, -8)
_FASTER_MPS = 31.0 / 3.6  # the loader's file ends at 24 km/h: the findings drove both at 30
_STILL_MPS = 0.3


def machine(name: str) -> tuple[DriveModel, Bodies]:
    """The model and the bodies of a machine."""
    found = load_machine(resource(f"pipelines/machines/{FILES[name]}.toml"))
    model = drive_model(found)
    return model._replace(top_speed_mps=max(model.top_speed_mps, _FASTER_MPS)), bodies_of(found)


def followed(
    model: DriveModel, rows: FloatArray, kmh: float, errors: Errors, settings: TrackingSettings, waypoints: FloatArray
) -> tuple[Drive, Curve]:
    """A drive of a path from a start on its curve; `rows`: the exact path, `waypoints` (N, 2) in its direction."""
    tracker = Tracker(model, settings)
    curve = tracker.follow(waypoints if kmh > 0 else waypoints[::-1], kmh / 3.6)
    x, y, heading, _, bend, _ = curve.at(curve.from_m).tolist()
    return drive(tracker, Plant(placed(x, y, heading, bend), model, errors), rows, 400.0), curve


def figures(out: Drive, **more: Any) -> Row:
    """RMS and maximum of z0 + z1 and of both offsets, of the part that is driven; whether it arrived."""
    table = out.table()
    moving = table[np.abs(table[:, 6]) > _STILL_MPS]
    if len(moving) == 0:
        return {**more, "arrived": False}
    both = moving[:, 7] + moving[:, 8]
    return {
        **more,
        "arrived": out.arrived,
        "rms": float(np.sqrt(np.mean(both**2))),
        "max": float(np.abs(both).max()),
        "z0": float(np.abs(moving[:, 7]).max()),
        "z1": float(np.abs(moving[:, 8]).max()),
        "top_kmh": float(3.6 * np.abs(moving[:, 6]).max()),
    }


def turns() -> Iterator[Row]:
    """90° turns at each speed: clothoids and steps, five seeds; the other methods once, on clothoids."""
    for name in FILES:
        model, _ = machine(name)
        for kmh in SPEEDS_KMH:
            for step in (False, True):
                rows = turn(kmh / 3.6, step=step)
                for method, seeds in (("both", 5), ("circles", 0 if step else 1), ("paper", 0 if step else 1)):
                    for seed in range(seeds):
                        told = {"machine": name, "kmh": kmh, "step": step, "method": method, "seed": seed}
                        settings = TrackingSettings(method=method)
                        out, _ = followed(model, rows, kmh, Errors(seed=seed), settings, rows[::10, :2])
                        yield figures(out, **told)


def overshoots() -> Iterator[Row]:
    """The joint's overshoot on a curvature step, against Eq. (10): no noise, no slip; and with the reference of Eq. (10)."""
    for name in FILES:
        model, _ = machine(name)
        for kmh in SPEEDS_KMH:
            rows = turn(kmh / 3.6, step=True)
            rest = float(equilibrium(float(rows[:, 3].max()), (model.front_m, model.rear_m))[4])
            for method in ("both", "circles"):
                out, curve = followed(model, rows, kmh, CALM, TrackingSettings(method=method), rows[::10, :2])
                bends = np.abs(out.table()[:, 4])
                more = {"machine": name, "kmh": kmh, "method": method, "over": float(bends.max() / rest - 1.0)}
                yield figures(out, **more, curve_over=float(np.abs(curve.rows[:, 4]).max() / rest - 1.0))


def sites() -> Iterator[Row]:
    """The paper's site, out and back, 30 and 20 km/h; half lane that the bodies sweep."""
    for name, kmh in (("truck", 30.0), ("LHD", 20.0)):
        model, bodies = machine(name)
        for way in ("out", "back"):
            rows = site()
            if way == "back":
                rows = rows[::-1] * np.array([1.0, 1.0, 1.0, -1.0]) + np.array([0.0, 0.0, math.pi, 0.0])
                rows = np.ascontiguousarray(rows)
            for method in ("both", "circles"):
                for seed in range(5 if method == "both" else 2):
                    settings = TrackingSettings(method=method)
                    out, _ = followed(model, rows, kmh, Errors(seed=seed), settings, rows[::10, :2])
                    told = {"machine": name, "way": way, "method": method, "seed": seed}
                    yield figures(out, **told, half_lane_m=swept(out, rows, model, bodies), time_s=out.rows[-1][0])


def swept(out: Drive, rows: FloatArray, model: DriveModel, bodies: Bodies) -> float:
    """The largest distance of a body's outline from the path, m."""
    most, near = 0.0, 0.0
    for state in out.table()[::4, 1:5]:
        x1, y1, back, bend = state.tolist()
        near = beside(rows, x1, y1, near, 8.0, 8.0)[0]
        ahead = back + bend
        x0 = x1 + model.rear_m * math.cos(back) + model.front_m * math.cos(ahead)
        y0 = y1 + model.rear_m * math.sin(back) + model.front_m * math.sin(ahead)
        for x, y, heading, outline in ((x0, y0, ahead, bodies.front_m), (x1, y1, back, bodies.rear_m)):
            c, s = math.cos(heading), math.sin(heading)
            for px, py in outline.tolist():
                off = beside(rows, x + c * px - s * py, y + s * px + c * py, near + px + 2.0, 6.0, 6.0)[1]
                most = max(most, abs(off))
    return most


def dead_times() -> Iterator[Row]:
    """A dead time that is not what the file says."""
    for name in FILES:
        model, _ = machine(name)
        for off in (-0.1, 0.1, 0.2):
            for kmh in (5, 10, 20, 30, -5):
                for seed in range(3):
                    rows = turn(kmh / 3.6)
                    errors = Errors(dead_s=off, seed=seed)
                    out, _ = followed(model, rows, kmh, errors, TrackingSettings(), rows[::10, :2])
                    yield figures(out, machine=name, off=off, kmh=kmh, seed=seed)


def disturbed() -> Iterator[Row]:
    """Slip of 1° on 30 m; waypoints with 2 cm of noise; uneven ones; a machine that is not as told; no slip."""

    def slipping(way_m: float) -> float:
        return math.radians(1.0) if 50.0 < way_m < 80.0 else 0.0

    rng = np.random.default_rng(11)
    for name in FILES:
        model, _ = machine(name)
        for kmh in (10, 20, 30, -5):
            rows = turn(kmh / 3.6)
            exact = rows[::10, :2]
            uneven = rows[np.unique(np.cumsum(rng.choice([3, 8, 25, 40], len(rows))).clip(0, len(rows) - 1)), :2]
            kinds: dict[str, tuple[Errors, FloatArray]] = {
                "no slip": (Errors(slip_per_g=0.0), exact),
                "1 deg of slip on 30 m": (Errors(slip_of=slipping), exact),
                "waypoints off by 2 cm": (Errors(), exact + 0.02 * rng.standard_normal(exact.shape)),
                "waypoints 0.3 to 4 m apart": (Errors(), uneven),
                "front slips three times the rear": (Errors(front_more=0.5), exact),
                "rear slips three times the front": (Errors(front_more=-0.5), exact),
                "rear body 3 % longer than told": (Errors(longer=0.03), exact),
                "steering 5 % weak": (Errors(gain=0.95), exact),
                "steering 5 % strong": (Errors(gain=1.05), exact),
            }
            for kind, (errors, waypoints) in kinds.items():
                for seed in range(2):
                    out, _ = followed(model, rows, kmh, replace(errors, seed=seed), TrackingSettings(), waypoints)
                    yield figures(out, machine=name, kmh=kmh, kind=kind, seed=seed)


def recoveries() -> Iterator[Row]:
    """Back to a straight line from beside it, at speed: offset, heading and joint off to one side or against each other."""
    line = turn(1.0, ends_m=260.0)[:2600]
    for name in FILES:
        model, _ = machine(name)
        for kmh, clip_m in ((30, 0.8), (10, 0.8), (-8, 0.8), (30, 10.0)):
            for aside, turned, bent in ((5, 20, 10), (5, -20, 0), (5, 20, -10), (2, 20, 10), (-5, -20, 10)):
                tracker = Tracker(model, TrackingSettings(clip_m=clip_m))
                tracker.follow(line[::20, :2] if kmh > 0 else line[::-20, :2], kmh / 3.6)
                start = placed(20.0 if kmh > 0 else 200.0, aside, math.radians(turned), math.radians(bent))
                plant = Plant(start, model, Errors(seed=1))
                plant.speed = kmh / 3.6
                out = drive(tracker, plant, line, 400.0)
                table = out.table()
                both = np.abs(table[:, 7] + table[:, 8])
                late = np.flatnonzero(both > 0.4)
                gone = np.abs(np.cumsum(table[:, 6])) * 0.05
                told = {"machine": name, "kmh": kmh, "clip_m": clip_m, "start": (aside, turned, bent)}
                yield {
                    **told, "arrived": out.arrived and bool(both[-40:].max() < 0.3), "after_m": float(gone[late[-1]]),
                    "widest_m": float(np.abs(table[:, 8]).max()),
                }  # fmt: skip


PARTS: dict[str, Callable[[], Iterator[Row]]] = {
    "overshoots": overshoots, "recoveries": recoveries, "sites": sites, "turns": turns, "dead_times": dead_times,
    "disturbed": disturbed,
}  # fmt: skip


def main() -> int:
    """Run parts, each into a file of its own."""
    from tools.evaluate.docking import PARTS as DOCKING

    parts = {**PARTS, **DOCKING}
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, required=True, help="folder of the results")
    parser.add_argument("--part", nargs="*", choices=list(parts), default=list(parts))
    asked = parser.parse_args()
    asked.json.mkdir(parents=True, exist_ok=True)
    for part in asked.part:
        rows = []
        for row in parts[part]():
            rows.append(row)
            (asked.json / f"{part}.json").write_text(json.dumps(rows), encoding="utf-8")
        print(part, len(rows), flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
