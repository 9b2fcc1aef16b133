"""A loading in Rerun: the bucket as it moves, the pile as perception saw it, signals as curves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.report.loading_data import LoadData
from lhdmap.report.recording import RecordingWriter
from lhdmap.report.recording_end import rerun

_BLUE, _ORANGE, _GREEN, _RED = 0x2F86C9FF, 0xE69F00FF, 0x009E73FF, 0xD55E00FF
_CURVES = (
    ("loading/angles/bucket", "bucket_rad", 1.0, _BLUE, "tilt angle, rad"),
    ("loading/angles/boom", "boom_rad", 1.0, _ORANGE, "lift angle, rad"),
    ("loading/pressure/transmission", "transmission_bar", 1.0, _BLUE, "transmission, bar"),
    ("loading/pressure/lift", "lift_bar", 1.0, _ORANGE, "lift cylinders, bar"),
    ("loading/pressure/tilt", "tilt_bar", 1.0, _GREEN, "tilt cylinder, bar"),
    ("loading/fill/true", "fill_true", 1.0, _ORANGE, "truly in the bucket"),
    ("loading/fill/weighed", "fill", 1.0, _BLUE, "as weighed"),
)
_BUCKET_STEP_S, _BUCKET_RAD = 0.2, 0.005


def add_load(writer: RecordingWriter, load: LoadData, machine: Machine, start_ns: int) -> None:
    """Add curves, the bucket where it moves, and each pile that was seen at the time of it."""
    rr = rerun()
    if not len(load.rows):
        return
    stamps_ns = start_ns + np.round(1e9 * load.column("time_s")).astype(np.int64)
    for entity, column, scale, rgba, name in _CURVES:
        values = scale * load.column(column)
        known = np.isfinite(values)
        if known.any():
            writer.add_curve(entity, stamps_ns[known], values[known], rgba, name)
    _add_bucket(writer, load, machine, stamps_ns)
    for stamp_ns, face_m in load.piles:
        points = rr.Points3D(face_m, colors=_RED, radii=rr.Radius.ui_points(2.5))
        writer.add_at(stamp_ns, "map/pile/face", points)
    if load.piles:
        writer.explain("red points", "face of the pile as perception saw it last")


def _add_bucket(writer: RecordingWriter, load: LoadData, machine: Machine, stamps_ns: Any) -> None:
    rr = rerun()
    before = (math.inf, math.inf)
    half_m = 0.5 * machine.digging.bucket_width_m
    for stamp_ns, row in zip(stamps_ns.tolist(), load.rows[:, [4, 5]].tolist(), strict=True):
        if not all(map(math.isfinite, row)) or max(abs(a - b) for a, b in zip(row, before, strict=True)) < _BUCKET_RAD:
            continue
        before = (row[0], row[1])
        side = outline_m(machine, bucket_rad=row[0], boom_rad=row[1])
        lines = [np.column_stack([side[:, 0], np.full(len(side), y), side[:, 1]]) for y in (-half_m, half_m)]
        strips = rr.LineStrips3D(lines, colors=_ORANGE, radii=rr.Radius.ui_points(2.0))
        writer.add_at(stamp_ns, "map/base_link/bucket", strips)
    writer.explain("orange lines", "boom and bucket by their encoders")


def outline_m(machine: Machine, *, bucket_rad: float, boom_rad: float) -> FloatArray:
    """Return boom and bucket from the side, shape (5, 2): pivot, pin, heel, lip, upper edge (x, z of `base_link`, m)."""
    one = machine.linkage
    arm = one.boom_angle_rad + boom_rad - one.boom_min_rad
    psi = one.bucket_angle_rad + bucket_rad - one.bucket_max_rad + one.boom_to_bucket * (boom_rad - one.boom_min_rad)
    pivot = np.array(one.pivot_m)
    pin = pivot + one.boom_m * np.array([math.cos(arm), math.sin(arm)])
    c, s = math.cos(psi), math.sin(psi)
    turned = np.array([[c, -s], [s, c]])
    corners = [pin + turned @ np.array(corner) for corner in (one.heel_m, one.lip_m, one.top_m)]
    return np.stack([pivot, pin, corners[0], corners[1], corners[2]])
