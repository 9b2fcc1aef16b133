"""`LogSource`: one or several log files as one stream of messages by role, in log-time order."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack
from operator import itemgetter
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError, UsageError
from lhdmap.logs.base import LogReader, TopicInfo
from lhdmap.logs.clock import ClockStep
from lhdmap.logs.doctor.finding import Severity
from lhdmap.logs.formats import open_log
from lhdmap.logs.inventory import Inventory, take_inventory
from lhdmap.logs.kinds import of_one_type
from lhdmap.logs.survey import Survey, take_survey, transform_topics
from lhdmap.logs.topics import assign_topics, missing_scanner
from lhdmap.messages import Message
from lhdmap.roles import ROLES
from lhdmap.settings import nearest

_MOUNTS = "tf_static"


class LogSource:
    """A log of one or more files; a context manager. `overrides` names topics by role (`{"front": "/scan"}`).

    After entering, `roles` says which topic plays which role (of all files together), `start_ns` and `end_ns` which log
    times are covered, `survey` what was found in a quick look: sensors that say nothing have lost their roles.
    `warnings` and `damage` fill while reading. `force`: a log that the survey calls unusable is used nevertheless. `survey`: of
    the same log, where it was opened before: it is not looked through again. `needs_scanner`: a log without one is refused.
    `window_ns`: only what was logged from the first to before the second time. `growing`: opens a log that is still being
    written, of which only the beginning can be looked through.
    """

    def __init__(
        self,
        paths: Sequence[Path | str] | Path | str,
        overrides: Mapping[str, str] | None = None,
        *,
        force: bool = False,
        survey: Survey | None = None,
        needs_scanner: bool = True,
        window_ns: tuple[int, int] | None = None,
        growing: Callable[[Path], LogReader] | None = None,
    ) -> None:
        listed = [paths] if isinstance(paths, (str, Path)) else list(paths)
        if not listed:
            raise InputError("no log was given")
        self.paths = [Path(path) for path in listed]
        self.roles: dict[str, str] = {}
        self._overrides = dict(overrides or {})
        self._force = force
        self._needs_scanner = needs_scanner
        self._known = survey
        self._window_ns = window_ns
        self._growing = growing
        self.survey = Survey()
        self._readers: list[LogReader] = []
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        """Open all files and find out the roles of their topics; raises InputError where that fails."""
        with ExitStack() as stack:
            self._readers = [stack.enter_context((self._growing or open_log)(path)) for path in self.paths]
            self.roles = self._assigned()
            if self._needs_scanner and "front" not in self.roles and "points" not in self.roles:
                raise InputError(f"{self._names()}: {missing_scanner(self.topics(), self.roles.get('rear'))}")
            for reader in self._readers:
                reader.truth_topics = frozenset({self.roles.get("ground_truth", "")})
            self._look_through()
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close all files."""
        self._stack.close()

    def _assigned(self) -> dict[str, str]:
        try:
            return assign_topics(self.topics(), self._overrides)
        except InputError as error:
            raise InputError(f"{self._names()}: {error}") from error

    def _look_through(self) -> None:
        """Take the survey and act on it."""
        begun = self._growing is not None
        self.survey = survey = self._known or take_survey(self._readers, self.roles, begun=begun)
        if survey.fatal and not self._force:
            first = survey.fatal[0]
            where = f"{first.topic}: " if first.topic else ""
            raise InputError(
                f"{self._names()}: {where}{first.text}; {first.advice} (--force goes on nevertheless; lhdmap doctor tells more)"
            )
        self.roles = {role: topic for role, topic in self.roles.items() if role not in survey.left_out}
        if survey.frames.transforms():
            self.roles.setdefault(_MOUNTS, next(iter(transform_topics(self._readers))))

    @property
    def damage(self) -> list[str]:
        """What was cut off, broken or skipped so far, with the file it concerns."""
        return [f"{reader.path}: {line}" for reader in self._readers for line in reader.damage]

    @property
    def warnings(self) -> list[str]:
        """What was odd so far, with the file it concerns."""
        told = (Severity.PROBLEM, Severity.FATAL)
        found = [finding for finding in self.survey.findings if finding.severity in told]
        lines = [f"{self.paths[0]}: {finding.topic}: {finding.text}; {finding.advice}" for finding in found]
        lines += [f"{self.paths[0]}: {line}" for line in self.survey.frames.remarks]
        lines += [f"{reader.path}: {line}" for reader in self._readers for line in reader.remarks]
        return lines + (self._typed()[1] if len(self._readers) > 1 else [])

    @property
    def clock_steps(self) -> list[ClockStep]:
        """Where clocks were set while the log was recorded, as far as it was read."""
        return [step for reader in self._readers for step in reader.clock_steps]

    @property
    def start_ns(self) -> int | None:
        """Log time of the first message."""
        start = min((reader.start_ns for reader in self._readers if reader.start_ns is not None), default=None)
        return start if start is None or self._window_ns is None else max(start, self._window_ns[0])

    @property
    def end_ns(self) -> int | None:
        """Log time of the last message."""
        end = max((reader.end_ns for reader in self._readers if reader.end_ns is not None), default=None)
        return end if end is None or self._window_ns is None else min(end, self._window_ns[1])

    @property
    def duration_s(self) -> float:
        """Log time from the first to the last message of all files, seconds (0 for an empty log)."""
        start, end = self.start_ns, self.end_ns
        return 0.0 if start is None or end is None else (end - start) / 1e9

    def topics(self) -> dict[str, TopicInfo]:
        """Return the topics of all files together, counts added up; of several types of a topic one is chosen."""
        return self._typed()[0]

    def _typed(self) -> tuple[dict[str, TopicInfo], list[str]]:
        return of_one_type(info for reader in self._readers for info in reader.topics().values())

    def messages(self, roles: Collection[str] | None = None) -> Iterator[tuple[str, Message]]:
        """Yield (role, message) of the wanted roles (all that the log fills by default) in log-time order.

        Transforms come first, whenever they were sent: they hold for the whole log. A role that the log does not fill has no
        messages.

        Raises:
            UsageError: there is no such role.
        """
        for role in roles or ():
            if role not in ROLES:
                raise UsageError(f"unknown role '{role}'{nearest(role, ROLES)}")
        wanted = {topic: role for role, topic in self.roles.items() if roles is None or role in roles}
        mounts = self.survey.frames.transforms() if _MOUNTS in wanted.values() else []
        measured = self._measured({topic: role for topic, role in wanted.items() if role != _MOUNTS})
        first = next(measured, None)
        start_ns = (self.start_ns or 0) if first is None else first[1].stamp_ns
        yield from ((_MOUNTS, mount._replace(stamp_ns=start_ns)) for mount in mounts)
        if first is not None:
            yield first
            yield from measured

    def _measured(self, wanted: Mapping[str, str]) -> Iterator[tuple[str, Message]]:
        """Yield role and message of the wanted topics, scans as they were meant."""
        kinds = {topic: info.type_name for topic, info in self.topics().items()}
        streams = [
            reader.records(
                {name for name, info in reader.topics().items() if name in wanted and info.type_name == kinds[name]}
            )
            for reader in self._readers
        ]
        merged = streams[0] if len(streams) == 1 else heapq.merge(*streams, key=itemgetter(1))
        first_ns, until_ns = self._window_ns or (-math.inf, math.inf)
        for topic, logged_ns, raw in merged:
            if not first_ns <= logged_ns < until_ns:
                continue
            message = self.survey.repaired(topic, raw)
            if message is not None:
                yield wanted[topic], message

    def first(self, role: str) -> Message | None:
        """Return the first message of a role, None where there is none; what is counted of the messages stays as it is."""
        topic = self.roles.get(role)
        if topic is None:
            return None
        found = (record.message for reader in self._readers for record in reader.sample({topic: 1}))
        return next(found, None)

    def recorded_ns(self, role: str, stamps_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Return stamps (N,) of a role's messages as they stand in the log.

        Where its clock was set, messages carry one that runs on.
        """
        topic = self.roles[role]
        for reader in self._readers:
            if topic in reader.stamps:
                stamps_ns = reader.recorded_ns(topic, stamps_ns)
        return stamps_ns

    def inventory(self) -> list[Inventory]:
        """Return what is in each file; rates and gaps are there once the messages have been read."""
        return [take_inventory(reader, self.roles) for reader in self._readers]

    def _names(self) -> str:
        return ", ".join(str(path) for path in self.paths)
