"""The header of a PLY file: lines that end with LF, CR LF or CR, elements with properties of one number or lists of them."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from lhdmap.errors import InputError

TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
LARGEST_HEADER = 1 << 20
_VERTEX = "vertex"


class Property(NamedTuple):
    """A property: its name in lower case, the type of its numbers, and, of a list, that of their count (else empty)."""

    name: str
    kind: str
    count_kind: str = ""


class Element(NamedTuple):
    """An element: how many of it the file has (`rows`), and of what properties each consists."""

    name: str
    rows: int
    properties: tuple[Property, ...]


class PlyHeader(NamedTuple):
    """Bytes of the header, encoding, and the elements up to the vertices, which are the last of them."""

    length: int
    encoding: str
    elements: tuple[Element, ...]


def read_header(path: Path, data: bytes) -> PlyHeader:
    """Return the header of a PLY file.

    Raises:
        InputError: it is none, has no end, or no vertices.
    """
    if not data.startswith((b"ply\n", b"ply\r")):
        raise InputError(f"{path}: no PLY file (it does not begin with 'ply')")
    lines, length = _lines(path, data)
    words = [line.split() for line in lines]
    words = [line for line in words if line and line[0] in ("format", "element", "property")]
    encoding = next((line[1] for line in words if line[0] == "format" and len(line) > 1), "")
    if encoding not in ORDERS:
        raise InputError(f"{path}: PLY format '{encoding}'; one of {', '.join(ORDERS)} was wanted")
    starts = [at for at, line in enumerate(words) if line[0] == "element"]
    blocks = [words[start:end] for start, end in pairwise([*starts, len(words)])]
    names = [" ".join(block[0][1:2]).lower() for block in blocks]
    if _VERTEX not in names:
        found = ", ".join(names) or "of no kind"
        raise InputError(f"{path}: the PLY file has elements {found}, not 'vertex': it holds no points")
    wanted = blocks[: names.index(_VERTEX) + 1]
    return PlyHeader(length, encoding, tuple(_element(path, block, ORDERS[encoding], len(data)) for block in wanted))


def _lines(path: Path, data: bytes) -> tuple[list[str], int]:
    """Return the lines of the header and its length; how its first line ends is how all do, as data follow the last one."""
    end = b"\r" if data[3:4] == b"\r" and data[4:5] != b"\n" else b"\n"
    lines: list[str] = []
    at = 0
    while at < LARGEST_HEADER:
        stop = data.find(end, at, LARGEST_HEADER)
        if stop < 0:
            break
        lines.append(data[at:stop].decode("ascii", errors="replace").strip())
        at = stop + 1
        if lines[-1] == "end_header":
            return lines, at
    raise InputError(f"{path}: the PLY header has no end (a line 'end_header'); the file is cut off or damaged")


def _element(path: Path, lines: list[list[str]], order: str, room: int) -> Element:
    words = lines[0]
    if len(words) != 3 or not words[2].isdigit() or len(words[2]) > 15:
        raise InputError(f"{path}: '{' '.join(words)}' in the PLY header; a number of points was wanted")
    name, count = words[1].lower(), int(words[2])
    if count > room:  # each takes a byte at least: no room is made for what cannot be there
        what = "points" if name == _VERTEX else f"of '{name}'"
        raise InputError(f"{path}: the header promises {count} {what}, the file has {room} bytes")
    properties = tuple(_property(path, line, order) for line in lines[1:])
    if len({one.name for one in properties}) != len(properties):
        raise InputError(f"{path}: a property stands twice in the PLY header")
    return Element(name, count, properties)


def _property(path: Path, words: list[str], order: str) -> Property:
    kinds = [TYPES.get(word.lower(), "") for word in words[1:-1]]
    if words[0] == "property" and len(words) == 3 and kinds[0]:
        return Property(words[2].lower(), order + kinds[0])
    is_list = len(words) == 5 and words[1].lower() == "list" and words[4].lower() not in ("x", "y", "z")
    if words[0] == "property" and is_list and all(kinds[1:]) and kinds[1][0] != "f":
        return Property(words[4].lower(), order + kinds[2], order + kinds[1])
    raise InputError(f"{path}: '{' '.join(words)}' in the PLY header; a property of known types was wanted")
