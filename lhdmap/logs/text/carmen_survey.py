"""One pass over a CARMEN log before it is read: what is in it, what stands for no return, where the lasers sit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lhdmap.errors import InputError
from lhdmap.geometry import se3
from lhdmap.logs.findings import Findings
from lhdmap.logs.text import carmen_lines as lines
from lhdmap.logs.text.lines import text_lines
from lhdmap.messages import Float32Array, FloatArray

Parser = Callable[[list[bytes]], lines.LaserLine]
PARSERS: dict[str, Parser] = {
    "FLASER": lines.flaser,
    "RLASER": lines.flaser,
    "ROBOTLASER1": lines.robotlaser,
    "ROBOTLASER2": lines.robotlaser,
    "RAWLASER1": lines.robotlaser,
    "RAWLASER2": lines.robotlaser,
}
FRAMES = {name: "rear_laser" if name in ("RLASER", "ROBOTLASER2", "RAWLASER2") else "front_laser" for name in PARSERS}
POSES = ("ODOM", "TRUEPOS")
# Lines of programs that corrected the poses (gmapping; a pose graph): such a log has no odometry of its own.
_CORRECTED = ("NEFF", "VERTEX2")

_DEFAULT_MAX_M = 81.82  # SICK LMS: 81.83 m and more are error codes
_CODES_M = 0.081  # how far apart the codes of one scanner are (81.83 to 81.91, 51.09 to 51.16)
_SAMPLED_FIRST, _SAMPLED_EACH, _SAMPLED_MOST = 500, 16, 2000
_MAX_MOUNT_M = 10.0


@dataclass
class CarmenSurvey:
    """What is in the log: counts by keyword, first and last stamp (ns), and what each laser needs to be read."""

    counts: dict[str, int] = field(default_factory=dict)
    start_ns: int | None = None
    end_ns: int | None = None
    corrected: bool = False
    range_max_m: dict[str, float] = field(default_factory=dict)
    no_return_m: dict[str, float] = field(default_factory=dict)
    mounts: dict[str, FloatArray] = field(default_factory=dict)
    first: dict[str, lines.LaserLine] = field(default_factory=dict)
    posed: set[str] = field(default_factory=set)  # lasers whose lines carry a robot pose that changes


def survey(path: Path) -> CarmenSurvey:
    """Read through the log once; broken lines are left to the reader to note."""
    found = CarmenSurvey()
    samples: dict[str, list[Float32Array]] = {}
    offsets_m: dict[str, float] = {}
    for line in text_lines(path, Findings()):
        name = line[: line.find(b" ")].decode("ascii", "replace")
        if name in PARSERS or name in POSES:
            _count(found, name, line, samples)
        elif name in _CORRECTED:
            found.corrected = True
        elif name == "PARAM":
            _parameter(line, offsets_m)
    for name, ranges in samples.items():
        _limits(found, name, np.concatenate(ranges))
        found.mounts[name] = _mount(found.first[name], name, offsets_m)
    return found


def _count(found: CarmenSurvey, name: str, line: bytes, samples: dict[str, list[Float32Array]]) -> None:
    count = found.counts[name] = found.counts.get(name, 0) + 1
    words = line.split()
    try:
        stamp = lines.stamp_of(words[-3]) if len(words) > 3 else 0
        if name in PARSERS and _sampled(count):
            scan = PARSERS[name](words)
            first = found.first.setdefault(name, scan)
            if scan.robot_pose is not None and scan.robot_pose != first.robot_pose:
                found.posed.add(name)
            samples.setdefault(name, []).append(scan.ranges_m)
    except InputError:
        return
    if stamp > 0 and (name in PARSERS or not found.first):
        found.start_ns = stamp if found.start_ns is None else min(found.start_ns, stamp)
        found.end_ns = stamp if found.end_ns is None else max(found.end_ns, stamp)


def _sampled(count: int) -> bool:
    return count <= _SAMPLED_FIRST or (count % _SAMPLED_EACH == 0 and count < _SAMPLED_MOST * _SAMPLED_EACH)


def _parameter(line: bytes, offsets_m: dict[str, float]) -> None:
    words = line.split()
    for frame, parameter in (("front_laser", b"robot_frontlaser_offset"), ("rear_laser", b"robot_rearlaser_offset")):
        if len(words) > 2 and words[1] == parameter:
            try:
                offsets_m[frame] = float(words[2])
            except ValueError:
                continue


def _limits(found: CarmenSurvey, name: str, ranges: Float32Array) -> None:
    """Find the value that stands for "no return" and put the greatest range just below it."""
    finite = ranges[np.isfinite(ranges)]
    stated = found.first[name].max_range_m
    limit = no_return_limit(finite)
    found.range_max_m[name] = min(limit or _DEFAULT_MAX_M, stated or math.inf)
    if limit is not None:
        found.no_return_m[name] = round(float(finite.max()), 3)


def no_return_limit(ranges_m: Float32Array) -> float | None:
    """Return a limit just below the values that a scanner gives where nothing came back, None where there are none.

    Such values are the greatest ones, and far more frequent than the ranges in the metre below them.
    """
    if not len(ranges_m):
        return None
    top = float(ranges_m.max())
    codes = ranges_m[ranges_m >= top - _CODES_M]
    below = np.count_nonzero((ranges_m < top - _CODES_M) & (ranges_m >= top - _CODES_M - 1.0))
    if len(codes) < 20 or len(codes) < 5 * below:
        return None
    return round(float(codes.min()) - 0.005, 4)


def _mount(scan: lines.LaserLine, name: str, offsets_m: dict[str, float]) -> FloatArray:
    """Return T_base_laser, 4 x 4: from the two poses of a scan, else from the offset parameter, at floor height."""
    x, y, yaw = offsets_m.get(FRAMES[name], 0.0), 0.0, math.pi if FRAMES[name] == "rear_laser" else 0.0
    if scan.laser_pose is not None and scan.robot_pose is not None:
        offset = _between(scan.robot_pose, scan.laser_pose)
        if max(map(abs, offset)) > 1e-6 and math.hypot(offset[0], offset[1]) < _MAX_MOUNT_M:
            x, y, yaw = offset
    return se3.from_rpy(0.0, 0.0, yaw, (x, y, 0.0))


def _between(robot: lines.Pose, laser: lines.Pose) -> lines.Pose:
    """Return T_robot_laser (m, m, rad) from two planar poses in one frame (se2.between without loading numba)."""
    dx, dy, c, s = laser[0] - robot[0], laser[1] - robot[1], math.cos(robot[2]), math.sin(robot[2])
    yaw = math.remainder(laser[2] - robot[2], 2.0 * math.pi)
    return c * dx + s * dy, c * dy - s * dx, yaw
