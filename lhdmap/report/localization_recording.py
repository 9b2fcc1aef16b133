"""The recording of a localization: the machine on the map, its newest scan, how sure it is, what the searches found.

Entities: `map/walls`, `map/topology/…`, `map/changes/…`, `map/base_link/…` (the machine, where it has a place),
`map/uncertainty` (ellipse), `map/candidates` (places of the newest search), `map/scan/…`, `motion/…`, `state/…`, `log`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lhdmap.geometry import se3
from lhdmap.localization.rows import CANDIDATE, LOST, TRACKING, UNKNOWN, LocalizationRow
from lhdmap.localization.search import Search
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.report.localization_data import LocalizationData
from lhdmap.report.recording import RecordingWriter
from lhdmap.report.recording_end import rerun
from lhdmap.report.recording_layout import Curves
from lhdmap.report.recording_settings import PathStyle
from lhdmap.report.topology_recording import add_topology
from lhdmap.trajectory import Trajectory

CURVES: Curves = (
    ("Standard deviation, mm and mrad", ("deviation/**",)),
    ("Probability of the place", ("place/probability",)),
    ("Status: 0 unknown, 1 candidate, 2 lost, 3 tracking", ("state/status",)),
    ("Latency, ms", ("latency",)),
)
_BLUE, _ORANGE, _GREEN, _RED, _PINK, _GREY = 0x2F86C9FF, 0xE69F00FF, 0x009E73FF, 0xD55E00FF, 0xCC79A7FF, 0x8A949EFF
_STEPS = {UNKNOWN: 0.0, CANDIDATE: 1.0, LOST: 2.0, TRACKING: 3.0}
_PATH = PathStyle("where it was tracked", "blue", _BLUE, 0.5)
_CURVES = (
    ("deviation/along", "std_along_m", 1e3, _BLUE, "along, mm"),
    ("deviation/across", "std_across_m", 1e3, _ORANGE, "across, mm"),
    ("deviation/heading", "std_heading_rad", 1e3, _GREEN, "heading, mrad"),
    ("place/probability", "probability", 1.0, _PINK, "probability"),
    ("latency", "latency_ms", 1.0, _GREY, "latency, ms"),
)
_SIGMAS = 30.0  # deviations of centimetres would not be seen
_EVERY_NS = 500_000_000
_CIRCLE = np.linspace(0.0, 2.0 * math.pi, 25)
_MOST_ROWS, _MOST_WALLS = 20_000, 400_000
_ABOVE_M, _MACHINE_M = 0.3, 3.0


def record_localization(writer: RecordingWriter, data: LocalizationData, machine: Machine) -> None:
    """Record all that a finished run knows; its scans are in `writer` already."""
    writer.layout.curves = CURVES
    _add_map(writer, data)
    placed = [row for row in data.rows if row.status != UNKNOWN and math.isfinite(row.x_m)]
    if placed:
        _add_machine(writer, placed, data, machine)
        _add_ellipses(writer, placed)
    _add_candidates(writer, data.searches)
    rows = data.rows[:: max(len(data.rows) // _MOST_ROWS, 1)]
    stamps = np.array([row.stamp_ns for row in rows], dtype=np.int64)
    for entity, name, scale, rgba, label in _CURVES:
        values = scale * np.array([getattr(row, name) for row in rows])
        known = np.isfinite(values)
        if known.any():
            writer.add_curve(entity, stamps[known], values[known], rgba, label)
    writer.add_steps("state/status", stamps, np.array([_STEPS[row.status] for row in rows]), _RED, "status")
    for one in data.episodes:
        place = f" in {one.node} at {one.rho_m:.1f} m" if one.node and math.isfinite(one.rho_m) else ""
        seconds = (one.to_ns - one.from_ns) * 1e-9
        writer.add_text(f"{one.kind}{place} for {seconds:.1f} s: {one.why}", one.from_ns)
    for text in data.warnings:
        writer.add_text(text)


def _add_map(writer: RecordingWriter, data: LocalizationData) -> None:
    rr = rerun()
    if len(data.walls):
        walls = data.walls[:: max(len(data.walls) // _MOST_WALLS, 1)] + np.array([0.0, 0.0, 1.0])
        writer.add_shape("map/walls", rr.Points3D(walls, colors=_GREY, radii=rr.Radius.ui_points(1.0)))
        writer.explain("grey points", "walls of the map")
        writer.widen(walls)
    add_topology(writer, data.topology)
    if data.changes:
        at = np.array([one.at_m for one in data.changes]) + np.array([0.0, 0.0, 2.0])
        labels = [f"{one.kind}, {one.length_m:.1f} m" for one in data.changes]
        marks = rr.Points3D(at, colors=_RED, radii=rr.Radius.ui_points(7.0), labels=labels, show_labels=True)
        writer.add_shape("map/changes", marks)
        writer.explain("red balls", "what is not as in the map")


def _add_machine(
    writer: RecordingWriter, placed: Sequence[LocalizationRow], data: LocalizationData, machine: Machine
) -> None:
    stamps = np.array([row.stamp_ns for row in placed], dtype=np.int64)
    positions = np.array([[row.x_m, row.y_m, row.z_m] for row in placed])
    zero = np.zeros(len(placed))
    quaternions = se3.quaternions_from_rpy(zero, zero, np.array([row.yaw_rad for row in placed]))
    writer.add_moving("map/base_link", stamps, positions, quaternions)
    writer.add_bodies(machine)
    if data.articulation is not None:
        writer.add_joint(data.articulation.stamps_ns, data.articulation.angle_rad, machine)
    else:
        writer.add_joint(stamps[:1], np.zeros(1), machine)
    tracked = np.array([row.status == TRACKING for row in placed])
    if tracked.any():
        writer.add_path("tracked", Trajectory(stamps[tracked], positions[tracked], quaternions[tracked]), _PATH)


def _add_ellipses(writer: RecordingWriter, placed: Sequence[LocalizationRow]) -> None:
    """Record how sure the place is, twice a second."""
    rr = rerun()
    next_ns = 0
    for row in placed:
        if row.stamp_ns < next_ns or not math.isfinite(row.std_along_m):
            continue
        next_ns = row.stamp_ns + _EVERY_NS
        writer.add_at(row.stamp_ns, "map/uncertainty", rr.LineStrips3D([ellipse(row)], colors=_PINK))
    writer.explain("pink ellipse", f"{_SIGMAS:.0f} standard deviations of the place")


def ellipse(row: LocalizationRow) -> FloatArray:
    """Return the ellipse (N, 3) of a row's deviations in `map`, many times as large so that it is seen."""
    along, across = _SIGMAS * row.std_along_m * np.cos(_CIRCLE), _SIGMAS * row.std_across_m * np.sin(_CIRCLE)
    c, s = math.cos(row.yaw_rad), math.sin(row.yaw_rad)
    x, y = row.x_m + c * along - s * across, row.y_m + s * along + c * across
    return np.column_stack([x, y, np.full(len(x), row.z_m + _ABOVE_M)])


def _add_candidates(writer: RecordingWriter, searches: Sequence[Search]) -> None:
    """Record the places of each search with their probabilities, until the next one; and why none was believed."""
    rr = rerun()
    for said in searches:
        if said.candidates:
            at = np.array([[*one.pose[:2], one.height_m + 2.0 * _ABOVE_M] for one in said.candidates])
            ahead = np.array([[math.cos(one.pose[2]), math.sin(one.pose[2]), 0.0] for one in said.candidates])
            labels = [f"{100 * one.probability:.0f} %" for one in said.candidates]
            colours = [_ORANGE if said.refused or k else _GREEN for k in range(len(at))]
            arrows = rr.Arrows3D(
                origins=at, vectors=_MACHINE_M * ahead, colors=colours, labels=labels, show_labels=True,
                radii=rr.Radius.ui_points(2.5),
            )  # fmt: skip
            writer.add_at(said.stamp_ns, "map/candidates", arrows)
        if said.purpose == "find":
            found = said.refused or "believed, on trial now"
            writer.add_text(f"search over {said.window_m:.0f} m: {found}", said.stamp_ns, "INFO")
    if searches:
        writer.explain(
            "orange arrows", "places that the newest search finds, with their probabilities; green: believed"
        )
