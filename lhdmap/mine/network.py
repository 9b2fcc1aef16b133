"""The network of a plan: tubes, the nodes where they meet, the edges between nodes, and the turns from branch to branch.

A node with more than two branches is an intersection; one with two joins drifts end to end; one with one is a dead end.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from lhdmap.messages import FloatArray
from lhdmap.mine.plan import MinePlan
from lhdmap.mine.tube import Tube


class Branch(NamedTuple):
    """A branch of a node: tube, where on it the node is (m), which way it leaves (1: with the centre line, -1: against it)."""

    tube: int
    s_m: float
    outward: int


class Node(NamedTuple):
    """Where tubes meet or end: name, position (3,), branches, radius of the wall at its corners (m)."""

    name: str
    position_m: FloatArray
    branches: tuple[Branch, ...]
    corner_m: float

    @property
    def degree(self) -> int:
        """Number of branches."""
        return len(self.branches)


class Edge(NamedTuple):
    """A piece of a tube between two nodes: from `start_m` at node `start` to `end_m` at node `end`."""

    tube: int
    start_m: float
    end_m: float
    start: int
    end: int

    @property
    def length_m(self) -> float:
        """Length, metres."""
        return self.end_m - self.start_m


class BranchTurn(NamedTuple):
    """The way from one branch of a node into another: how far from the node it begins and ends (m), its tube and radius (m).

    `tube` is -1 where the way goes straight on in the same tube.
    """

    node: int
    start: Branch
    end: Branch
    tube: int
    start_at_m: float
    end_at_m: float
    radius_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """A mine's network; `tubes` holds drifts and places first, then turns."""

    plan: MinePlan
    tubes: list[Tube]
    nodes: list[Node] = field(default_factory=list)
    edges: list[Edge] = field(default_factory=list)
    turns: list[BranchTurn] = field(default_factory=list)

    def tube(self, name: str) -> int:
        """Return the index of a drift or place that is a tube."""
        return next(k for k, tube in enumerate(self.tubes) if tube.name == name and tube.kind != "turn")
