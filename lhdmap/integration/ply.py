"""PLY files: written as the contract says (binary little endian), read in all three encodings.

PLY has no 64-bit integer, and a double keeps a 19-digit stamp only to 128 ns. So the stamp is written as
`double stamp_ns`, which every reader understands, and `int stamp_rest_ns`, which a reader that wants the exact
nanosecond adds: int(stamp_ns) + stamp_rest_ns. Only float, double and int are written: Open3D warns of other types.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.integration.cloud import Cloud
from lhdmap.integration.cloud_fields import PLY_NAMES, Table, binary_table, cloud_of, table_of, text_table

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
WRITTEN = {"f4": "float", "f8": "double", "i4": "int", "u4": "int"}
ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
LARGEST_HEADER = 1 << 20


def write_ply(path: Path, cloud: Cloud) -> None:
    """Write a binary PLY with what the cloud has of x y z nx ny nz curvature stamp_ns stamp_rest_ns hits."""
    table = table_of(cloud, PLY_NAMES, [("stamp_ns", "<f8"), ("stamp_rest_ns", "<i4")])
    if cloud.stamps_ns is not None:
        table["stamp_ns"] = cloud.stamps_ns
        table["stamp_rest_ns"] = cloud.stamps_ns - table["stamp_ns"].astype(np.int64)
    lines = ["ply", "format binary_little_endian 1.0", "comment lhdmap: metres, frame map"]
    if cloud.stamps_ns is not None:
        lines.append("comment exact time in nanoseconds = int(stamp_ns) + stamp_rest_ns")
    lines.append(f"element vertex {len(cloud)}")
    lines += [f"property {WRITTEN[table.dtype[name].str[1:]]} {name}" for name in table.dtype.names or ()]
    with path.open("wb") as file:
        file.write(("\n".join([*lines, "end_header"]) + "\n").encode("ascii"))
        file.write(table.tobytes())


def read_ply(path: Path) -> Cloud:
    """Return the vertices of a PLY file (text, little or big endian); faces and unknown properties are passed over.

    Raises:
        InputError: it is no PLY file, or it is cut off or damaged.
    """
    data = path.read_bytes()
    header = _header(path, data)
    body = memoryview(data)[header.length :]
    if header.encoding == "ascii":
        table = text_table(path, bytes(body), header.dtype, header.points)
    else:
        table = binary_table(path, body, header.dtype, header.points)
    return cloud_of(path, table, _stamps(table))


class _Header(NamedTuple):
    length: int
    encoding: str
    points: int
    dtype: np.dtype[np.void]


def _header(path: Path, data: bytes) -> _Header:
    if not data.startswith((b"ply\n", b"ply\r")):
        raise InputError(f"{path}: no PLY file (it does not begin with 'ply')")
    end = data.find(b"end_header", 0, LARGEST_HEADER)
    newline = data.find(b"\n", end) if end >= 0 else -1
    if newline < 0:
        raise InputError(f"{path}: the PLY header has no end; the file is cut off or damaged")
    lines = [line.split() for line in data[:end].decode("ascii", errors="replace").splitlines()[1:]]
    lines = [line for line in lines if line and line[0] in ("format", "element", "property")]
    encoding = next((line[1] for line in lines if line[0] == "format" and len(line) > 1), "")
    if encoding not in ORDERS:
        raise InputError(f"{path}: PLY format '{encoding}'; one of {', '.join(ORDERS)} was wanted")
    count, fields = _vertex(path, lines, ORDERS[encoding])
    if count > len(data):  # each point takes a byte at least: no room is made for what cannot be there
        raise InputError(f"{path}: the header promises {count} points, the file has {len(data)} bytes")
    return _Header(newline + 1, encoding, count, np.dtype(fields))


def _vertex(path: Path, lines: list[list[str]], order: str) -> tuple[int, list[tuple[str, str]]]:
    """Return the number of vertices and their fields; the vertex element has to come first, as all writers do."""
    elements = [i for i, line in enumerate(lines) if line[0] == "element"]
    if not elements or lines[elements[0]][1:2] != ["vertex"]:
        raise InputError(f"{path}: the first element of the PLY file is not 'vertex'")
    first, last = elements[0], elements[1] if len(elements) > 1 else len(lines)
    fields = []
    for line in lines[first + 1 : last]:
        if line[0] != "property" or len(line) != 3 or line[1] not in TYPES:
            raise InputError(f"{path}: '{' '.join(line)}' in the PLY header; a property of one number was wanted")
        fields.append((line[2], order + TYPES[line[1]]))
    words = lines[first]
    if len(words) != 3 or not words[2].isdigit() or len(words[2]) > 15:
        raise InputError(f"{path}: '{' '.join(words)}' in the PLY header; a number of points was wanted")
    if len({name for name, _ in fields}) != len(fields):
        raise InputError(f"{path}: a property stands twice in the PLY header")
    return int(words[2]), fields


def _stamps(table: Table) -> npt.NDArray[np.int64] | None:
    names = table.dtype.names or ()
    if "stamp_ns" not in names:
        return None
    stamps = np.nan_to_num(table["stamp_ns"]).clip(-9.2e18, 9.2e18).astype(np.int64)
    return stamps + table["stamp_rest_ns"].astype(np.int64) if "stamp_rest_ns" in names else stamps
