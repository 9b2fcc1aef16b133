"""Warnings that are said once: the same words, or the same words of another name, become one line."""

from __future__ import annotations

import re
from collections.abc import Iterable

_NAME = re.compile(r"'[^']*'")


def said_once(texts: Iterable[str]) -> list[str]:
    """Return the texts in their order, each once; those that differ in one quoted name alone are joined, with all names."""
    names: dict[tuple[str, ...], list[str]] = {}
    for text in texts:
        found = _NAME.findall(text)
        pattern = tuple(_NAME.split(text)) if len(found) == 1 else (text,)
        listed = names.setdefault(pattern, [])
        if len(found) == 1 and found[0] not in listed:
            listed.append(found[0])
    return [", ".join(listed).join(pattern) if listed else pattern[0] for pattern, listed in names.items()]
