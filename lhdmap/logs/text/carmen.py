"""CARMEN logs (`.clf`, `.log`, also gzip or bzip2), in the order of the file.

Topics are named as in the log (`FLASER`, `ODOM`). The stamp is the ipc time, which is the log time too: old loggers let
both run backwards, so the order is the file's. The poses of corrected logs (gmapping, pose graphs) are truth.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator

import numpy as np

from lhdmap.errors import InputError
from lhdmap.logs.base import TopicInfo
from lhdmap.logs.findings import Findings
from lhdmap.logs.text import carmen_lines as lines
from lhdmap.logs.text.carmen_survey import FRAMES, PARSERS, CarmenSurvey, survey
from lhdmap.logs.text.log import FoundLine, TextLog, Wanted, every
from lhdmap.messages import GroundTruth, LaserScan, Mount, WheelPose
from lhdmap.roles import ODOMETRY, ROLES, SCAN, TRANSFORMS

_MOUNTS = ROLES["tf_static"].topic
_TRUTH = "/ground_truth/"


class CarmenLog(TextLog):
    """A `LogReader` of a CARMEN log."""

    format = "CARMEN log"

    def _survey(self) -> None:
        found = survey(self.path)
        if not found.counts:
            raise InputError(
                f"{self.path}: no line of a CARMEN log in it; FLASER, ROBOTLASER or ODOM lines were wanted"
            )
        self._found = found
        self._lasers = _lasers(found)
        self._pose_topics = _pose_topics(found, self._lasers)
        self._start_ns, self._end_ns = found.start_ns, found.end_ns
        _remark(found, self._lasers, self._notes)

    def topics(self) -> dict[str, TopicInfo]:
        """Return the topics by name."""
        found = self._found
        listed = {name: TopicInfo(name, SCAN, found.counts[name], FRAMES[name]) for name in self._lasers}
        if found.mounts:
            listed[_MOUNTS] = TopicInfo(_MOUNTS, TRANSFORMS, len(self._lasers))
        for keyword, topic in self._pose_topics.items():
            listed[topic] = TopicInfo(topic, ODOMETRY, found.counts[keyword])
        return listed

    def stated_end_rad(self, topic: str) -> float | None:
        """Return start angle plus field of view of the first scan; FLASER lines do not state them."""
        first = self._found.first.get(topic)
        stated = first is not None and topic not in ("FLASER", "RLASER")
        return first.angle_min_rad + first.fov_rad if first is not None and stated else None

    def _messages(self, topics: Collection[str], wanted: Wanted = every) -> Iterator[FoundLine]:
        if _MOUNTS in topics:
            yield from self._mounts()
        for line in self._lines():
            end = line.find(b" ")
            name = line[:end].decode("ascii", "replace") if end > 0 else ""
            on_it = {name} if name in self._lasers else set()
            on_it |= {self._pose_topics[name]} if name in self._pose_topics else set()
            now = [topic for topic in on_it if topic in topics and wanted(topic)]
            if now:
                yield from self._parsed(name, line.split(), now)

    def _mounts(self) -> Iterator[FoundLine]:
        for name in self._lasers:
            if name in self._found.mounts:
                start = self._start_ns or 0
                yield FoundLine(
                    _MOUNTS, start, Mount(start, "base_link", FRAMES[name], self._found.mounts[name]), False
                )

    def _parsed(self, name: str, words: list[bytes], topics: Collection[str]) -> Iterator[FoundLine]:
        try:
            if name in PARSERS:
                yield from self._scan(name, PARSERS[name](words), topics)
            else:
                line = lines.planar_pose(words)
                yield self._pose(self._pose_topics[name], line.stamp_ns, line.pose)
        except InputError as error:
            self._notes_damage(f"{name}: a line was skipped: {error}")

    def _scan(self, name: str, line: lines.LaserLine, topics: Collection[str]) -> Iterator[FoundLine]:
        limit = self._found.range_max_m.get(name, math.inf)
        numbers = (line.angle_min_rad, line.angle_increment_rad, 0.0, 0.0, limit)
        if name in topics:
            scan = LaserScan(line.stamp_ns, FRAMES[name], *numbers, line.ranges_m)
            yield FoundLine(name, line.stamp_ns, scan, True)
        topic = self._pose_topics.get(name)
        if topic in topics and topic is not None and line.robot_pose is not None:
            yield self._pose(topic, line.stamp_ns, line.robot_pose)

    @staticmethod
    def _pose(topic: str, stamp_ns: int, pose: lines.Pose) -> FoundLine:
        x, y, heading = pose
        if not topic.startswith(_TRUTH):
            return FoundLine(topic, stamp_ns, WheelPose(stamp_ns, x, y, heading), True)
        quaternion = np.array([0.0, 0.0, math.sin(heading / 2), math.cos(heading / 2)])
        return FoundLine(topic, stamp_ns, GroundTruth(stamp_ns, np.array([x, y, 0.0]), quaternion), True)


def _lasers(found: CarmenSurvey) -> list[str]:
    """Return the laser lines to read: the one that states its angles where a laser is logged in two ways."""
    listed: list[str] = []
    for groups in (("ROBOTLASER1", "FLASER", "RAWLASER1"), ("ROBOTLASER2", "RLASER", "RAWLASER2")):
        present = [name for name in groups if name in found.first]
        listed += present[:1]
    return listed


def _pose_topics(found: CarmenSurvey, lasers: list[str]) -> dict[str, str]:
    """Return which lines give poses, and as what topic; corrected poses are truth."""
    topics = {"TRUEPOS": _TRUTH + "TRUEPOS"} if "TRUEPOS" in found.counts else {}
    posed = next((name for name in lasers if found.first[name].robot_pose is not None), None)
    if found.corrected and posed is not None:
        topics[posed] = _TRUTH + posed
    elif posed in found.posed:  # the pose at the scan itself: better than ODOM lines, whose stamps are others
        topics[posed] = f"{posed}/odom"
    elif not found.corrected and "ODOM" in found.counts:
        topics["ODOM"] = "ODOM"
    elif not found.corrected and posed is not None:
        topics[posed] = f"{posed}/odom"
    return topics


def _remark(found: CarmenSurvey, lasers: list[str], notes: Findings) -> None:
    if found.corrected:
        notes.add("the poses in the log were corrected by a mapping program: taken as ground truth, not as odometry")
    for name in lasers:
        first = found.first[name]
        if name in found.no_return_m:
            notes.add(f"{name}: {found.no_return_m[name]:g} m stands for no return; ranges count up to "
                      f"{found.range_max_m[name]:g} m")  # fmt: skip
        if name in ("FLASER", "RLASER"):
            _remark_fov(name, first, notes)


def _remark_fov(name: str, first: lines.LaserLine, notes: Findings) -> None:
    beams, fov_deg = len(first.ranges_m), math.degrees(first.fov_rad)
    step_deg = math.degrees(first.angle_increment_rad)
    if not lines.has_known_fov(beams):
        notes.add(
            f"{name}: its field of view is a guess: {beams} beams are no scanner that CARMEN knows, {fov_deg:.0f} deg in steps of "
            f"{step_deg:.3g} are assumed"
        )
    elif beams % 2 == 0:
        last_deg = math.degrees(first.angle_min_rad) + (beams - 1) * step_deg
        notes.add(f"{name}: {beams} beams for {fov_deg:.0f} deg: the last beam is taken at {last_deg:+.4g} deg")
