"""The line that names the columns of a pose table: time, x y z, quaternion, in any order, with units.

Known are the names of TUM (`timestamp tx ty tz qx qy qz qw`), EuRoC (`#timestamp [ns],p_RS_R_x [m],…,q_RS_w [],…`), messages
of ROS written as CSV (`%time,field.header.stamp,field.pose.pose.position.x,…`) and what follows their pattern.
"""

from __future__ import annotations

import re
from typing import NamedTuple

POSITION, QUATERNION = ("x", "y", "z"), ("qx", "qy", "qz", "qw")
POSE = POSITION + QUATERNION
TIME_NS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1_000_000_000),
    **dict.fromkeys(("ms", "msec", "millisec", "milliseconds"), 1_000_000),
    **dict.fromkeys(("us", "µs", "μs", "usec", "microsec", "microseconds"), 1_000),
    **dict.fromkeys(("ns", "nsec", "nsecs", "nanosec", "nanosecs", "nanosecond", "nanoseconds"), 1),
}
LENGTH_M = {"m": 1.0, "metre": 1.0, "metres": 1.0, "meter": 1.0, "meters": 1.0, "cm": 0.01, "mm": 0.001}
_TIME = frozenset(("t", "time", "timestamp", "timestamps", "stamp", "ts"))
_OF_POSITION = frozenset(("p", "pos", "position", "t", "trans", "translation", "pose", "point"))
_OF_ROTATION = frozenset(("q", "quat", "quaternion", "orientation", "rotation", "rot", "ori", "attitude"))
_MOTION = ("v", "vel", "velocity", "twist", "linear", "angular", "w", "omega", "a", "acc", "accel", "gravity")
_OF_OTHERS = frozenset(
    (*_MOTION, "b", "bias", "gyro", "mag", "cov", "covariance", "std", "sigma", "var", "error", "err")
)
_UNIT = re.compile(r"\s*[\[(]([^\])]*)[\])]\s*$")
_LEAST_NAMED = 4


class TimeColumn(NamedTuple):
    """A column of time: where it is, what it is called without its unit, and how many nanoseconds its unit has (0: not said)."""

    at: int
    name: tuple[str, ...]
    unit_ns: int


class Header(NamedTuple):
    """Where each column of a pose is: `time` (two of them: seconds and nanoseconds), `pose` in the order x y z qx qy qz qw.

    `scale_m`: metres in a unit of x, y, z; `names`: how many columns were named; `missing`: what was not found, in words.
    """

    time: tuple[TimeColumn, ...]
    pose: tuple[int, ...]
    scale_m: tuple[float, float, float]
    names: int
    missing: str = ""

    def shifted(self) -> Header:
        """Return the header of a table that has one more column, which is not named, before all others."""
        time = tuple(one._replace(at=one.at + 1) for one in self.time)
        return self._replace(time=time, pose=tuple(at + 1 for at in self.pose), names=self.names + 1)


PLAIN = Header((TimeColumn(0, ("t",), 0),), tuple(range(1, 8)), (1.0, 1.0, 1.0), 8)
"""The columns of a TUM file: t x y z qx qy qz qw."""


def header_of(line: str) -> Header | None:
    """Return the columns that a line names, None where it names less than half of those that a pose has.

    Raises:
        ValueError: a column stands twice, or has a unit that is not known; the text says which.
    """
    times: list[TimeColumn] = []
    poses: dict[str, int] = {}
    units: dict[str, str] = {}
    names = _names(line)
    for at, name in enumerate(names):
        role, unit, words = _column(name)
        if role == "t":
            times.append(TimeColumn(at, words, TIME_NS.get(unit, 0)))
        elif role in poses:
            raise ValueError(f"'{name}' is {role} once more")
        elif role:
            poses[role], units[role] = at, unit
    if len(poses) + bool(times) < _LEAST_NAMED:
        return None
    missing = ", ".join([*([] if times else ["time"]), *(role for role in POSE if role not in poses)])
    scale = [_length_m(units.get(role, "")) for role in POSITION]
    pose = tuple(poses.get(role, -1) for role in POSE)
    return Header(_chosen(times), pose, (scale[0], scale[1], scale[2]), len(names), missing)


def names_w_first(line: str) -> bool:
    """Return whether a line speaks of a quaternion with w first."""
    return bool(re.search(r"\bq_?w\b.*\bq_?x\b", line.lower()) or re.search(r"\bw,? ?x,? ?y,? ?z\b", line.lower()))


def _names(line: str) -> list[str]:
    text = re.sub(r"\s+(?=[\[(])", "", line.strip().strip("#%/").strip() if line.lstrip()[:1] in "#%/" else line)
    separator = next((one for one in (";", "\t", ",") if one in text), None)
    names = [name.strip().strip('"') for name in text.split(separator)]
    return names[1:] if names and names[0].endswith(":") else names


def _column(name: str) -> tuple[str, str, tuple[str, ...]]:
    """Return what a column holds (t, x, …, qw, or nothing that is needed), its unit, and its name in words without the unit."""
    bracket = _UNIT.search(name)
    unit = bracket.group(1).strip().lower() if bracket else ""
    words = [word for word in re.split(r"[^a-z0-9µμ]+", (name[: bracket.start()] if bracket else name).lower()) if word]
    if words and not unit and (words[-1] in TIME_NS or words[-1] in LENGTH_M) and (len(words) > 1 or len(words[0]) > 2):
        unit = words.pop()
    if unit in TIME_NS and (not words or words[-1] in _TIME):
        return "t", unit, tuple(words)
    if not words:
        return "", unit, ()
    if words[-1] in _TIME:
        return "t", unit, tuple(words)
    return _axis(words), unit, tuple(words)


def _axis(words: list[str]) -> str:
    last = words[-1]
    if last[-1] not in "wxyz":
        return ""
    of = {*words[:-1], *([last[:-1]] if len(last) > 1 else [])}
    if of & _OF_ROTATION or (last == "w" and not of):
        return "q" + last[-1]
    if of & _OF_OTHERS or last[-1] == "w":
        return ""
    return last[-1] if not of or of & _OF_POSITION else ""


def _length_m(unit: str) -> float:
    if unit and unit not in LENGTH_M:
        raise ValueError(f"x, y, z in '{unit}'; m, cm or mm was wanted")
    return LENGTH_M.get(unit, 1.0)


def _chosen(times: list[TimeColumn]) -> tuple[TimeColumn, ...]:
    """Return the column of time, or the two of seconds and nanoseconds; where several are, that of a stamp."""
    for whole in times:
        for rest in times:
            if whole.name == rest.name and whole.unit_ns == TIME_NS["s"] and rest.unit_ns == TIME_NS["ns"]:
                return whole, rest
    stamped = [one for one in times if any("stamp" in word for word in one.name)]
    return tuple((stamped or times)[:1])
