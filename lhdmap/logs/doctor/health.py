"""The examination of a log: one pass over all messages, a list of findings, a verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from lhdmap.errors import InputError
from lhdmap.logs.base import LogReader
from lhdmap.logs.decoders import DECODERS
from lhdmap.logs.doctor.finding import LogFinding, Severity
from lhdmap.logs.doctor.scans import ScanWatch
from lhdmap.logs.doctor.stamps import StampWatch
from lhdmap.logs.doctor.values import ValueWatch
from lhdmap.logs.formats import open_log
from lhdmap.logs.inventory import Inventory, take_inventory
from lhdmap.logs.scan_repair import AS_IT_IS
from lhdmap.logs.survey import Survey, take_survey
from lhdmap.logs.topics import is_ground_truth, missing_scanner, roles_and_doubt
from lhdmap.messages import LaserScan, Message, Record
from lhdmap.roles import CLOUD, SCAN

# Words of readers' remarks on what was guessed or left out.
_GUESSED = (
    "times of its points",
    "field of view is a guess",
    "not used; it is read as",
    "not named in metadata.yaml",
    "another clock",
)
_KEY_SCAN_STEP_M, _KEY_SCAN_PERIOD_S = 0.5, 0.3
# Wraps the records while they are read, for a progress display: reader and records in, records out.
Progress = Callable[[LogReader, Iterator[Record]], Iterator[Record]]


class LogVerdict(StrEnum):
    """Whether a log can be used."""

    USABLE = "usable"
    REMARKS = "usable with remarks"
    UNUSABLE = "not usable"


@dataclass(frozen=True)
class Examination:
    """The outcome for one log; `inventory` is None where it could not be opened."""

    path: Path
    verdict: LogVerdict
    findings: list[LogFinding] = field(default_factory=list)
    inventory: Inventory | None = None


class _Watches:
    """One set of watches for each topic."""

    def __init__(self) -> None:
        self.scans: dict[str, ScanWatch] = {}
        self.values: dict[str, ValueWatch] = {}
        self.stamps: dict[str, StampWatch] = {}

    def update(self, topic: str, message: Message) -> None:
        if topic not in self.stamps:
            self.stamps[topic] = StampWatch(topic)
            self.scans[topic], self.values[topic] = ScanWatch(topic), ValueWatch(topic)
        self.stamps[topic].update(message.stamp_ns)
        if isinstance(message, LaserScan):
            self.scans[topic].update(message)
        else:
            self.values[topic].update(message)


def examine(path: Path, overrides: Mapping[str, str] | None = None, progress: Progress | None = None) -> Examination:
    """Read a log once and say what is in it and what is wrong with it; never raises for what is wrong with the log."""
    with ExitStack() as stack:
        try:
            reader = stack.enter_context(open_log(path))
            return _examined(reader, overrides or {}, progress or (lambda _, records: records))
        except InputError as error:
            return Examination(path, LogVerdict.UNUSABLE, [LogFinding(Severity.FATAL, "", str(error))])


def _examined(reader: LogReader, overrides: Mapping[str, str], progress: Progress) -> Examination:
    roles, findings = _roles(reader, overrides)
    survey = take_survey([reader], roles)
    watches = _Watches()
    for record in progress(reader, reader.records()):
        message = survey.repaired(record.topic, record.message)
        if message is not None:
            watches.update(record.topic, message)
    findings += survey.findings
    findings += [
        LogFinding(Severity.PROBLEM, "", f"damaged: {line}", "all whole messages are used") for line in reader.damage
    ]
    findings += _topic_findings(reader, watches, survey)
    findings += _missing(reader, roles, watches)
    findings += _mounts(survey, roles, watches)
    findings += _key_scans(roles, watches)
    findings += _clocks(reader)
    findings += [_of_remark(line) for line in reader.remarks if not _told_elsewhere(line)]
    used = {role: topic for role, topic in roles.items() if role not in survey.left_out}
    return Examination(reader.path, _verdict(findings), findings, take_inventory(reader, used))


def _roles(reader: LogReader, overrides: Mapping[str, str]) -> tuple[dict[str, str], list[LogFinding]]:
    """Return the roles of the topics, and the doubt about the front scanner, which no command can do without."""
    roles, doubt = roles_and_doubt(reader.topics(), overrides)
    if doubt and overrides:
        raise InputError(doubt)
    return roles, [
        LogFinding(Severity.FATAL, "", doubt, "give that option to this and the other commands")
    ] if doubt else []


def _topic_findings(reader: LogReader, watches: _Watches, survey: Survey) -> list[LogFinding]:
    found = []
    for topic, watch in watches.stamps.items():
        if is_ground_truth(topic):
            continue
        found += watch.findings(reader.stamps[topic], reader.start_ns or 0)
        stated = None if survey.repairs.get(topic, AS_IT_IS).degrees else _stated_end(reader, topic)
        found += watches.scans[topic].findings(watch.period_s, stated)
        found += watches.values[topic].findings()
    return found


def _stated_end(reader: LogReader, topic: str) -> float | None:
    return reader.stated_end_rad(topic) if reader.topics()[topic].type_name == SCAN else None


def _clocks(reader: LogReader) -> list[LogFinding]:
    """Return where the clock was set, and topics with a clock of their own."""
    start_ns = min((seen.first_ns for seen in reader.stamps.values() if seen.count), default=0)
    advice = "the order of the file is kept, and time runs on as if the clock had not been set"
    return [LogFinding(Severity.REMARK, "", step.text(start_ns), advice) for step in reader.clock_steps]


def _of_remark(line: str) -> LogFinding:
    """Return a reader's remark as a finding; how a format is read is a note, what was guessed or left out is more."""
    return LogFinding(Severity.REMARK if any(word in line for word in _GUESSED) else Severity.NOTE, "", line)


def _told_elsewhere(remark: str) -> bool:
    """Return whether a remark of the reader is of stamps and clocks, which have findings of their own."""
    return ("stamp" in remark and "another clock" not in remark) or remark.startswith("the clock was set")


def _mounts(survey: Survey, roles: Mapping[str, str], watches: _Watches) -> list[LogFinding]:
    """Return which sensors have no mount, and what was odd in the transforms."""
    found = []
    frames = {topic: watch.frame_id for topic, watch in watches.scans.items() if watch.frame_id}
    frames |= {topic: watch.frame_id for topic, watch in watches.values.items() if watch.frame_id}
    mounted = {roles[role] for role in ("front", "rear", "points", "inclinometer") if role in roles}
    for topic, frame in frames.items():
        is_scanner = topic in watches.scans and bool(watches.scans[topic].frame_id)
        if survey.frames.mount(frame) is None and (is_scanner or topic in mounted):
            advice = "the machine file's is used, else a level sensor at base_link"
            found.append(LogFinding(Severity.REMARK, topic, f"no mount of its frame '{frame}' in the log", advice))
    return found + [LogFinding(Severity.REMARK, "", line) for line in survey.frames.remarks]


def _missing(reader: LogReader, roles: Mapping[str, str], watches: _Watches) -> list[LogFinding]:
    """Return what the log lacks."""
    found = []
    topics = reader.topics()
    scanners = [name for name, info in topics.items() if info.type_name in (SCAN, CLOUD)]
    if not scanners:
        found.append(LogFinding(Severity.FATAL, "", str(missing_scanner(topics)), "record the scanner's topic"))
    elif scanners == [roles.get("rear")]:
        found.append(
            LogFinding(Severity.FATAL, "", str(missing_scanner(topics, roles["rear"])), "or record the front one")
        )
    elif not any(name in watches.stamps for name in scanners):
        text = "no scan in the log: its scanner topics hold no whole message"
        found.append(LogFinding(Severity.FATAL, "", text, "record it again"))
    if "inclinometer" not in roles:
        found.append(LogFinding(Severity.NOTE, "", "no inclinometer: the drive is treated as level"))
    if "wheel_odometry" not in roles and "tachometer" not in roles:
        found.append(
            LogFinding(Severity.NOTE, "", "no wheel speed: where scans do not show the motion, the last one is kept")
        )
    undecoded = [info for info in topics.values() if info.type_name not in DECODERS]
    if undecoded:
        listed = ", ".join(f"{info.name} ({info.type_name})" for info in undecoded)
        found.append(LogFinding(Severity.NOTE, "", f"not read: {listed}"))
    return found


def _key_scans(roles: Mapping[str, str], watches: _Watches) -> list[LogFinding]:
    """Tell a log of key scans (about a metre apart) from a drive."""
    path_m = max((watch.path_m for watch in watches.values.values()), default=0.0)
    front = roles.get("front", "")
    count = watches.stamps[front].count if front in watches.stamps else 0
    period_s = watches.stamps[front].period_s if count > 2 else None
    quick = period_s is not None and 0.0 < period_s < _KEY_SCAN_PERIOD_S
    if count < 2 or quick or path_m < _KEY_SCAN_STEP_M * count:
        return []
    text = f"key scans only: {path_m / count:.2f} m between scans"
    return [LogFinding(Severity.PROBLEM, front, text, "too far for odometry: build the map with given poses")]


def _verdict(findings: list[LogFinding]) -> LogVerdict:
    severities = {finding.severity for finding in findings}
    if Severity.FATAL in severities:
        return LogVerdict.UNUSABLE
    return LogVerdict.REMARKS if severities & {Severity.REMARK, Severity.PROBLEM} else LogVerdict.USABLE
