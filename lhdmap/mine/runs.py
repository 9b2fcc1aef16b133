"""What a route is driven as: ways along tubes, one after the other, that end and begin where the turns between them do."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from lhdmap.mine.network import Network
from lhdmap.mine.polyline import on_line


class Run(NamedTuple):
    """A way along a tube, of the leading axle: from and to (m), and the gear; `stop` names the place that it ends at."""

    tube: int
    from_m: float
    to_m: float
    gear: int
    stop: str = ""


def joined(runs: Iterable[Run]) -> list[Run]:
    """Return runs of which those that go on in the same tube are one."""
    found: list[Run] = []
    for run in runs:
        before = found[-1] if found else None
        if before is not None and not before.stop and before.tube == run.tube and before.gear == run.gear:
            found[-1] = before._replace(to_m=run.to_m, stop=run.stop)
        else:
            found.append(run)
    return found


def trimmed(network: Network, runs: list[Run]) -> list[Run]:
    """Return runs that end and begin where the turns between them do; who stands in a turn begins there."""
    found: list[Run | None] = list(runs)
    for k, run in enumerate(runs):
        turn = network.tubes[run.tube]
        if turn.kind != "turn":
            continue
        for near in (k - 1, k + 1):
            other = found[near] if 0 <= near < len(runs) else None
            if other is None or other.gear != run.gear or network.tubes[other.tube].kind == "turn":
                continue
            line, sign = network.tubes[other.tube].line, 1.0 if other.to_m > other.from_m else -1.0
            cut_m = float(on_line(line, turn.pose(run.from_m if near < k else run.to_m)[:3])[0])
            shorter = other._replace(to_m=cut_m) if near < k else other._replace(from_m=cut_m)
            if (shorter.to_m - shorter.from_m) * sign > 0.0:
                found[near] = shorter
                continue
            there = other.from_m if near < k else other.to_m
            at_m = float(on_line(turn.line, line.at(np.array([there]))[0, :3])[0])
            found[near] = None
            mine = found[k] or run
            stop = mine.stop or other.stop
            found[k] = mine._replace(from_m=at_m) if near < k else mine._replace(to_m=at_m, stop=stop)
    return [run for run in found if run is not None]
