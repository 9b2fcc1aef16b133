"""Where the machine is on its layout: which edge, how far along, by pose or by the node that localization tells."""

from __future__ import annotations

import numpy as np

from lhdmap.haulage.along import Along
from lhdmap.haulage.layout import Layout
from lhdmap.haulage.machine import NOWHERE, HaulageMachine, Status
from lhdmap.haulage.mission_io import MissionInput
from lhdmap.haulage.states import MOVING, State

_CHAIN = 4  # so many edges ahead a node is looked for: nodes are short, and told once a scan
_TURN_RAD = 0.9


class Whereabouts:
    """Follows the machine over its edges."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._lines = [None if edge.line_m is None else edge.line_m[:, :2] for edge in layout.edges]
        self._along: Along | None = None
        self._pose: tuple[float, float, float] | None = None
        self._node = ""

    def moved(self, given: MissionInput) -> None:
        """Take where the machine is now; what is not finite is not taken."""
        self._node = self._layout.ids.get(given.node, given.node) or self._node
        if given.pose_map is not None and all(np.isfinite(given.pose_map)):
            self._pose = given.pose_map
            if self._along is not None:
                self._along.moved(*given.pose_map[:2])

    def begins(self, at: Status, before: Status) -> None:
        """Begin another edge."""
        line = self._lines[at.edge] if at.edge != NOWHERE and not at.ended else None
        self._along = None if line is None else Along(line)
        if self._along is not None and self._pose is not None and before.edge != NOWHERE:
            self._along.moved(*self._pose[:2])

    @property
    def to_go_m(self) -> float:
        """Way to the end of the edge; 0 where that is not known."""
        return 0.0 if self._along is None else max(self._along.length_m - self._along.at_m, 0.0)

    def crossed(self, machine: HaulageMachine, at: Status) -> bool:
        """Return whether the end of the edge is behind the machine: by the nodes where they are told, else by the pose."""
        edge = self._layout.edges[at.edge]
        if edge.kind == State.DOCK:
            return False  # that it is there, in tolerance, navigation tells
        if not self._node:
            return self._along is not None and self._pose is not None and self._along.ended
        if edge.node == self._node:
            return False
        ahead, nodes = at, []
        for _ in range(_CHAIN):
            following = machine.next_edge(ahead)
            if following is None:
                break
            nodes.append(self._layout.edges[following].node)
            ahead = ahead._replace(edge=following)
        return self._node in nodes

    def edge_now(self, machine: HaulageMachine, at: Status) -> int:
        """Return the edge that the machine is on: of those from whose end the goal can be reached the nearest one."""
        edges = self._layout.edges
        able = [k for k in range(len(edges)) if machine.has_route(at._replace(edge=k))]
        if self._node:
            able = [k for k in able if edges[k].node == self._node] or able
        if self._pose is None or not able:
            return able[0] if able else at.edge
        return min(able, key=self._off_m)

    def _off_m(self, k: int) -> float:
        """Return how far the machine is off an edge, a heading across it counted as metres (in either gear)."""
        line, pose = self._lines[k], self._pose
        if line is None or pose is None:
            return np.inf
        off = np.hypot(*(line - np.array(pose[:2])).T)
        near = int(np.argmin(off))
        step = line[min(near + 1, len(line) - 1)] - line[max(near - 1, 0)]
        turned = np.arctan2(step[1], step[0]) - pose[2]
        return float(off[near]) + 4.0 * float(abs(np.sin(turned))) + (0.0 if np.cos(turned) > 0.0 else 0.5)

    def place(self, at: Status) -> str:
        """Return the name of where the machine is: of the node, or of the point that it works or waits at."""
        if at.edge == NOWHERE:
            return self._node
        edge = self._layout.edges[at.edge]
        return (
            self._node
            if at.state in MOVING and not at.ended and self._node
            else edge.end
            if at.ended
            else edge.node or edge.end
        )

    def following(self, machine: HaulageMachine, at: Status) -> int | None:
        """Return the edge that would come next; None: none does."""
        return None if at.edge == NOWHERE or at.state == State.IDLE else machine.next_edge(at)
