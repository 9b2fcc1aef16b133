"""A rockbreaker plan in a Rerun recording: the arm moves over its grizzly, beside flows and cylinders over time.

Entities: `map/arm/…` (links, each in the frame of the one before), `map/tip`, `map/grizzly`, `map/rocks`, `map/cloud`,
`map/boxes`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.report.recording import RecordingWriter
from lhdmap.report.recording_end import rerun
from lhdmap.rockbreaker.collision import Obstacles
from lhdmap.rockbreaker.machine import JOINTS, Rockbreaker
from lhdmap.rockbreaker.plan import Trajectory
from lhdmap.rockbreaker.rocks import Rock, Scene
from lhdmap.rockbreaker.table import COLUMNS

CURVES = (
    ("Flow over its limit", ("flow/**",)),
    ("Cylinders, m", ("cylinder/**",)),
    ("Tip, m", ("tip/**",)),
)
_COLOURS = (0x2F86C9FF, 0xE69F00FF, 0x009E73FF, 0xD55E00FF, 0xCC79A7FF)
_LINKS = (0x8A949EFF, 0xF0C419FF, 0xF0C419FF, 0xD55E00FF)
_WAYS = (("blue", 0x2F86C9FF), ("green", 0x009E73FF))
_AT_TARGET_M = 0.05
_BAR_M = 0.5
_MOST_POINTS = 60_000


def write_plan_recording(
    path: Path, trajectories: Sequence[Trajectory], rows: FloatArray, scene: Scene | None, obstacles: Obstacles
) -> None:
    """Write a `.rrd` file; `rows` are the sampled trajectories, one after the other."""
    machine = trajectories[0].path.machine
    with RecordingWriter(path, "Rockbreaker", 0) as writer:
        writer.layout.curves = CURVES
        add_arm(writer, machine, rows)
        _add_surroundings(writer, machine, scene, obstacles, trajectories[-1].way_m()[-1])
        for number, one in enumerate(trajectories):
            _add_way(writer, number, one.way_m())
        stamps = np.round(1e9 * rows[:, 0]).astype(np.int64)
        for group, names in (
            ("flow", ("q1", "q2", "q3", "q4", "qp")),
            ("cylinder", COLUMNS[7:12]),
            ("tip", COLUMNS[12:15]),
        ):
            for name, colour in zip(names, _COLOURS, strict=False):
                writer.add_curve(f"{group}/{name}", stamps, rows[:, COLUMNS.index(name)], colour, name)


def add_arm(writer: RecordingWriter, machine: Rockbreaker, rows: FloatArray) -> None:
    """Add the links as capsules, and their joints over time."""
    stamps = np.round(1e9 * rows[:, 0]).astype(np.int64)
    half = 0.5 * np.radians(rows[:, 3:7])
    zero = np.zeros(len(rows))
    entity, at_m = "map/arm", np.zeros(3)
    for joint, name in enumerate(JOINTS):
        entity = f"{entity}/{name}"
        about = (zero, zero, np.sin(half[:, 0])) if joint == 0 else (zero, -np.sin(half[:, joint]), zero)
        quaternions = np.column_stack([*about, np.cos(half[:, joint])])
        writer.add_moving(entity, stamps, np.tile(at_m, (len(rows), 1)), quaternions)
        length_m = float(machine.links_m[joint])
        writer.add_shape(f"{entity}/link", _link(machine, joint, length_m))
        at_m = np.array([length_m, 0.0, machine.base.height_m if joint == 0 else 0.0])


def _link(machine: Rockbreaker, joint: int, length_m: float) -> Any:
    """Return a link as a capsule: the swing post upwards, the others along their x axis."""
    rr = rerun()
    post = joint == 0
    return rr.Capsules3D(
        lengths=[max(machine.base.height_m, 0.1) if post else length_m],
        radii=[0.5 * machine.joints[joint].radius_m],
        rotation_axis_angles=[rr.RotationAxisAngle(axis=(0, 1, 0), degrees=0.0 if post else 90.0)],
        colors=_LINKS[joint],
        fill_mode="solid",
    )


def _is_at(rock: Rock, end_m: FloatArray) -> bool:
    return bool(np.hypot(*(rock.top_m - end_m)[:2]) < _AT_TARGET_M)


def _add_surroundings(
    writer: RecordingWriter, machine: Rockbreaker, scene: Scene | None, obstacles: Obstacles, end_m: FloatArray
) -> None:
    """Add grizzly, rocks, cloud and boxes; the rock under the tip's end (3,) is the target."""
    rr = rerun()
    writer.widen(np.array([[0.0, 0.0, machine.base.height_m]]))
    writer.add_shape("map/grizzly", rr.LineStrips3D(bar_lines(machine, scene), colors=0x8A949EFF, radii=0.03))
    if scene is not None and scene.rocks:
        large = [rock.passing_m > machine.grizzly.opening_m for rock in scene.rocks]
        half = [[0.5 * rock.length_m, 0.5 * rock.length_m, 0.5 * rock.height_m] for rock in scene.rocks]
        middles = [rock.top_m - [0.0, 0.0, 0.5 * rock.height_m] for rock in scene.rocks]
        colours = [0xD55E00FF if one else 0x8A949EFF for one in large]
        names = ["target" if _is_at(rock, end_m) else "" for rock in scene.rocks]
        rocks = rr.Ellipsoids3D(centers=middles, half_sizes=half, colors=colours, labels=names, show_labels=True)
        writer.add_shape("map/rocks", rocks)
        writer.explain("orange rock", "does not fall through the grizzly; the target has its name")
        writer.explain("grey rock", "falls through")
    if obstacles.points_m is not None and len(obstacles.points_m):
        seen = _near_grizzly(obstacles.points_m, scene)
        seen = seen[:: max(1, len(seen) // _MOST_POINTS)]
        writer.add_shape("map/cloud", rr.Points3D(seen, colors=0x8A949EFF, radii=rr.Radius.ui_points(1.2)))
        writer.widen(np.percentile(seen, [2.0, 98.0], axis=0))
    if obstacles.boxes_m is not None and len(obstacles.boxes_m):
        low, high = obstacles.boxes_m[:, 0], obstacles.boxes_m[:, 1]
        writer.add_shape(
            "map/boxes", rr.Boxes3D(mins=low, sizes=high - low, colors=0xCC79A7FF, labels=list(obstacles.names))
        )


def _near_grizzly(points_m: FloatArray, scene: Scene | None) -> FloatArray:
    """Return the points around the bars: walls and roof would hide the arm."""
    if scene is None:
        return points_m
    above_m = points_m[:, 2] - scene.plane[0] - points_m[:, :2] @ np.array(scene.plane[1:])
    return np.asarray(points_m[(above_m > -0.6) & (above_m < 1.6)])


def bar_lines(machine: Rockbreaker, scene: Scene | None) -> list[FloatArray]:
    """Return the bars of the grizzly as lines: at the height that was seen, else 1 m below the paper's work plane."""
    low, high = np.array(machine.grizzly.min_m), np.array(machine.grizzly.max_m)
    x = np.linspace(low[0], high[0], max(round((high[0] - low[0]) / _BAR_M), 1) + 1)
    y = np.linspace(low[1], high[1], max(round((high[1] - low[1]) / _BAR_M), 1) + 1)
    lines = [np.array([[one, low[1]], [one, high[1]]]) for one in x] + [
        np.array([[low[0], one], [high[0], one]]) for one in y
    ]
    level = np.array([[scene.height_m(*at) if scene is not None else -2.0 for at in line] for line in lines])
    return [np.column_stack([line, z]) for line, z in zip(lines, level, strict=True)]


def _add_way(writer: RecordingWriter, number: int, way: FloatArray) -> None:
    """Add the way of the tip in one step, with its name."""
    rr = rerun()
    name, (colour, rgba) = f"step {number + 1}", _WAYS[number % len(_WAYS)]
    line = rr.LineStrips3D([way], colors=rgba, radii=rr.Radius.ui_points(2.5), labels=[name], show_labels=True)
    writer.add_shape(f"map/tip/{number}", line)
    writer.explain(f"{colour} line", f"way of the tip, {name}")
    writer.widen(way)
