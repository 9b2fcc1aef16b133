"""JSON files of results: numpy values, paths and tuples become what JSON knows, what is not finite becomes null."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.errors import InputError
from lhdmap.names import shown


def write_json(path: Path, values: Mapping[str, Any]) -> Path:
    """Write a table as a JSON file for people and programs, and return its path."""
    text = json.dumps(plain(values), indent=2, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")
    return path


def read_json(path: Path, what: str, advice: str) -> dict[str, Any]:
    """Return the table of a JSON file; `what` it should hold and the `advice` where it does not are for the error.

    Raises:
        InputError: the file is damaged or holds no table.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not {what} ({error}); {advice}") from error
    if not isinstance(found, dict):
        raise InputError(f"{path}: not {what} (no table in it); {advice}")
    return found


def plain(value: Any) -> Any:
    """Return a value as JSON knows it."""
    if isinstance(value, Mapping):
        return {shown(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, (np.generic, np.ndarray)):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, (bool, int, float)) else shown(value)
