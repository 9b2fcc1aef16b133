"""Which topic of a log plays which role: by the contract's names, else by type where that leaves no doubt."""

from __future__ import annotations

from collections.abc import Mapping

from lhdmap.errors import InputError, UsageError
from lhdmap.logs.base import TopicInfo
from lhdmap.roles import CLOUD, ROLES, SCAN, Role, messages_of
from lhdmap.settings import nearest

# The scanners are found together, the truth before all that could be taken for it.
_LAST = [role for role in ROLES.values() if role.name not in ("front", "rear", "ground_truth")]


def is_ground_truth(topic: str) -> bool:
    """Return whether the name says that the topic holds the truth, which is never an input."""
    name = topic.lower().replace("-", "_")
    return "ground_truth" in name or "groundtruth" in name or name.strip("/") in ("truth", "truepos")


def assign_topics(topics: Mapping[str, TopicInfo], overrides: Mapping[str, str] | None = None) -> dict[str, str]:
    """Return the topic of each role that the log fills; `overrides` name topics by role and win.

    Raises:
        InputError: two topics could be the front scanner, or an override names a topic that the log lacks.
        UsageError: an override names an unknown role.
    """
    chosen, doubt = roles_and_doubt(topics, overrides)
    if doubt:
        raise InputError(doubt)
    return chosen


def roles_and_doubt(
    topics: Mapping[str, TopicInfo], overrides: Mapping[str, str] | None = None
) -> tuple[dict[str, str], str]:
    """Return the roles as `assign_topics`, and why none is the front scanner where several could be (else empty)."""
    chosen = _overridden(topics, overrides or {})
    free = {name: info for name, info in topics.items() if name not in chosen.values()}
    for role in ROLES.values():
        if role.name not in chosen and role.topic in free and free[role.topic].type_name == role.type_name:
            chosen[role.name] = free.pop(role.topic).name
    truths = {name: info for name, info in free.items() if is_ground_truth(name)}
    _assign_only_one(ROLES["ground_truth"], chosen, truths)
    free = {name: info for name, info in free.items() if name not in truths}
    doubt = _assign_scanners(chosen, free)
    for role in _LAST:
        if role.words:
            _assign_only_one(role, chosen, {name: info for name, info in free.items() if role.named_by(name)})
        if role.by_type:
            _assign_only_one(role, chosen, free)
    return chosen, doubt


def _overridden(topics: Mapping[str, TopicInfo], overrides: Mapping[str, str]) -> dict[str, str]:
    for role, topic in overrides.items():
        if role not in ROLES:
            raise UsageError(f"--topic {role}={topic}: unknown role '{role}'{nearest(role, ROLES)}")
        if topic not in topics:
            raise InputError(f"--topic {role}={topic}: the log has no such topic{nearest(topic, topics)}")
        found, wanted = topics[topic].type_name, ROLES[role].type_name
        if found != wanted and ROLES[role].message not in messages_of(found):
            raise InputError(f"--topic {role}={topic}: {wanted} was wanted, that topic is {found}")
    return dict(overrides)


def _assign_scanners(chosen: dict[str, str], free: dict[str, TopicInfo]) -> str:
    """Assign rear and front scanner; return the doubt about the front one, if any."""
    scans = [name for name, info in free.items() if info.type_name == SCAN and info.count != 0]
    rear = [name for name in scans if ROLES["rear"].named_by(name)]
    if "rear" not in chosen and len(rear) == 1 and (len(scans) > 1 or "front" in chosen):
        chosen["rear"] = rear[0]
    if "front" in chosen:
        return ""
    scans = [name for name in scans if name != chosen.get("rear")]
    candidates = [name for name in scans if ROLES["front"].named_by(name)] or scans
    if len(candidates) == 1:
        chosen["front"] = candidates[0]
    elif candidates:
        listed, first = ", ".join(sorted(candidates)), min(candidates)
        return f"{len(candidates)} topics could be the front scanner: {listed}; name it: --topic front={first}"
    return ""


def _assign_only_one(role: Role, chosen: dict[str, str], free: Mapping[str, TopicInfo]) -> None:
    if role.name in chosen:
        return
    same = [name for name, info in free.items() if info.type_name == role.type_name and info.count != 0]
    if len(same) == 1:
        chosen[role.name] = same[0]


def missing_scanner(topics: Mapping[str, TopicInfo], rear: str | None = None) -> InputError:
    """Return the error for a log without a scanner to drive by; `rear`: the topic of the rear one, where there is one."""
    if rear is not None:
        return InputError(
            f"no front scanner in the log, {rear} is the rear one; to drive by it, name it: --topic front={rear}"
        )
    listed = ", ".join(f"{info.name} ({info.type_name})" for info in topics.values()) or "no topic at all"
    return InputError(f"no scanner in the log: it has {listed}; a {SCAN} or {CLOUD} topic is needed")
