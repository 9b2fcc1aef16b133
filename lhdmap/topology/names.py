"""Names of nodes: those that the operator said in the teaching drive, where they fit, else generated ones."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from lhdmap.messages import FloatArray
from lhdmap.topology.model import Purpose
from lhdmap.topology.nodes import RawMap

_FEWEST_M = 2.0  # of way under a name
_INSIDE_M = 1.0
_PATH_STEP_M = 0.25
_MOSTLY = 0.25
_PURPOSES: tuple[tuple[str, Purpose], ...] = (
    (r"dp|draw|extraction|xp", "draw_point"),
    (r"op|dump|dmp|orepass|crusher|tip", "dump"),
    (r"park|p(?=\d|$)", "park"),
    (r"tb|turn", "turning_bay"),
    (r"pb|pass", "passing_bay"),
)


class Place(NamedTuple):
    """A named stretch that is no node of its own: name, the tunnel that it is in, rows (N,) of the path."""

    name: str
    tunnel: int
    rows: npt.NDArray[np.int64]


class Names(NamedTuple):
    """Names of intersections and tunnels in their order, and the places within tunnels."""

    nodes: list[str]
    tunnels: list[str]
    places: list[Place]


def purpose_of(name: str) -> Purpose | None:
    """Return what a place of this name is for, by the usual abbreviations: DP, OP, P, TB, PB; None for any other."""
    low = name.lower()
    return next((purpose for pattern, purpose in _PURPOSES if re.match(pattern, low)), None)


def whereabouts(raw: RawMap, path: FloatArray) -> npt.NDArray[np.int64]:
    """Return the node of each pose of a path (M, 3): tunnels by their number, intersections by -1 - number."""
    points = [tunnel.line_m for tunnel in raw.tunnels]
    owner = [np.full(len(line), number) for number, line in enumerate(points)]
    for number, node in enumerate(raw.nodes):
        inner = [node.middle_m[None]]
        for tunnel, end in node.mouths:
            pose = raw.tunnels[tunnel].access[end]
            if pose is not None:
                share = np.linspace(0.0, 1.0, 12)[:-1, None]
                inner.append(node.middle_m + share * (pose[:3] - node.middle_m))
        points.append(np.vstack(inner))
        owner.append(np.full(len(points[-1]), -1 - number))
    tree = KDTree(np.vstack(points) * [1.0, 1.0, 2.0])
    found: npt.NDArray[np.int64] = np.concatenate(owner)[tree.query(path * [1.0, 1.0, 2.0])[1]]
    return found


def names_of(raw: RawMap, said: Sequence[str], where: npt.NDArray[np.int64]) -> Names:
    """Return the names; `said` (M) is what the operator called each pose of the path, empty where he said nothing."""
    counts: dict[int, Counter[str]] = defaultdict(Counter)
    for node, name in zip(where.tolist(), said, strict=True):
        if name:
            counts[node][name] += 1
    totals = Counter(name for name in said if name)
    tunnels = [_most(counts[number]) for number in range(len(raw.tunnels))]
    nodes = [_of_intersection(counts[-1 - number], totals, set(tunnels)) for number in range(len(raw.nodes))]
    places = _places(counts, tunnels, nodes, said, where)
    return Names(_unique(nodes, "I"), _unique(tunnels, "T"), places)


def _most(counter: Counter[str]) -> str:
    name, count = next(iter(counter.most_common(1)), ("", 0))
    return name if count * _PATH_STEP_M >= _FEWEST_M else ""


def _of_intersection(counter: Counter[str], totals: Counter[str], tunnels: set[str]) -> str:
    """Return the name that was said mostly in this intersection, and of no tunnel."""
    for name, count in counter.most_common():
        if name not in tunnels and count >= _MOSTLY * totals[name] and count * _PATH_STEP_M >= _INSIDE_M:
            return name
    return ""


def _places(
    counts: dict[int, Counter[str]],
    tunnels: list[str],
    nodes: list[str],
    said: Sequence[str],
    where: npt.NDArray[np.int64],
) -> list[Place]:
    """Return the stretches whose names are those of no node, each in the tunnel where it was said most."""
    used = {*tunnels, *nodes}
    found = []
    words = np.array(said, dtype=object)
    for name in dict.fromkeys(name for name in said if name and name not in used):
        within = {node: counter[name] for node, counter in counts.items() if counter[name] and node >= 0}
        if not within:
            continue
        tunnel = max(within, key=lambda node: within[node])
        found.append(Place(name, tunnel, np.flatnonzero((words == name) & (where == tunnel))))
    return found


def _unique(names: list[str], letter: str) -> list[str]:
    """Return names that differ: those that were said more than once are numbered, those that were not said get new ones."""
    often = Counter(names)
    used, counts, out = set(names), Counter[str](), []
    number = 0
    for name in names:
        if name and often[name] == 1:
            out.append(name)
        elif name:
            counts[name] += 1
            out.append(f"{name}.{counts[name]}")
        else:
            number += 1
            while f"{letter}{number}" in used:
                number += 1
            out.append(f"{letter}{number}")
    return out
