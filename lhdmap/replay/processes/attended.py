"""The station of a machine that somebody attends: nothing is armed and no request is answered but by his command."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lhdmap.console.attendant import COMMAND, PROCESS, Attendant
from lhdmap.console.messages import ANSWER, REARM, STOP, Ask, Command, Event, Outcome
from lhdmap.loading.assistance import ABORT, ANSWERS, GO_ON, Answer
from lhdmap.replay import journal as journals
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import MILLISECOND_NS, STATION_SAYS, Outgoing, Process, Received
from lhdmap.replay.processes.shown import READS, Shown
from lhdmap.replay.processes.told import Word
from lhdmap.replay.scenario import ModeAt
from lhdmap.simulation.history import SECOND_NS, START_NS

_WORD_NS = 100 * MILLISECOND_NS
_NO_TRUTH = ("engine", "faults", "monitor", "plant", "driver")
_NAVIGATION = "navigation"


class Attended(Process):
    """The machine's end of a console's link, a terminal, or a record. It is on the machine: its link is real, not simulated.

    `modes`: what is wanted from when on, as of the scripted station. Each command goes into the journal as it was given: with
    `Recorded` a run can be done again.
    """

    name, period_ns, priority = PROCESS, 20 * MILLISECOND_NS, 30
    reads = READS

    def __init__(self, attendant: Attendant, modes: Sequence[ModeAt], shown: Shown, scribe: Scribe) -> None:
        self._attendant, self._shown, self._scribe = attendant, shown, scribe
        self._modes = list(modes)
        self._wanted = self._modes.pop(0)
        self._said_ns = 0
        self._asked: Ask | None = None
        self._goes_on = False
        self._gave_up = ""

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Show what is, take what is commanded, and say it to the machine."""
        for received in inbox:
            self._shown.take(received)
        while self._modes and now_ns - START_NS >= self._modes[0].at_s * SECOND_NS:
            self._wanted = self._modes.pop(0)
            self._scribe.event("wants", "scenario", mode=self._wanted.mode, goal=self._wanted.goal)
        self._open(self._shown.request())
        commands = self._attendant.attend(now_ns, self._shown.status(now_ns), self._asked)
        for command in commands:
            yield Outgoing(STATION_SAYS, self._obey(command, now_ns))
        if commands or now_ns - self._said_ns >= _WORD_NS:
            self._said_ns = now_ns
            yield Outgoing(STATION_SAYS, self._word(now_ns))

    def heard(self, event: journals.Event) -> None:
        """Pass on what is written into the journal, but for what a machine does not know of itself."""
        if event.process in _NO_TRUTH:
            return
        what = f"{event.before} → {event.after}" if event.after else event.event
        text = f"{what}: {event.cause}" if event.cause else what
        grave = event.event in ("overrun", "inbox full") or "disarmed" in what
        self._attendant.notes(Event((event.t_ns - START_NS) / SECOND_NS, event.process, text[:500], grave))

    def _open(self, request: Ask | None) -> None:
        if request is not self._asked:
            self._asked, self._goes_on = request, False
            if request is not None:
                self._scribe.event("request", request.why, number=request.number, kind=request.kind)

    def _obey(self, command: Command, now_ns: int) -> Word:
        """Write a command down, and return what it is for the machine; one that does not fit is a sign of life alone."""
        values = {name: value for name, value in command._asdict().items() if name != "cause"}
        self._scribe.event(COMMAND, command.cause, **values)
        why = self._unfit(command)
        self._attendant.told(Outcome(command.id, not why, why))
        if why:
            self._scribe.event("refused", why, command=command.id)
            return Word(now_ns)
        if command.kind == STOP:
            return Word(now_ns, stop=command.cause or f"stopped by {command.by}")
        if command.kind == REARM:
            return Word(now_ns, mode=self._wanted.mode, rearm=True)
        return self._answer(command, now_ns)

    def _answer(self, command: Command, now_ns: int) -> Word:
        asked = self._asked
        assert asked is not None  # noqa: S101  # else the command is unfit
        if asked.kind == _NAVIGATION:
            self._goes_on = command.answer == GO_ON
            if command.answer == ABORT:
                self._gave_up = f"{command.by or 'the operator'} aborts: {asked.why}"
            return Word(now_ns, go_on=self._goes_on, gave_up=self._gave_up)
        return Word(now_ns, answer=Answer(self._shown.task_number, command.answer, by=command.by))

    def _unfit(self, command: Command) -> str:
        """Return why a command does not count."""
        health = self._shown.health
        if command.kind == REARM:
            if health is None or not health.standing:
                return "the machine moves" if health is not None else "the machine has said nothing yet"
            return "it is armed" if health.armed else ""
        if command.kind != ANSWER:
            return ""
        if self._asked is None or command.number != self._asked.number:
            return f"request {command.number} is not open"
        allowed = (GO_ON, ABORT) if self._asked.kind == _NAVIGATION else ANSWERS
        return "" if command.answer in allowed else f"'{command.answer}': {', '.join(allowed)} was wanted"

    def _word(self, now_ns: int) -> Word:
        """Return the sign of life, with what is wanted all the time."""
        health = self._shown.health
        if health is None:
            return Word(now_ns)
        wanted = ModeAt(mode="idle") if self._gave_up else self._wanted
        told = Word(now_ns, goal=wanted.goal, go_on=self._goes_on, gave_up=self._gave_up)
        if not health.armed:
            return told
        if health.mode != wanted.mode:
            return told._replace(mode=wanted.mode)
        if wanted.mode not in ("assisted", "teleoperated", "manual"):
            return told
        return told._replace(speed_mps=wanted.speed_kmh / 3.6, steering_rate_rps=wanted.steering_rps)
