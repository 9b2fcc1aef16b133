"""Typed settings: frozen dataclasses whose fields carry unit, source and meaning, read from TOML, unknown keys refused.

A stage declares its section next to its code::

    @dataclass(frozen=True, slots=True)
    class AttitudeSettings:
        lag_s: float = setting(0.1, unit="s", source="measured: prototypes", doc="Lag of the inclinometer that is undone.")

`lhdmap.config` lists the sections, `load_section` fills one from a mapping, `section_toml` prints it.
"""

from __future__ import annotations

import dataclasses
import difflib
import itertools
import json
import math
import re
import tomllib
import types
import typing
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from lhdmap.errors import ConfigError, InputError

T = TypeVar("T")
Profile = float | tuple[tuple[float, float], ...]
"""One value, or `[[at, value], …]` with `at` rising: linear between, held before the first and after the last."""
REQUIRED: Any = object()
"""Default of a setting that must be given."""
_MOST_NAMES = 6
_ALIKE, _AS_GOOD = 0.6, 0.08  # likeness of two names, 0 to 1: from where on it counts, and how far behind the best


def setting(
    default: Any,
    *,
    doc: str,
    unit: str = "-",
    source: str = "lhdmap",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
    key: str = "",
) -> Any:
    """Declare one setting of a section: its default, unit, the source of the value, its meaning and its valid range.

    `default` may be `REQUIRED`; `key` is its name in a file, where that is not the field's.
    """
    meta = {"unit": unit, "source": source, "doc": doc, "minimum": minimum, "maximum": maximum, "choices": choices}
    meta |= {"key": key, "required": default is REQUIRED}
    if default is REQUIRED:
        return dataclasses.field(default_factory=_missing, metadata=meta)
    return dataclasses.field(default=default, metadata=meta)


def check_corners(min_m: tuple[float, ...], max_m: tuple[float, ...]) -> None:
    """Raise ConfigError where the corners of a box are not in order."""
    if any(low >= high for low, high in zip(min_m, max_m, strict=True)):
        raise ConfigError("each value of min_m must be below that of max_m")


def key_of(field: dataclasses.Field[Any]) -> str:
    """Return the name of a setting in a file."""
    return str(field.metadata.get("key") or field.name)


def _missing() -> Any:
    raise TypeError("a setting that has no default was not given")


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
    return kind(**{key: checked(f"{name}.{key}", value, hints[key], fields[key]) for key, value in values.items()})


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
    """Return `; did you mean …?` with the known names that are most like `key`, or the list of names where none is alike."""
    names = list(dict.fromkeys(known))
    alike = near_names(key, names)
    match alike:
        case []:
            return f"; known: {', '.join(sorted(names))}"
        case [name]:
            return f"; did you mean '{name}'?"
    return f"; did you mean one of {', '.join(alike)}?"


def figure(value: float) -> str:
    """Return a figure for a person: `39` for 39.0785, `12.5`, `0.35`."""
    if abs(value) >= 1e5 and math.isfinite(value):
        return f"{value:,.0f}"
    if not math.isfinite(value) or f"{value:g}" == f"{value:.3g}":
        return f"{value:g}"
    return f"{value:.0f}" if abs(value) >= 10.0 else f"{value:.2g}"


def near_names(key: str, known: typing.Iterable[str]) -> list[str]:
    """Return the known names that `key` may stand for: those that begin with it or have it as a part, else those spelt alike."""
    names, wanted = list(known), _words(key)
    text = "_".join(wanted)
    starts = [name for name in names if len(text) > 1 and "_".join(_words(name)).startswith(text)]
    parts = [name for name in names if name not in starts and wanted and set(wanted) <= set(_words(name))]
    if starts or parts:
        return (sorted(starts, key=len) + parts)[:_MOST_NAMES]
    likeness = {name: difflib.SequenceMatcher(None, text, "_".join(_words(name))).ratio() for name in names}
    best = max(likeness.values(), default=0.0)
    near = [name for name, ratio in likeness.items() if ratio >= max(_ALIKE, best - _AS_GOOD)]
    return sorted(near, key=lambda name: -likeness[name])[:_MOST_NAMES]


def _words(name: str) -> list[str]:
    return [part for part in re.split(r"[^a-z0-9]+", name.lower()) if part]


def checked(path: str, value: Any, hint: Any, field: dataclasses.Field[Any]) -> Any:
    """Return a value as the type `hint` of its setting; `path` names it in an error.

    Raises:
        ConfigError: it has the wrong type or range, or is none of the choices.
    """
    value = _converted(path, value, hint)
    meta = field.metadata
    for item in _items(value) if meta.get("choices") else ():
        if item not in meta["choices"]:
            raise ConfigError(f"{path} = {item!r}: one of {', '.join(meta['choices'])} was wanted")
    low, high = meta.get("minimum"), meta.get("maximum")
    for item in _items(_profile_values(path, value) if hint == Profile else value):
        if isinstance(item, (int, float)) and ((low is not None and item < low) or (high is not None and item > high)):
            raise ConfigError(
                f"{path} = {_told(value)} is outside its range: {_range(low, high, meta['unit'])} was wanted"
            )
    return value


def _items(value: Any) -> Iterator[Any]:
    """Yield a value, or those in a list of lists."""
    if isinstance(value, tuple):
        for item in value:
            yield from _items(item)
    else:
        yield value


def _profile_values(path: str, value: Any) -> tuple[float, ...]:
    """Return the values of a profile; raises ConfigError where it has none, or they are not in order."""
    if not isinstance(value, tuple):
        return (value,)
    places = [at for at, _ in value]
    if not places or any(after <= before for before, after in itertools.pairwise(places)):
        raise ConfigError(f"{path} = {toml_value(value)}: [[at, value], …] with rising 'at' was wanted")
    return tuple(one for _, one in value)


def _told(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else toml_value(value)


def _range(low: float | None, high: float | None, unit: str) -> str:
    """Return a range for a person: `0 m or more`."""
    after = "" if unit == "-" else f" {unit}"
    if high is None:
        return f"{low:g}{after} or more"
    return f"{high:g}{after} or less" if low is None else f"{low:g} to {high:g}{after}"


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
        kinds = [one for one in typing.get_args(hint) if one is not types.NoneType]
        lists = [one for one in kinds if typing.get_origin(one) is tuple]
        others = [one for one in kinds if one not in lists]
        return _converted(path, value, (lists or others if isinstance(value, list) else others or lists)[0])
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
        lines += [comment_of(field), f"{key_of(field)} = {toml_value(getattr(section, field.name))}"]
    return "\n".join(lines) + "\n"


def comment_of(field: dataclasses.Field[Any]) -> str:
    """Return the comment of a setting in a file: its meaning, unit and source."""
    meta = field.metadata
    return f"# {meta['doc']} Unit: {meta['unit']}. Source: {meta['source']}."


def toml_value(value: Any) -> str:
    """Return a value as it stands in a TOML file."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)
