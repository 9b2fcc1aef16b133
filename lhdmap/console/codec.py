"""Messages to JSON and back. What comes in is checked against the types: nothing else passes."""

from __future__ import annotations

import functools
import json
import math
import types
import typing
from collections.abc import Sequence
from typing import Any

from lhdmap.console.messages import Message

T = typing.TypeVar("T")
MOST_CHARACTERS, MOST_ITEMS = 2000, 20_000
_WORDS = {bool: "true or false", int: "an integer", float: "a finite number", str: "a text"}


def encode(message: Message) -> str:
    """Return a message as one JSON object; `type` is its name.

    Raises:
        ValueError: a figure is not finite.
    """
    return json.dumps(plain(message), allow_nan=False, separators=(",", ":"))


def plain(message: Message) -> dict[str, Any]:
    """Return a message as the object that stands in the JSON."""
    return {"type": type(message).__name__.lower(), **_plain(message)}


def _plain(value: Any) -> Any:
    if hasattr(value, "_fields"):
        return {name: _plain(getattr(value, name)) for name in value._fields}
    return [_plain(item) for item in value] if isinstance(value, tuple) else value


def decode(text: str | bytes, allowed: Sequence[type[Message]]) -> Message:
    """Return the message that a JSON object is, if it is one of the `allowed` types.

    Raises:
        ValueError: it is none; what was found and what was wanted.
    """
    table = object_of(text)
    kinds = {kind.__name__.lower(): kind for kind in allowed}
    kind = kinds.get(table.pop("type", ""))
    if kind is None:
        raise ValueError(f"type: one of {', '.join(kinds)} was wanted")
    return typing.cast("Message", _record(kind, table, kind.__name__.lower()))


def read(kind: type[T], text: str | bytes) -> T:
    """Return a record (NamedTuple) of one kind, of a JSON object that has its fields.

    Raises:
        ValueError: it is none; what was found and what was wanted.
    """
    return typing.cast("T", _record(kind, object_of(text), kind.__name__.lower()))


def object_of(text: str | bytes) -> dict[str, Any]:
    """Return a JSON object.

    Raises:
        ValueError: it is not JSON, or something else than an object.
    """
    try:
        table = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError("not JSON") from error
    if not isinstance(table, dict) or not isinstance(table.get("type", ""), str):
        raise ValueError("a JSON object was wanted")
    return table


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    return typing.get_type_hints(kind)


def _record(kind: Any, table: Any, where: str) -> Any:
    if not isinstance(table, dict):
        raise ValueError(f"{where}: an object was wanted")
    hints = _hints(kind)
    unknown = sorted(set(table) - set(hints))
    missing = sorted(set(hints) - set(table) - set(kind._field_defaults))
    if unknown or missing:
        raise ValueError(f"{where}: {'unknown' if unknown else 'missing'} {', '.join(unknown or missing)[:100]}")
    return kind(**{name: _checked(hints[name], value, f"{where}.{name}") for name, value in table.items()})


def _checked(kind: Any, value: Any, where: str) -> Any:
    if isinstance(kind, types.UnionType):
        (inner,) = (one for one in typing.get_args(kind) if one is not type(None))
        return None if value is None else _checked(inner, value, where)
    if typing.get_origin(kind) is tuple:
        return _items(typing.get_args(kind), value, where)
    if hasattr(kind, "_fields"):
        return _record(kind, value, where)
    if kind is float and type(value) is int and abs(value) < 1e15:
        value = float(value)
    fits = type(value) is kind and not (kind is float and not math.isfinite(value))
    if not fits or (kind is str and len(value) > MOST_CHARACTERS) or (kind is int and abs(value) > 2**53):
        raise ValueError(f"{where}: {_WORDS[kind]} was wanted")
    return value


def _items(kinds: tuple[Any, ...], value: Any, where: str) -> tuple[Any, ...]:
    if not isinstance(value, list) or len(value) > MOST_ITEMS:
        raise ValueError(f"{where}: a list was wanted")
    if len(kinds) == 2 and kinds[1] is Ellipsis:
        return tuple(_checked(kinds[0], item, where) for item in value)
    if len(value) != len(kinds):
        raise ValueError(f"{where}: {len(kinds)} values were wanted")
    return tuple(_checked(kind, item, where) for kind, item in zip(kinds, value, strict=True))
