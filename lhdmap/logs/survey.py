"""A quick look through a log before it is used: mounts, and what of it can be used. `doctor` and `build-map` go by the same.

One pass that decodes a few hundred messages of each topic. What follows from it: scans that are put right, sensors that are
left out, and what makes the log unusable.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from lhdmap.logs.base import LogReader
from lhdmap.logs.doctor.finding import LogFinding, Severity
from lhdmap.logs.doctor.scans import fatal_findings
from lhdmap.logs.doctor.values import ValueWatch
from lhdmap.logs.frames import FrameTree
from lhdmap.logs.scan_kinds import kinds_of
from lhdmap.logs.scan_repair import AS_IT_IS, ScanRepair
from lhdmap.messages import LaserScan, Message, Mount
from lhdmap.roles import ROLES, TRANSFORMS, judged_as

_SCANS, _VALUES, _TRANSFORMS = 300, 800, 4000
_STATIC = "tf_static"


@dataclass(frozen=True)
class Survey:
    """What a look through a log found: `findings` go to people, the rest is acted on.

    `frames`: the log's transforms; `repairs`: by scan topic; `left_out`: why the topic of a role is not used.
    """

    frames: FrameTree = field(default_factory=FrameTree)
    repairs: dict[str, ScanRepair] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)
    findings: list[LogFinding] = field(default_factory=list)

    @property
    def fatal(self) -> list[LogFinding]:
        """What makes the log unusable."""
        return [finding for finding in self.findings if finding.severity is Severity.FATAL]

    def repaired(self, topic: str, message: Message) -> Message | None:
        """Return the message as it was meant; None for a scan that is not used."""
        repair = self.repairs.get(topic)
        return repair.applied(message) if repair is not None and isinstance(message, LaserScan) else message


def take_survey(readers: Sequence[LogReader], roles: Mapping[str, str], *, begun: bool = False) -> Survey:
    """Look through the files of a log; `roles`: the topic of each.

    `begun`: only the beginning is there: that a value has not changed yet says nothing.
    """
    survey = Survey()
    scans, values = _sampled(readers, roles, survey.frames)
    needed = roles.get("front", roles.get("points"))
    for topic, listed in scans.items():
        _judge_scans(survey, topic, listed, next((reader for reader in readers if topic in reader.topics()), None))
    for role, watch in () if begun else values.items():
        _judge_values(survey, role, watch)
    for index, finding in enumerate(survey.findings):
        if finding.severity is Severity.FATAL and finding.topic != needed:
            survey.findings[index] = finding._replace(severity=Severity.PROBLEM)
            survey.left_out.update({role: finding.text for role, topic in roles.items() if topic == finding.topic})
    return survey


def transform_topics(readers: Sequence[LogReader]) -> dict[str, bool]:
    """Return the topics of transforms, and whether each is of static ones."""
    names = {name for reader in readers for name, info in reader.topics().items() if info.type_name == TRANSFORMS}
    return {name: name.endswith(_STATIC) for name in sorted(names)}


def _sampled(
    readers: Sequence[LogReader], roles: Mapping[str, str], frames: FrameTree
) -> tuple[dict[str, list[LaserScan]], dict[str, ValueWatch]]:
    """Read the sample: scans by topic, watches of the slow sensors by role; transforms go into `frames`."""
    static = transform_topics(readers)
    role_of = {roles[role]: role for role in judged_as("value", "speed") if role in roles}
    most = dict.fromkeys(role_of, _VALUES) | dict.fromkeys(static, _TRANSFORMS)
    most |= {roles[role]: _SCANS for role in judged_as("scan") if role in roles}
    scans: dict[str, list[LaserScan]] = {}
    values = {role: ValueWatch(topic) for topic, role in role_of.items()}
    for reader in readers:
        for topic, _, message in reader.sample(most):
            if isinstance(message, Mount):
                frames.add(message, static=static.get(topic, True))
            elif isinstance(message, LaserScan):
                scans.setdefault(topic, []).append(message)
            elif topic in role_of:
                values[role_of[topic]].update(message)
    return scans, values


def _judge_scans(survey: Survey, topic: str, scans: list[LaserScan], reader: LogReader | None) -> None:
    repair, findings = kinds_of(topic, scans, None if reader is None else reader.stated_end_rad(topic))
    if repair != AS_IT_IS or any("limit" in finding.text for finding in findings):
        survey.repairs[topic] = repair
    survey.findings.extend(findings)
    meant = [scan for scan in map(repair.applied, scans) if scan is not None]
    if not survey.fatal:
        survey.findings.extend(fatal_findings(topic, meant))


def _judge_values(survey: Survey, role: str, watch: ValueWatch) -> None:
    """Leave out a sensor that says the same for ever: but zero of one that is level, or straight, is as good as none."""
    if not watch.never_changes or (ROLES[role].survey == "value" and watch.is_zero):
        return
    what = "it never moves" if role == "wheel_odometry" else f"its value never changes ({watch.last_text})"
    survey.left_out[role] = what
    text = f"{what}: not used as {role.replace('_', ' ')}"
    survey.findings.append(LogFinding(Severity.PROBLEM, watch.topic, text, "is the sensor connected?"))
