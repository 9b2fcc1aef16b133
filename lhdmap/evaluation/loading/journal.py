"""Digs and weighings by the journal of a replay, which says them outright."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from lhdmap.errors import InputError
from lhdmap.evaluation.loading.loads import Attempt, Load

_PROCESS, _DIGS, _WEIGHS = "loading", "excavation", "payload_weighing"
_ENDS_LOAD = ("done", "aborted")


def loads_in(path: Path, name: str) -> list[Load]:
    """Return the loads of a `journal.jsonl`; none where it has no excavation.

    Raises:
        InputError: a line is not an event.
    """
    loads: list[Load] = []
    attempts: list[Attempt] = []
    first_ns, dig_ns, dug_ns = 0, 0, 0
    for event in _changes(path):
        now_ns, before, after = int(event["t_ns"]), event["from"], event["to"]
        first_ns = first_ns or now_ns
        if after == _DIGS:
            dig_ns, dug_ns = now_ns, 0
        if before == _DIGS:
            dug_ns = now_ns
            attempts.append(Attempt((dig_ns - first_ns) * 1e-9, (dug_ns - dig_ns) * 1e-9))
        if before == _WEIGHS and attempts:
            attempts[-1] = _weighed(attempts[-1], event.get("values") or {})
        if after in _ENDS_LOAD and attempts:
            loads.append(Load(name, tuple(attempts)))
            attempts = []
    if attempts:
        loads.append(Load(name, tuple(attempts)))
    return loads


def _weighed(attempt: Attempt, values: Mapping[str, Any]) -> Attempt:
    fill, std = (values.get(key) for key in ("fill", "fill_std"))
    return Attempt(
        attempt.begin_s,
        attempt.duration_s,
        float(fill) if isinstance(fill, (int, float)) else math.nan,
        float(std) if isinstance(std, (int, float)) else math.nan,
    )


def _changes(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the changes of state of the loading task."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        for line in lines:
            event = json.loads(line)
            if event.get("event") == "state" and event.get("process") == _PROCESS:
                yield event
    except (OSError, UnicodeDecodeError, ValueError, AttributeError) as error:
        raise InputError(f"{path}: not a readable journal ({error})") from error
