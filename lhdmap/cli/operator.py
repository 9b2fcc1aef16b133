"""An operator at a terminal: a request is shown with its evidence, he types what to do."""

from __future__ import annotations

from collections.abc import Callable

from lhdmap.loading.assistance import ANSWERS, Answer, Request

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
