"""Nested settings files: one table of dataclasses says what may stand in a file, reads it, and prints it with its comments.

The root and all that is below it are frozen dataclasses. The type of a field says what it is in the file::

    @dataclass(frozen=True, slots=True)
    class MinePlan:
        name: str = setting("mine", doc="Name of the mine.")                         # name = "ring"
        walls: Walls = part(Walls)                                                   # [walls]
        drifts: tuple[Drift, ...] = part(tuple, key="drift")                         # [[drift]], as often as wanted
        bodies: dict[str, Box] = part(dict, key="body")                              # [body.cabin]
        joints: tuple[Joint, ...] = part(_table1, key="joint", names=("swing", …))   # [joint.swing], these names alone

Leaves are numbers, texts, lists, rows such as `[x, y, z]` (`tuple[tuple[float, float, float], ...]`), and `Profile`. A table
that is left out, or a key in it, keeps its default; lists of tables and tables by name are replaced as a whole. What a class
checks itself it says as ConfigError in `__post_init__`; the place is put before it.
"""

from __future__ import annotations

import dataclasses
import re
import types
import typing
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from lhdmap.errors import ConfigError
from lhdmap.settings import checked, comment_of, key_of, nearest, read_toml, toml_value

T = TypeVar("T")
_PLAIN_KEY = re.compile(r"[A-Za-z0-9_-]+")


def part(factory: Callable[[], Any], *, key: str = "", names: tuple[str, ...] = (), doc: str = "") -> Any:
    """Declare a table, a list of tables, or tables by name: its default, and its key in the file where that is another.

    `names`: of a tuple, the tables that it has, each once, by name instead of one after the other.
    """
    return dataclasses.field(default_factory=factory, metadata={"key": key, "names": names, "doc": doc})


def load_tree(kind: type[T], path: Path, what: str, default: T | None = None) -> T:
    """Return what a TOML file describes; `what` names it in an error, `default` is what it leaves out (else the class's).

    Raises:
        InputError: the file cannot be read or is not TOML.
        ConfigError: a key or a value is wrong; the place and, of a key, the nearest name are told.
    """
    table = read_toml(path, what)
    try:
        return tree_from(kind, table, default)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error


def tree_from(kind: type[T], table: Mapping[str, Any], default: T | None = None, without: Collection[str] = ()) -> T:
    """Build `kind` from the tables of a TOML file; keys in `without` are not known in this one.

    Raises:
        ConfigError: as `load_tree`.
    """
    return _loaded(kind, table, default, _Place(), without)


class _Place(NamedTuple):
    """Where in the file: `before` the keys (`[[drift]] 2: `), and the tables around them (`walls.`)."""

    before: str = ""
    dotted: str = ""

    def __str__(self) -> str:
        return f"{self.before}{self.dotted}".rstrip(":. ")

    def of(self, key: str) -> str:
        return f"{self.before}{self.dotted}{key}"

    def table(self, key: str) -> _Place:
        return self._replace(dotted=f"{self.dotted}{key}.")

    def item(self, key: str, number: int) -> _Place:
        return _Place(f"{self.before}[[{self.dotted}{key}]] {number}: ")


class _Shape(NamedTuple):
    """What a field is in the file; `kind`: the dataclass of its tables, None of a leaf."""

    form: str
    kind: Any = None


def _shape(hint: Any, field: dataclasses.Field[Any]) -> _Shape:
    if typing.get_origin(hint) in (types.UnionType, typing.Union):
        kinds = [one for one in typing.get_args(hint) if one is not types.NoneType]
        hint = kinds[0] if len(kinds) == 1 else hint
    args = typing.get_args(hint)
    if dataclasses.is_dataclass(hint):
        return _Shape("table", hint)
    if typing.get_origin(hint) is dict and dataclasses.is_dataclass(args[1]):
        return _Shape("by name", args[1])
    if typing.get_origin(hint) is tuple and dataclasses.is_dataclass(args[0]):
        return _Shape("named" if field.metadata.get("names") else "list", args[0])
    return _Shape("leaf")


def _loaded(kind: Any, table: Mapping[str, Any], default: Any, place: _Place, without: Collection[str] = ()) -> Any:
    fields = {key_of(field): field for field in dataclasses.fields(kind) if field.name not in without}
    hints = typing.get_type_hints(kind)
    for key, value in table.items():
        if key not in fields:
            what = "section" if _is_section(value) else "setting"
            name = f"{place.dotted}{key}"
            raise ConfigError(f"{place.before}unknown {what} '{name}'{nearest(key, fields)}")
    values = {
        fields[key].name: _value(hints[fields[key].name], fields[key], table[key], default, place)
        for key in fields
        if key in table
    }
    for key, field in fields.items():
        if default is None and key not in table and field.metadata.get("required"):
            raise ConfigError(f"{place.of(key)} is missing: {field.metadata['doc']}")
    try:
        return kind(**values) if default is None else dataclasses.replace(default, **values)
    except ConfigError as error:
        raise ConfigError(f"{place}: {error}" if str(place) else str(error)) from error


def _value(hint: Any, field: dataclasses.Field[Any], value: Any, default: Any, place: _Place) -> Any:
    key, shape = key_of(field), _shape(hint, field)
    before = None if default is None else getattr(default, field.name)
    match shape.form:
        case "table":
            return _loaded(shape.kind, _section(value, place.of(key)), before, place.table(key))
        case "by name":
            inner = place.table(key)
            tables = _section(value, place.of(key)).items()
            return {
                name: _loaded(shape.kind, _section(one, inner.of(name)), None, inner.table(name))
                for name, one in tables
            }
        case "named":
            return _named(shape.kind, field, _section(value, place.of(key)), before, place.table(key))
        case "list":
            tables_of = _sections(value, place.of(key))
            return tuple(_loaded(shape.kind, one, None, place.item(key, n)) for n, one in enumerate(tables_of, start=1))
    return checked(place.of(key), value, hint, field)


def _named(kind: Any, field: dataclasses.Field[Any], table: Mapping[str, Any], before: Any, place: _Place) -> Any:
    """Return the tables of a tuple that has them by name, each over its default."""
    names: tuple[str, ...] = field.metadata["names"]
    for name in table:
        if name not in names:
            raise ConfigError(f"{place.before}unknown section '{place.dotted}{name}'{nearest(name, names)}")
    if before is None:
        before = typing.cast("Callable[[], Any]", field.default_factory)()
    return tuple(
        _loaded(kind, _section(table.get(name, {}), place.of(name)), one, place.table(name))
        for name, one in zip(names, before, strict=True)
    )


def _is_section(value: Any) -> bool:
    return isinstance(value, Mapping) or (isinstance(value, list) and bool(value) and isinstance(value[0], Mapping))


def _section(value: Any, path: str) -> Mapping[str, Any]:
    if isinstance(value, Mapping):
        return value
    told = "several of it" if _is_section(value) else repr(value)
    raise ConfigError(f"{path} = {told}: a section [{path.rpartition(': ')[2]}] was wanted")


def _sections(value: Any, path: str) -> list[Mapping[str, Any]]:
    if isinstance(value, list) and all(isinstance(one, Mapping) for one in value):
        return value
    name = path.rpartition(": ")[2]
    told = f"one section [{name}]" if isinstance(value, Mapping) else f"{value!r}"
    raise ConfigError(f"{path} = {told}: [[{name}]] was wanted, once for each")


def tree_toml(tree: Any, header: str = "") -> str:
    """Print a tree as the TOML file that `load_tree` reads back, each value with meaning, unit and source as comments.

    In lists of tables the first has the comments.
    """
    return "\n".join(([header.rstrip("\n") + "\n"] if header else []) + list(_printed(tree, ())))


def _printed(tree: Any, path: tuple[str, ...], *, listed: bool = False, comments: bool = True) -> Iterator[str]:
    """Yield a table, and then the tables in it, each as one text."""
    hints = typing.get_type_hints(type(tree))
    shapes = [(field, _shape(hints[field.name], field)) for field in dataclasses.fields(tree)]
    leaves = [field for field, shape in shapes if shape.form == "leaf"]
    if leaves or listed:
        yield _table_text(tree, leaves, path, listed=listed, comments=comments)
    for field, shape in shapes:
        value = getattr(tree, field.name)
        if shape.form == "leaf" or value is None:
            continue
        for name, one in _tables(field, shape, value):
            first = shape.form != "list" or one is value[0]
            yield from _printed(one, (*path, *name), listed=shape.form == "list", comments=comments and first)


def _tables(field: dataclasses.Field[Any], shape: _Shape, value: Any) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield the path of each table of a field, and the table."""
    key = key_of(field)
    match shape.form:
        case "table":
            yield (key,), value
        case "by name":
            yield from (((key, name), one) for name, one in value.items())
        case "named":
            yield from (((key, name), one) for name, one in zip(field.metadata["names"], value, strict=True))
        case _:
            yield from (((key,), one) for one in value)


def _table_text(
    tree: Any, leaves: list[dataclasses.Field[Any]], path: tuple[str, ...], *, listed: bool, comments: bool
) -> str:
    name = ".".join(one if _PLAIN_KEY.fullmatch(one) else toml_value(one) for one in path)
    lines = [f"[[{name}]]" if listed else f"[{name}]"] if path else []
    doc = (type(tree).__doc__ or "").strip().splitlines()
    lines += [f"# {doc[0]}"] if doc and path and comments else []
    for field in leaves:
        value = getattr(tree, field.name)
        lines += [comment_of(field)] if comments and field.metadata.get("doc") else []
        unset = [f"# {key_of(field)} = …"] if comments else []
        lines += unset if value is None else [f"{key_of(field)} = {toml_value(value)}"]
    return "\n".join(lines) + "\n"
