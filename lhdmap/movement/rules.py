"""The six movement states of a point and the rules that join them: Tables 1 and 2 of the topological paper, Section 3.2.

A state is a pair: the motion along (+1) or against (-1) the point's heading, or none (0), and the machine's heading along or
against it. The gear is their product: forward where the machine moves the way it faces. All cells of both tables follow from that
pair and the type of the connection, but for four that the paper prints wrong (Back-to-Front of (v) and (vi) in both tables).
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from lhdmap.topology.model import Kind

Name = Literal["i", "ii", "iii", "iv", "v", "vi"]
STATE_COUNT = 6
STANDING_ALONG, STANDING_AGAINST = 4, 5
"""Indices of (v) and (vi)."""


class State(NamedTuple):
    """Motion along (+1), against (-1) or none (0), heading along (+1) or against (-1) the heading of the point."""

    motion: int
    heading: int

    @property
    def gear(self) -> int:
        """Forward (+1) or reverse (-1); 0 where the machine stands."""
        return self.motion * self.heading


STATES = (State(-1, -1), State(-1, 1), State(1, 1), State(1, -1), State(0, 1), State(0, -1))
NAMES: tuple[Name, ...] = ("i", "ii", "iii", "iv", "v", "vi")
_MOTION = {
    "front": (1, -1),
    "back": (-1, 1),
}  # along the heading, when the machine leaves there, and when it arrives there


def reversed_kind(kind: Kind) -> Kind:
    """Return the type of a connection that is driven from its end to its start."""
    turned: dict[Kind, Kind] = {"front_back": "back_front", "back_front": "front_back"}
    return turned.get(kind, kind)


def successors(origin: int, kind: Kind, *, within: bool) -> tuple[int, ...]:
    """Return the states (indices) at a connection's end that follow a state at its start.

    `within` a node (Table 1), or between an access point and its twin (Table 2), where a standing machine may go on standing.
    The machine leaves by the front when it moves along the heading, by the back against it, and keeps its gear; where it arrives
    moving it may stop as well.
    """
    leave, arrive = kind.split("_")
    leaving, arriving = _MOTION[leave][0], _MOTION[arrive][1]
    state = STATES[origin]
    if state.motion == -leaving:
        return ()
    heading = leaving * state.heading * arriving
    moving, standing = STATES.index(State(arriving, heading)), STATES.index(State(0, heading))
    return (moving,) if within and state.motion == 0 else (moving, standing)


def rule_pairs(kind: Kind, *, within: bool) -> list[tuple[int, int]]:
    """Return all pairs (state at the start, state at the end) that a connection of this type joins."""
    return [(origin, end) for origin in range(STATE_COUNT) for end in successors(origin, kind, within=within)]
