"""What a scanner's driver may have meant: units of its ranges, limits and angles, and how many scanners share a topic."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.logs.doctor.finding import LogFinding, Severity
from lhdmap.logs.scan_repair import ScanRepair, Stream, stream_of
from lhdmap.messages import LaserScan

_FAR_M = 150.0  # no drift is so wide that half of a scanner's beams measure more
_LIMIT_M = 500.0
_MILLI = 1e-3
_FULL_TURN_RAD = 2.0 * math.pi * 1.01
_APART_RAD = math.radians(5.0)  # first and last beams of one scanner that interlaces are closer
_FEWEST_SCANS = 5


class Kinds(NamedTuple):
    """What is done to the scans of a topic, and what is to be said of it."""

    repair: ScanRepair
    findings: list[LogFinding]


def kinds_of(topic: str, scans: list[LaserScan], stated_end_rad: float | None) -> Kinds:
    """Judge a sample of scans of one topic; the angle that the log states for the last beam, where it does."""
    first = next((scan for scan in scans if len(scan.ranges_m)), scans[0])
    range_scale, limit_scale, units = _lengths(topic, scans, first)
    degrees, start_degrees, angles = _angles(topic, first, stated_end_rad)
    streams, shared = _streams(topic, scans)
    repair = ScanRepair(range_scale, limit_scale, degrees, start_degrees, streams)
    return Kinds(repair, [*units, *_limits(topic, first), *angles, *shared])


def _lengths(topic: str, scans: list[LaserScan], first: LaserScan) -> tuple[float, float, list[LogFinding]]:
    """Return the factors of ranges and of limits to metres."""
    ranges = np.concatenate([scan.ranges_m for scan in scans])
    ranges = ranges[np.isfinite(ranges) & (ranges > 0.0)]
    limit_m = first.range_max_m
    inside = ranges[ranges <= limit_m] if limit_m > 0.0 else ranges
    median = float(np.median(ranges)) if len(ranges) else 0.0
    in_limits = len(inside) > 0.5 * len(ranges)
    if median < _FAR_M or (in_limits and limit_m < _LIMIT_M):
        return 1.0, 1.0, []
    text = f"ranges are of {median:.0f} on the median: millimetres, not metres"
    limit_scale = _MILLI if limit_m > _LIMIT_M else 1.0
    advice = "they are converted" if limit_scale == 1.0 else "they and their limits are converted"
    return _MILLI, limit_scale, [LogFinding(Severity.PROBLEM, topic, text, advice)]


def _limits(topic: str, first: LaserScan) -> list[LogFinding]:
    low, high = first.range_min_m, first.range_max_m
    if math.isnan(low) or math.isnan(high):
        text = f"range limits that are no numbers ({low:g} to {high:g} m)"
        return [LogFinding(Severity.REMARK, topic, text, "taken as no limit")]
    if low == 0.0 and high == 0.0:
        return [LogFinding(Severity.REMARK, topic, "both range limits are 0", "taken as no limit")]
    if high <= max(low, 0.0):
        text = f"the range limits are impossible ({low:g} to {high:g} m)"
        return [LogFinding(Severity.FATAL, topic, text, "no beam is valid: set the driver's limits")]
    return []


def _angles(topic: str, first: LaserScan, stated_end_rad: float | None) -> tuple[bool, bool, list[LogFinding]]:
    """Return whether all angles, or the start alone, are degrees."""
    beams, increment = len(first.ranges_m), first.angle_increment_rad
    if beams > 1 and increment == 0.0:
        text, advice = "the angle increment is zero", "the scanner's driver is misconfigured: all beams coincide"
        return False, False, [LogFinding(Severity.FATAL, topic, text, advice)]
    span = abs(increment) * max(beams - 1, 0)
    if span <= _FULL_TURN_RAD and abs(first.angle_min_rad) <= _FULL_TURN_RAD:
        return False, False, []
    if span <= _FULL_TURN_RAD:
        text = f"the start angle is {first.angle_min_rad:.4g} rad: degrees are meant"
        return False, True, [LogFinding(Severity.PROBLEM, topic, text, "it is converted")]
    stated = "" if stated_end_rad is None else f" from {first.angle_min_rad:.4g} to {stated_end_rad:.4g}"
    if math.radians(span) <= _FULL_TURN_RAD:
        text = f"angles{stated} with steps of {increment:.4g}: degrees, not radians"
        return True, False, [LogFinding(Severity.PROBLEM, topic, text, "they are converted")]
    text = f"the field of view is {math.degrees(span):.0f} deg: {beams} beams of {math.degrees(increment):.3g} deg"
    return False, False, [LogFinding(Severity.FATAL, topic, text, "360 at most was wanted: set the driver's increment")]


def _streams(topic: str, scans: list[LaserScan]) -> tuple[frozenset[Stream] | None, list[LogFinding]]:
    """Return which scanners to use where several take turns on one topic; None for all."""
    at: dict[Stream, list[int]] = {}
    for index, scan in enumerate(scans):
        if len(scan.ranges_m):
            at.setdefault(stream_of(scan), []).append(index)
    groups = _groups([stream for stream, places in at.items() if len(places) >= _FEWEST_SCANS])
    places = [sorted(place for stream in group for place in at[stream]) for group in groups]
    if len(groups) < 2 or not _take_turns(places):
        return None, []
    count = [sum(len(scans[k].ranges_m) for k in listed) for listed in places]
    best = int(np.argmax(count))
    names = ", ".join(_named(group[0], scans[listed[0]]) for group, listed in zip(groups, places, strict=True))
    text = f"{len(groups)} scanners share the topic ({names})"
    advice = f"only {_named(groups[best][0], scans[places[best][0]])} is used: record each on its own topic"
    return frozenset(groups[best]), [LogFinding(Severity.PROBLEM, topic, text, advice)]


def _groups(streams: list[Stream]) -> list[list[Stream]]:
    """Return the streams by scanner: another frame, or another field of view; a scanner that interlaces is one."""
    groups: list[list[Stream]] = []
    for stream in sorted(streams):
        last = groups[-1][-1] if groups else None
        if last is not None and _one_scanner(last, stream):
            groups[-1].append(stream)
        else:
            groups.append([stream])
    return groups


def _one_scanner(one: Stream, other: Stream) -> bool:
    alike = abs(one[1] - other[1]) < _APART_RAD and abs(one[2] - other[2]) < _APART_RAD
    return one[0] == other[0] and alike


def _take_turns(places: list[list[int]]) -> bool:
    """Return whether scanners appear side by side for most of the log, and not one after the other."""
    start, end = max(listed[0] for listed in places), min(listed[-1] for listed in places)
    shortest = min(listed[-1] - listed[0] for listed in places)
    return shortest > 0 and end - start > 0.5 * shortest


def _named(stream: Stream, scan: LaserScan) -> str:
    frame, start_rad, end_rad = stream
    angles = f"from {math.degrees(start_rad):.0f} to {math.degrees(end_rad):.0f} deg"
    return f"'{frame}', {len(scan.ranges_m)} beams {angles}"
