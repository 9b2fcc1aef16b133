"""Assistance: what is asked of an operator, with evidence, and what he may answer; the operator of replays.

An answer never moves the machine: it ends the assistance, and the task goes on through re-validation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from lhdmap.pile.result import PileEstimate

GO_ON, LOADED, ABORT = "go_on", "loaded", "abort"
"""Answers: look again and go on from there; the loading was finished by hand and is to be weighed; give up."""
ANSWERS = (GO_ON, LOADED, ABORT)


class Request(NamedTuple):
    """A request for help.

    Attributes:
        number: counts the requests of a mission, from 1; an answer names it.
        stamp_ns: when it was made.
        kind: `positioning` or `loading`, as in Fig. 6.
        during: the state that could not go on.
        why: why not.
        tried: what was tried in this mission, oldest first.
        evidence: names of what can be looked at (cloud, pile), and values of signals.
        asks: what the operator is asked to do.
    """

    number: int
    stamp_ns: int
    kind: str
    during: str
    why: str
    tried: tuple[str, ...]
    evidence: Mapping[str, str | float]
    asks: str


class Answer(NamedTuple):
    """What an operator answers to request `number`; `pile`: one that he has marked himself, in `odom`, where none was found."""

    number: int
    kind: str
    pile: PileEstimate | None = None
    by: str = ""


class Operator(Protocol):
    """Whoever helps: a console, a terminal, a script."""

    def answer(self, request: Request, now_ns: int) -> Answer | None:
        """Return what is answered to a request, None where it is not yet."""
        ...


class Reply(NamedTuple):
    """A line of a script: what is answered to a request whose `why` contains `about`, and how long he takes to."""

    about: str
    kind: str
    after_s: float = 20.0
    pile: PileEstimate | None = None


class ScriptedOperator:
    """Answers by a script: the first line that fits, each as often as it fits; without one he stays silent."""

    def __init__(self, replies: Sequence[Reply]) -> None:
        self._replies = tuple(replies)

    def answer(self, request: Request, now_ns: int) -> Answer | None:
        """Return what is answered to a request, None where it is not yet."""
        for reply in self._replies:
            if reply.about in request.why or reply.about == request.kind:
                due = now_ns - request.stamp_ns >= round(reply.after_s * 1e9)
                return Answer(request.number, reply.kind, reply.pile, "script") if due else None
        return None
