"""Who may operate: names with TOTP secrets (RFC 6238), in a file that only its owner reads. A code counts once."""

from __future__ import annotations

import hmac
import json
import os
import re
import secrets
from collections import deque
from pathlib import Path
from typing import Any

from lhdmap.console.settings import ConsoleSettings
from lhdmap.errors import InputError, UsageError
from lhdmap.extras import library

FILE, KEY_FILE, AUDIT_FILE = "operators.json", "machine.key", "audit.jsonl"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ._-]{0,39}")
_PERIOD_S = 30
_DRIFT = (-1, 0, 1)  # periods by which a telephone's clock may be off


class Operators:
    """Names, secrets, and the last period whose code each has used; written at each use, so that a restart forgets none."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE
        self._table: dict[str, dict[str, Any]] = {}
        if self._path.exists():
            self._table = _read(self._path)

    @property
    def names(self) -> list[str]:
        """All names."""
        return sorted(self._table)

    def add(self, name: str) -> str:
        """Add an operator, and return the address (otpauth://…) that his authenticator takes.

        Raises:
            UsageError: the name is taken, or none.
        """
        pyotp = library("pyotp")

        if not _NAME.fullmatch(name):
            raise UsageError(f"'{name}': a name of letters, digits, spaces and . _ - was wanted")
        if name in self._table:
            raise UsageError(f"operator '{name}' is there already; remove the name from {self._path} first")
        secret = pyotp.random_base32()
        self._table[name] = {"secret": secret, "used": 0}
        self._write()
        return pyotp.TOTP(secret).provisioning_uri(name=name, issuer_name="lhdmap console")

    def accepts(self, name: str, code: str, now_s: float) -> bool:
        """Return whether a code is that of an operator now, and later than the last one that he used."""
        pyotp = library("pyotp")

        entry = self._table.get(name)
        totp = pyotp.TOTP(pyotp.random_base32() if entry is None else entry["secret"])
        period = int(now_s // _PERIOD_S)
        fits = [period + k for k in _DRIFT if hmac.compare_digest(totp.generate_otp(period + k), code)]
        if entry is None or not fits or fits[-1] <= entry["used"]:
            return False
        entry["used"] = fits[-1]
        self._write()
        return True

    def _write(self) -> None:
        partial = self._path.with_name(f"partial.{self._path.name}")
        write_secret(partial, json.dumps(self._table, indent=1))
        partial.replace(self._path)


class Tries:
    """Counts wrong codes: of all names together, so that guessing at many is as slow as at one. Time is an input."""

    def __init__(self, settings: ConsoleSettings) -> None:
        self._most, self._window_s = settings.login_tries, settings.login_window_s
        self._wrong: deque[float] = deque(maxlen=settings.login_tries)

    def allowed(self, now_s: float) -> bool:
        """Return whether a code is looked at now."""
        return len(self._wrong) < self._most or now_s - self._wrong[0] >= self._window_s

    def wrong(self, now_s: float) -> None:
        """Count a wrong code."""
        self._wrong.append(now_s)


def machine_key(folder: Path, *, make: bool = False) -> str:
    """Return the key with which machines connect; `make` it where there is none.

    Raises:
        InputError: there is none.
    """
    path = folder / KEY_FILE
    if make and not path.exists():
        write_secret(path, secrets.token_hex(32))
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: the console's key for machines was wanted; `lhdmap console` makes it") from error


def write_secret(path: Path, text: str) -> None:
    """Write a file that only its owner reads."""
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    path.unlink(missing_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def _read(path: Path) -> dict[str, dict[str, Any]]:
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        return {str(name): {"secret": str(one["secret"]), "used": int(one["used"])} for name, one in table.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: the operators of a console were wanted: {error}") from error
