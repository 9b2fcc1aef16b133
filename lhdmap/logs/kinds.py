"""One topic, several types (channels of one file, or several files): which one is meant."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from lhdmap.logs.base import TopicInfo
from lhdmap.logs.decoders import DECODERS
from lhdmap.roles import ROLES, TEXT

_BY_NAME = {(role.topic, role.type_name) for role in ROLES.values()}
_SENSORS = {role.type_name for role in ROLES.values()} - {TEXT}


def of_one_type(found: Iterable[TopicInfo]) -> tuple[dict[str, TopicInfo], list[str]]:
    """Return one entry for each topic, and what is said of entries of other types, which are not used.

    Messages count before none, the type of a role before others, what can be decoded before what cannot, then the most
    messages. Entries of one type are added up.
    """
    listed: dict[str, dict[str, TopicInfo]] = {}
    for info in found:
        kinds = listed.setdefault(info.name, {})
        before = kinds.get(info.type_name)
        kinds[info.type_name] = info if before is None else replace(info, count=_sum(before.count, info.count))
    chosen = {name: max(kinds.values(), key=_rank) for name, kinds in listed.items()}
    told = [
        f"{name}: also {other.count} message{'' if other.count == 1 else 's'} of type {other.type_name} on it, not used; "
        f"it is read as {chosen[name].type_name}"
        for name, kinds in listed.items()
        for other in kinds.values()
        if other is not chosen[name] and other.count != 0
    ]
    return chosen, told


def _rank(info: TopicInfo) -> tuple[bool, int, int]:
    if (info.name, info.type_name) in _BY_NAME:
        kind = 3
    elif info.type_name in _SENSORS:
        kind = 2
    else:
        kind = int(info.type_name in DECODERS)
    return info.count != 0, kind, info.count or 0


def _sum(first: int | None, second: int | None) -> int | None:
    return None if first is None or second is None else first + second
