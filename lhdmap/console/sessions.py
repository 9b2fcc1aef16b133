"""Who is logged in, and who of them has the seat: one operates, the others watch. Time is an input."""

from __future__ import annotations

import hashlib
import secrets
from dataclasses import dataclass

from lhdmap.console.settings import ConsoleSettings

_MOST = 100
SEAT_SILENT_S = 5.0
"""A seat whose page has been silent for so long is free for others: the machines have stood for long."""


class Sessions:
    """Tokens of 256 bits by chance; what is kept is their hash. Nothing in a token could be forged."""

    def __init__(self, settings: ConsoleSettings) -> None:
        self._for_s = 3600.0 * settings.session_h
        self._names: dict[str, tuple[str, float]] = {}

    def open(self, name: str, now_s: float) -> str:
        """Return the token of a new session."""
        token = secrets.token_urlsafe(32)
        self._names[_hash(token)] = name, now_s
        while len(self._names) > _MOST:
            self._names.pop(next(iter(self._names)))
        return token

    def name(self, token: str | None, now_s: float) -> str:
        """Return whose session a token is; empty: nobody's."""
        name, since_s = self._names.get(_hash(token or ""), ("", 0.0))
        return name if name and now_s - since_s < self._for_s else ""

    def close(self, token: str | None) -> None:
        """End a session."""
        self._names.pop(_hash(token or ""), None)


@dataclass(slots=True)
class Seat:
    """Who operates, from which page, and when that page was last heard."""

    by: str = ""
    page: str = ""
    heard_s: float = 0.0

    def take(self, by: str, page: str, now_s: float) -> bool:
        """Sit down; False where somebody else sits there."""
        if self.page not in ("", page) and now_s - self.heard_s < SEAT_SILENT_S:
            return False
        self.by, self.page, self.heard_s = by, page, now_s
        return True

    def holds(self, by: str, page: str) -> bool:
        """Return whether this page of this operator has the seat."""
        return bool(page) and (self.by, self.page) == (by, page)

    def leave(self, page: str) -> bool:
        """Get up; False where another page sits there."""
        if not page or page != self.page:
            return False
        self.by = self.page = ""
        return True


def _hash(token: str) -> str:
    return hashlib.sha256(token.encode("utf-8", "replace")).hexdigest()
