"""An operator at a terminal: a request is shown with its evidence, he types what to do."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from lhdmap.console.messages import ANSWER, REARM, Ask, Command, Event, Outcome, Plan, Status
from lhdmap.errors import InputError
from lhdmap.loading.assistance import ANSWERS, Answer, Request

_LEAVE_NS, _AGAIN_NS = 5_000_000_000, 500_000_000
_LETTERS = {answer[0]: answer for answer in ANSWERS}


class TerminalOperator:
    """Asks once for each request, and waits for a line; what is no answer is asked again.

    `read` returns a line typed after a prompt, as `input` does; `show` prints a line. A line that cannot be read any more aborts.
    """

    def __init__(self, read: Callable[[str], str], show: Callable[[str], None]) -> None:
        self._read, self._show = read, show

    def answer(self, request: Request, now_ns: int) -> Answer | None:  # noqa: ARG002
        """Return what is typed."""
        for line in shown_lines(request):
            self._show(line)
        while True:
            try:
                typed = self._read(f"{', '.join(f'{key} = {answer}' for key, answer in _LETTERS.items())}: ")
            except EOFError:
                return Answer(request.number, "abort", by="terminal")
            word = typed.strip().lower()
            kind = word if word in ANSWERS else _LETTERS.get(word)
            if kind is not None:
                return Answer(request.number, kind, by="terminal")
            self._show(f"'{word}' is no answer")


def shown_lines(request: Request) -> list[str]:
    """Return the lines of a request."""
    lines = [
        f"request {request.number}: {request.kind} assistance during {request.during}",
        f"  why: {request.why}",
        f"  asks: {request.asks}",
        *(f"  tried: {one}" for one in request.tried),
    ]
    return lines + [
        f"  {name}: {value if isinstance(value, str) else format(value, '.4g')}"
        for name, value in request.evidence.items()
    ]


class TerminalAttendant:
    """Attends a machine at a terminal: its requests are answered and it is armed there. The machine's time waits meanwhile."""

    def __init__(self, read: Callable[[str], str], show: Callable[[str], None]) -> None:
        self._read, self._show = read, show
        self._operator = TerminalOperator(read, show)
        self._answered, self._count = 0, 0
        self._arms_until_ns, self._quiet_until_ns, self._next_ns = 0, 0, 0

    def shows(self, plan: Plan) -> None:
        """A terminal has no map."""

    def notes(self, event: Event) -> None:
        """Show what is grave."""
        if event.grave:
            self._show(f"{event.time_s:.1f} s {event.process}: {event.text}")

    def told(self, outcome: Outcome) -> None:
        """Show why something was not taken; an answer is asked for again."""
        if not outcome.taken:
            self._answered = 0
            self._show(outcome.why)

    def attend(self, now_ns: int, status: Status, request: Ask | None) -> Sequence[Command]:
        """Ask for an answer where there is a request, and for leave to arm where the machine stands disarmed."""
        if request is not None and request.number != self._answered:
            self._answered = request.number
            answer = self._operator.answer(_request(request, now_ns), now_ns)
            assert answer is not None  # noqa: S101  # a terminal waits
            return (self._command(ANSWER, answer.number, answer.kind),)
        if status.armed or not status.standing or not status.mode:
            self._arms_until_ns = 0 if status.armed else self._arms_until_ns
            return ()
        if now_ns > self._arms_until_ns and not self._may_arm(now_ns, status):
            return ()
        if now_ns < self._next_ns:
            return ()
        self._next_ns = now_ns + _AGAIN_NS
        return (self._command(REARM),)

    def _may_arm(self, now_ns: int, status: Status) -> bool:
        """Ask for leave to arm; it holds for a few seconds, since arming is refused until the pose is validated."""
        if now_ns < self._quiet_until_ns:
            return False
        self._show(f"{status.time_s:.1f} s, not armed: {'; '.join(status.causes)}")
        try:
            word = self._read("arm? y = yes, anything else = not yet: ")
        except EOFError as error:
            raise InputError("the terminal has ended: nobody arms the machine") from error
        if word.strip().lower() not in ("y", "yes"):
            self._quiet_until_ns = now_ns + _LEAVE_NS
            return False
        self._arms_until_ns = now_ns + _LEAVE_NS
        return True

    def _command(self, kind: str, number: int = 0, answer: str = "") -> Command:
        self._count += 1
        return Command(f"terminal-{self._count}", kind, number, answer, "terminal")


def _request(ask: Ask, now_ns: int) -> Request:
    return Request(ask.number, now_ns, ask.kind, ask.during, ask.why, ask.tried, dict(ask.evidence), ask.asks)
