"""What a command says: results on standard output, notes, warnings and progress on standard error."""

from __future__ import annotations

import contextlib
import json
import math
import shutil
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeVar

from lhdmap.errors import LhdmapError
from lhdmap.names import shown

T = TypeVar("T")
STANDARD_OUTPUT = "standard output"
_TELLING_SHARE = 0.05  # before that the time is start-up (the first run compiles), and says nothing of the rest


class Console:
    """Prints for one command run; with `json` the standard output holds one JSON object and nothing else."""

    current: Console | None = None  # of the command that runs: Ctrl-C prints through it

    def __init__(self, *, json: bool = False, quiet: bool = False) -> None:
        self.json = json
        self.quiet = quiet
        self._warned: set[str] = set()
        self._values: dict[str, Any] = {}
        self._printed = False
        self._unended = False  # whether a status stands in the line of the cursor
        Console.current = self

    def note(self, text: str) -> None:
        """Print a line of information on standard error."""
        if not self.quiet:
            self._end_line()
            print(shown(text), file=sys.stderr)

    def ask(self, prompt: str) -> str:
        """Return a line that is typed after a prompt on standard error; raises EOFError where there is none any more."""
        print(shown(prompt), end="", file=sys.stderr, flush=True)
        return input()

    def status(self, text: str, *, terminal: bool) -> None:
        """Print how things are: on a terminal over the line before, up to its width; otherwise as a line of its own."""
        if self.quiet:
            return
        width = shutil.get_terminal_size().columns - 1
        line = f"\r{shown(text)[:width]:<{width}}" if terminal else shown(text)
        print(line, end="" if terminal else "\n", file=sys.stderr, flush=True)
        self._unended = terminal

    def _end_line(self) -> None:
        if self._unended:
            self._unended = False
            print(file=sys.stderr)

    def warn(self, text: str) -> None:
        """Print a warning once."""
        if text not in self._warned:
            self._warned.add(text)
            self._end_line()
            print(f"warning: {shown(text)}", file=sys.stderr)

    def usage(self, text: str) -> None:
        """Print how a command is called, before the error that says what is wrong with the call."""
        print(shown(text), file=sys.stderr)

    def result(
        self, values: Mapping[str, Any], text: str, *, failure: LhdmapError | None = None, at_once: bool = False
    ) -> None:
        """Print the result: the text, or with `--json` the object, when the command ends (`at_once` where it goes on).

        `failure`: why the exit code is not 0, for the object alone; the text says it in its own way.
        """
        self._values |= _plain(values)
        if failure is not None:
            self._values |= failure_of(failure.kind, str(failure), failure.exit_code)
        self._end_line()
        if not self.json:
            _out(shown(text))
        if at_once:
            self.close()
            sys.stdout.flush()

    def fail(self, kind: str, text: str, exit_code: int) -> None:
        """Print an error; with `--json` the object has it, beside what was found before."""
        self._values |= failure_of(kind, text, exit_code)
        with contextlib.suppress(OSError):  # nobody listens any more: the exit code says it
            print(f"lhdmap: {shown(text)}", file=sys.stderr)
            self.close()

    def close(self) -> None:
        """Print the JSON object, once."""
        if self.json and self._values and not self._printed:
            self._printed = True
            _out(json.dumps(self._values, allow_nan=False))

    def progress(self, items: Iterable[T], *, total: float, label: str, position: Any) -> Iterator[T]:
        """Yield `items`, showing rate and time left: a bar on a terminal, a plain line every 10 s otherwise.

        `position(item)` tells how much of `total` (any unit) is behind when the item arrives.
        """
        if self.quiet:
            yield from items
            return
        meter = _Meter(label, total, terminal=sys.stderr.isatty())
        for item in items:
            meter.at(position(item))
            yield item
        meter.close()


def _out(text: str) -> None:
    """Print on standard output; where that fails, the error says that it was this file."""
    try:
        print(text)
    except OSError as error:
        error.filename = STANDARD_OUTPUT
        raise


def failure_of(kind: str, message: str, exit_code: int) -> dict[str, Any]:
    """Return what `--json` prints of a failure."""
    return {"error": {"kind": kind, "message": message, "exit_code": exit_code}}


class _Meter:
    """A progress line that costs nothing between its updates."""

    def __init__(self, label: str, total: float, *, terminal: bool) -> None:
        self._label, self._total, self._terminal = shown(label), max(total, 1e-9), terminal
        self._start = self._shown = time.monotonic()
        self._interval = 0.2 if terminal else 10.0
        self._calls = 0

    def at(self, done: float) -> None:
        """Tell how much is behind; prints only when the interval is over."""
        self._calls += 1
        if self._calls & 63:
            return
        now = time.monotonic()
        if now - self._shown >= self._interval:
            self._shown = now
            self._show(min(max(done / self._total, 0.0), 1.0), now - self._start)

    def _show(self, share: float, elapsed_s: float) -> None:
        left = elapsed_s * (1.0 - share) / share if share > 0 else math.inf
        rate = share * self._total / elapsed_s if elapsed_s > 0 else 0.0
        text = f"{self._label}: {100 * share:3.0f} %"
        if share >= _TELLING_SHARE:
            text += f", {rate:.1f} x real time, {left:.0f} s left"
        print(
            f"\r{text}   " if self._terminal else text, end="" if self._terminal else "\n", file=sys.stderr, flush=True
        )

    def close(self) -> None:
        if self._terminal and self._shown > self._start:
            print(file=sys.stderr)


def _plain(value: Any) -> Any:
    """Return the value with numpy scalars and arrays as plain ones and what is not finite as null."""
    if isinstance(value, Mapping):
        return {shown(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, str):
        return shown(value)
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
