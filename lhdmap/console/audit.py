"""Who commanded what, in a file that shows it where a line was changed: each line has the SHA-256 of the one before.

A line is on the disk before its command goes out. Cutting the last lines leaves a whole chain: so the hash of each
command's line is also in the machine's journal, where `kept` hashes are read from.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from lhdmap.errors import EvaluationShortfall, InputError

NOTHING = "0" * 64
"""What the first line has as the hash of the line before."""


class Chain(NamedTuple):
    """A whole file: how many lines, and the hash of the last."""

    lines: int
    head: str


class Audit:
    """Appends lines; what is there already is checked first.

    Raises:
        EvaluationShortfall: the file has been changed, or its last line is torn: it is kept, and another file is wanted.
        InputError: it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.touch(mode=0o600)
            self._chain = check(path)
            self._file = path.open("ab", buffering=0)
        except OSError as error:
            raise InputError(f"{path}: the audit cannot be written: {error.strerror}") from error

    @property
    def head(self) -> str:
        """Hash of the last line."""
        return self._chain.head

    def write(self, time_s: float, who: str, what: str, **more: Any) -> str:
        """Append a line, have it on the disk, and return its hash."""
        line = {"n": self._chain.lines + 1, "time_s": round(time_s, 3), "who": who, "what": what, **more}
        data = json.dumps(line | {"before": self._chain.head}, ensure_ascii=False, allow_nan=False).encode()
        self._file.write(data + b"\n")
        os.fsync(self._file.fileno())
        self._chain = Chain(self._chain.lines + 1, hashlib.sha256(data).hexdigest())
        return self._chain.head

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def check(path: Path, kept: Collection[str] = ()) -> Chain:
    """Return the chain of a file that is whole and has all lines whose hashes were `kept` elsewhere.

    Raises:
        InputError: there is no such file.
        EvaluationShortfall: it has been changed or cut; the line is told.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: an audit file was wanted: {error.strerror}") from error
    head, number, seen = NOTHING, 0, {NOTHING}
    for number, line in enumerate(_lines(path, data), start=1):
        if _before(line) != (number, head):
            raise EvaluationShortfall(
                f"{path}: line {number} does not follow from the line before: the audit was changed"
            )
        head = hashlib.sha256(line).hexdigest()
        seen.add(head)
    gone = [one for one in kept if one not in seen]
    if gone:
        raise EvaluationShortfall(
            f"{path}: {len(gone)} lines whose hashes were kept are not there, the first {gone[0]}"
        )
    return Chain(number, head)


def kept_in(journal: Path) -> list[str]:
    """Return the hashes of audit lines that a machine's journal has kept.

    Raises:
        InputError: it cannot be read, or is none.
    """
    try:
        lines = [json.loads(line) for line in journal.read_text(encoding="utf-8").splitlines()]
        found = [line["values"].get("audit", "") for line in lines]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{journal}: a journal.jsonl of a replay was wanted: {error}") from error
    return [one for one in found if one]


def _lines(path: Path, data: bytes) -> Iterator[bytes]:
    if data and not data.endswith(b"\n"):
        raise EvaluationShortfall(f"{path}: the last line is torn: keep the file, and name another one")
    return iter(data.splitlines())


def _before(line: bytes) -> tuple[Any, Any]:
    try:
        table = json.loads(line)
        return table["n"], table["before"]
    except (ValueError, KeyError, TypeError):
        return None, None
