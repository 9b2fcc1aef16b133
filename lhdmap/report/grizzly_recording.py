"""The work at a grizzly in a Rerun recording: the arm, the rocks as they were seen last, blows, flows over time.

Entities: `map/arm/…`, `map/grizzly`, `map/rocks`, `map/cloud`, `map/tip` (the way of the tip), `map/blow`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lhdmap.report.recording import RecordingWriter
from lhdmap.report.recording_end import rerun
from lhdmap.report.rockbreaker_recording import add_arm, bar_lines
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.rockbreaker.story import Look, Story
from lhdmap.rockbreaker.table import COLUMNS

CURVES = (("Rocks too large", ("rocks/**",)), ("Flow over its limit", ("flow/**",)), ("Tip, m", ("tip/**",)))
_COLOURS = (0x2F86C9FF, 0xE69F00FF, 0x009E73FF, 0xD55E00FF, 0xCC79A7FF)
_LARGE, _SMALL, _WAY = 0xD55E00FF, 0x8A949EFF, 0x2F86C9FF
_NEAR_M = (-0.6, 2.5)  # of the cloud what is so high over the bars is drawn
_BLOW_S = 1.0


def write_grizzly_recording(path: Path, title: str, machine: Rockbreaker, story: Story) -> None:
    """Write a `.rrd` file of a run that moved at least once."""
    rr = rerun()
    rows = story.table()
    rows[:, 0] += story.began_s
    with RecordingWriter(path, title, 0) as writer:
        writer.layout.curves = CURVES
        add_arm(writer, machine, rows)
        bars = bar_lines(machine, story.looks[0].scene if story.looks else None)
        writer.add_shape("map/grizzly", rr.LineStrips3D(bars, colors=_SMALL, radii=0.03))
        writer.widen(np.concatenate(bars))
        for look in story.looks:
            _add_look(writer, look)
        way = rr.LineStrips3D([one.way_m for one in story.moves], colors=_WAY, radii=rr.Radius.ui_points(1.2))
        writer.add_shape("map/tip", way)
        for stop in story.stops:
            at_ns = round(1e9 * stop.at_s)
            point = rr.Points3D([stop.rock.top_m], colors=_LARGE, radii=0.08, labels=[stop.outcome], show_labels=True)
            writer.add_at(at_ns, "map/blow", point)
            writer.add_at(at_ns + round(1e9 * _BLOW_S), "map/blow", rr.Clear(recursive=False))
            writer.add_text(f"blow: {stop.outcome}", at_ns, "INFO")
        stamps = np.round(1e9 * rows[:, 0]).astype(np.int64)
        for group, names in (("flow", ("q1", "q2", "q3", "q4", "qp")), ("tip", COLUMNS[12:15])):
            for name, colour in zip(names, _COLOURS, strict=False):
                writer.add_curve(f"{group}/{name}", stamps, rows[:, COLUMNS.index(name)], colour, name)
        looks_ns = np.array([round(1e9 * look.at_s) for look in story.looks], dtype=np.int64)
        left = np.array([len(look.oversize) for look in story.looks], dtype=np.float64)
        writer.add_steps("rocks/oversize", looks_ns, left, _LARGE, "as seen")
        writer.explain("orange rock", "to be broken, as seen last")
        writer.explain("grey rock", "falls through")
        writer.explain("blue line", "way of the tip")


def _add_look(writer: RecordingWriter, look: Look) -> None:
    """Add rocks and cloud as they were seen at a time."""
    rr = rerun()
    at_ns, rocks = round(1e9 * look.at_s), look.scene.rocks
    large = {tuple(np.round(one.top_m[:2], 1)) for one in look.oversize}
    colours = [_LARGE if tuple(np.round(one.top_m[:2], 1)) in large else _SMALL for one in rocks]
    half = [[0.5 * one.length_m, 0.5 * one.length_m, 0.5 * one.height_m] for one in rocks]
    middles = [one.top_m - [0.0, 0.0, 0.5 * one.height_m] for one in rocks]
    writer.add_at(at_ns, "map/rocks", rr.Ellipsoids3D(centers=middles, half_sizes=half, colors=colours))
    a, b, c = look.scene.plane
    above_m = look.points_m[:, 2] - a - look.points_m[:, :2] @ np.array([b, c])
    near = look.points_m[(above_m > _NEAR_M[0]) & (above_m < _NEAR_M[1])]
    writer.add_at(at_ns, "map/cloud", rr.Points3D(near, colors=_SMALL, radii=rr.Radius.ui_points(1.2)))
