"""What a reader notes while it reads: damage and remarks, each kind once with its count."""

from __future__ import annotations


class Findings:
    """Texts in order of appearance; a text that comes again is counted, so that a bad log gives few lines."""

    def __init__(self) -> None:
        self._counts: dict[str, int] = {}
        self._parts: dict[str, Findings] = {}

    def __len__(self) -> int:
        return len(self._counts) + sum(len(part) for part in self._parts.values())

    def add(self, text: str) -> None:
        """Note `text` once more."""
        self._counts[text] = self._counts.get(text, 0) + 1

    def add_once(self, text: str) -> None:
        """Note `text` unless it is noted already: for what is met again whenever the same place is read."""
        self._counts.setdefault(text, 1)

    def part(self, name: str) -> Findings:
        """Return what notes for one file of several; its lines come with the file's name."""
        return self._parts.setdefault(name, Findings())

    def lines(self) -> list[str]:
        """Return the texts, each with how often it was noted where that is more than once."""
        own = [text if count == 1 else f"{text} ({count} times)" for text, count in self._counts.items()]
        return own + [f"{name}: {line}" for name, part in self._parts.items() for line in part.lines()]
