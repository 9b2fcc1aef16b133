"""Lines of CARMEN logs to numbers. One message a line; its last three words are ipc time, host and logger time.

`FLASER n r1..rn x y theta odom_x odom_y odom_theta`; `ROBOTLASER1 type start fov res maxrange accuracy remission n
r1..rn m v1..vm laser_x laser_y laser_theta robot_x robot_y robot_theta tv rv forward side turn`; `RAWLASER1` the same
without poses; `ODOM x y theta tv rv accel`; `TRUEPOS true_x true_y true_theta odom_x odom_y odom_theta`. Lengths in
metres, angles in radians, beams from right to left.

FLASER does not state its angles. The SICK scanners of those logs have 181 or 361 beams over 180 degrees, or 401 over 100
(0.25 degrees: the finest setting of an LMS), from the right end on. One beam less leaves out the left end (180: the last
beam at +89 degrees): CARMEN's own quirk, those are the same scanners with the last beam dropped. Of any other number 180
degrees are assumed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.errors import InputError
from lhdmap.messages import Float32Array

Pose = tuple[float, float, float]

_SECOND_NS = 1_000_000_000
_MAX_SECONDS = 9_000_000_000
_FLASER_TAIL, _ROBOTLASER_TAIL, _RAWLASER_TAIL, _POSE_WORDS = 9, 14, 3, 10
_ROBOTLASER_HEAD = 9
_FOV_DEG = {180: 180, 181: 180, 360: 180, 361: 180, 400: 100, 401: 100}  # carmen_laser_guess_fov


class LaserLine(NamedTuple):
    """One scan: angles in rad, ranges in m, shape (n,); `max_range_m` 0 and poses None where the line does not say."""

    stamp_ns: int
    angle_min_rad: float
    angle_increment_rad: float
    fov_rad: float
    max_range_m: float
    ranges_m: Float32Array
    laser_pose: Pose | None
    robot_pose: Pose | None


class PoseLine(NamedTuple):
    """A planar pose (m, rad) with its stamp."""

    stamp_ns: int
    pose: Pose


def stamp_of(word: bytes) -> int:
    """Return seconds with any number of decimals as integer nanoseconds, exact to the last digit.

    Raises:
        InputError: it is no time.
    """
    whole, _, decimals = word.partition(b".")
    if whole.isdigit() and (decimals.isdigit() or not decimals) and len(whole) <= 10:
        return int(whole) * _SECOND_NS + int(decimals[:9].ljust(9, b"0"))
    seconds = _float(word)
    if abs(seconds) > _MAX_SECONDS:
        raise InputError("a time stamp that is no time")
    return round(seconds * 1e9)


def flaser(words: list[bytes]) -> LaserLine:
    """Parse a FLASER or RLASER line; raises InputError where it is broken."""
    count = _count(words, 1, _FLASER_TAIL)
    if count < 2:
        raise InputError("a scan of less than two beams")
    ranges, rest = _floats32(words[2 : 2 + count]), words[2 + count :]
    fov_rad = math.radians(_FOV_DEG.get(count, 180))
    increment = fov_rad / (count if count % 2 == 0 else count - 1)
    poses = _pose(rest[0:3]), _pose(rest[3:6])
    return LaserLine(stamp_of(rest[6]), -fov_rad / 2, increment, fov_rad, 0.0, ranges, *poses)


def has_known_fov(beams: int) -> bool:
    """Return whether FLASER lines of so many beams are those of a scanner that CARMEN knows."""
    return beams in _FOV_DEG


def robotlaser(words: list[bytes]) -> LaserLine:
    """Parse a ROBOTLASER or RAWLASER line; raises InputError where it is broken."""
    with_pose = words[0].startswith(b"ROBOT")
    tail = _ROBOTLASER_TAIL if with_pose else _RAWLASER_TAIL
    count = _count(words, _ROBOTLASER_HEAD - 1, tail + 1)
    end = _ROBOTLASER_HEAD + count
    ranges = _floats32(words[_ROBOTLASER_HEAD:end])
    rest = words[end + 1 + _count(words, end, tail) :]
    start, fov, increment, max_range = (_float(word) for word in words[2:6])
    if count > 1 and increment == 0.0:
        increment = fov / (count - 1)
    poses = (_pose(rest[0:3]), _pose(rest[3:6])) if with_pose else (None, None)
    return LaserLine(stamp_of(rest[tail - 3]), start, increment, fov, max_range, ranges, *poses)


def planar_pose(words: list[bytes]) -> PoseLine:
    """Parse an ODOM or TRUEPOS line (its first pose); raises InputError where it is broken."""
    if len(words) < _POSE_WORDS:
        raise InputError("a line that is too short")
    return PoseLine(stamp_of(words[7]), _pose(words[1:4]))


def _count(words: list[bytes], at: int, tail: int) -> int:
    """Return the number at `at`, after which that many words and a tail must follow."""
    if at >= len(words) or not words[at].isdigit() or len(words[at]) > 6:
        raise InputError("a line that is broken")
    count = int(words[at])
    if len(words) < at + 1 + count + tail:
        raise InputError("a line that is too short")
    return count


def _floats32(words: list[bytes]) -> Float32Array:
    try:
        return np.array(list(map(float, words)), dtype=np.float32)
    except ValueError:
        raise InputError("a range that is no number") from None


def _pose(words: list[bytes]) -> Pose:
    x, y, heading = (_float(word) for word in words)
    return x, y, heading


def _float(word: bytes) -> float:
    try:
        value = float(word)
    except ValueError:
        raise InputError(f"'{word[:20].decode('ascii', 'replace')}' where a number was wanted") from None
    if not math.isfinite(value):
        raise InputError("a number that is not finite")
    return value
