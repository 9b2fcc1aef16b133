"""Typed settings: frozen dataclasses whose fields carry unit, source and meaning, read from TOML, unknown keys refused.

A stage declares its section next to its code::

    @dataclass(frozen=True, slots=True)
    class AttitudeSettings:
        lag_s: float = setting(0.1, unit="s", source="findings, section 1", doc="Lag of the inclinometer that is undone.")

`lhdmap.config` lists the sections, `load_section` fills one from a mapping, `section_toml` prints it.
"""

from __future__ import annotations

import dataclasses
import difflib
import tomllib
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from lhdmap.errors import ConfigError, InputError

T = TypeVar("T")


def setting(
    default: Any,
    *,
    doc: str,
    unit: str = "-",
    source: str = "lhdmap",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
) -> Any:
    """Declare one setting of a section: its default, unit, the source of the value, its meaning and its valid range."""
    meta = {"unit": unit, "source": source, "doc": doc, "minimum": minimum, "maximum": maximum, "choices": choices}
    return dataclasses.field(default=default, metadata=meta)


def load_section(kind: type[T], name: str, values: Mapping[str, Any]) -> T:
    """Build the section `kind` from `values` over its defaults.

    Raises:
        ConfigError: a key is unknown (the nearest name is given), or a value has the wrong type or range.
    """
    fields = {field.name: field for field in dataclasses.fields(kind)}  # type: ignore[arg-type]
    hints = typing.get_type_hints(kind)
    for key in values:
        if key not in fields:
            raise ConfigError(f"unknown setting '{name}.{key}'{nearest(key, fields)}")
    checked = {key: _checked(f"{name}.{key}", value, hints[key], fields[key]) for key, value in values.items()}
    return kind(**checked)


def read_toml(path: Path, kind: str) -> dict[str, Any]:
    """Return the table of a TOML file; `kind` says in an error what was expected, such as `machine file`.

    Raises:
        InputError: the file cannot be read or is not TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: not a readable {kind} ({error})") from error


def nearest(key: str, known: typing.Iterable[str]) -> str:
    """Return `; did you mean 'x'?` for the known name most like `key`, or the list of names where none is alike."""
    names = sorted(known)
    alike = difflib.get_close_matches(key, names, n=1)
    return f"; did you mean '{alike[0]}'?" if alike else f"; known: {', '.join(names)}"


def _checked(path: str, value: Any, hint: Any, field: dataclasses.Field[Any]) -> Any:
    value = _converted(path, value, hint)
    meta = field.metadata
    if meta.get("choices") and value not in meta["choices"]:
        raise ConfigError(f"{path} = {value!r}: one of {', '.join(meta['choices'])} was wanted")
    for item in value if isinstance(value, tuple) else (value,):
        low, high = meta.get("minimum"), meta.get("maximum")
        if isinstance(item, (int, float)) and ((low is not None and item < low) or (high is not None and item > high)):
            raise ConfigError(f"{path} = {value!r} is outside [{low}, {high}] {meta['unit']}")
    return value


def _converted(path: str, value: Any, hint: Any) -> Any:
    """Return `value` as the annotated type: int is taken for float, a list for a tuple; nothing else is bent."""
    origin = typing.get_origin(hint)
    if origin is tuple:
        args = typing.get_args(hint)
        if not isinstance(value, (list, tuple)):
            raise ConfigError(f"{path} = {value!r}: a list was wanted")
        inner = [args[0]] * len(value) if len(args) == 2 and args[1] is Ellipsis else list(args)
        if len(inner) != len(value):
            raise ConfigError(f"{path} has {len(value)} values: {len(inner)} were wanted")
        return tuple(_converted(path, item, kind) for item, kind in zip(value, inner, strict=True))
    if origin in (types.UnionType, typing.Union):
        raise ConfigError(f"{path}: a setting has one type")
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if not isinstance(value, hint) or (hint in (int, float) and isinstance(value, bool)):
        raise ConfigError(f"{path} = {value!r}: a value of type {hint.__name__} was wanted")
    if hint is float and value != value:
        raise ConfigError(f"{path} is not a number")
    return value


def section_toml(name: str, section: Any) -> str:
    """Print `section` as TOML: each value with its meaning, unit and source as comments."""
    lines = [f"[{name}]"]
    doc = (type(section).__doc__ or "").strip().splitlines()
    lines += [f"# {doc[0]}"] if doc else []
    for field in dataclasses.fields(section):
        meta = field.metadata
        lines.append(f"# {meta['doc']} Unit: {meta['unit']}. Source: {meta['source']}.")
        lines.append(f"{field.name} = {_toml(getattr(section, field.name))}")
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(value)
