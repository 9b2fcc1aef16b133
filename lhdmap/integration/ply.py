"""PLY files: written as the contract says (binary little endian), read in all three encodings.

PLY has no 64-bit integer, and a double keeps a 19-digit stamp only to 128 ns. So the stamp is written as
`double stamp_ns`, which every reader understands, and `int stamp_rest_ns`, which a reader that wants the exact
nanosecond adds: int(stamp_ns) + stamp_rest_ns. Only float, double and int are written: Open3D warns of other types.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.cloud_fields import PLY_NAMES, Table, binary_table, cloud_of, columns_of, table_of, text_table
from lhdmap.integration.ply_header import Element, read_header

WRITTEN = {"f4": "float", "f8": "double", "i4": "int", "u4": "int"}
LARGEST_LIST = 4096
COUNT = "number of "


def write_ply(path: Path, cloud: GridCloud, *, frame: str = "map") -> None:
    """Write a binary PLY with what the cloud has of x y z nx ny nz curvature stamp_ns stamp_rest_ns hits; `frame` it is in.

    A cloud with an origin of its own has x y z as double, with that origin added.
    """
    table = table_of(cloud, PLY_NAMES, [("stamp_ns", "<f8"), ("stamp_rest_ns", "<i4")])
    if cloud.stamps_ns is not None:
        table["stamp_ns"] = cloud.stamps_ns
        table["stamp_rest_ns"] = cloud.stamps_ns - table["stamp_ns"].astype(np.int64)
    lines = ["ply", "format binary_little_endian 1.0", f"comment lhdmap: metres, frame {frame}"]
    if cloud.stamps_ns is not None:
        lines.append("comment exact time in nanoseconds = int(stamp_ns) + stamp_rest_ns")
    lines.append(f"element vertex {len(cloud)}")
    lines += [f"property {WRITTEN[table.dtype[name].str[1:]]} {name}" for name in table.dtype.names or ()]
    with path.open("wb") as file:
        file.write(("\n".join([*lines, "end_header"]) + "\n").encode("ascii"))
        file.write(table.tobytes())


def read_ply(path: Path) -> GridCloud:
    """Return the vertices of a PLY file (text, little or big endian); faces and unknown properties are passed over.

    Raises:
        InputError: it is no PLY file, or it is cut off or damaged.
    """
    data = path.read_bytes()
    header = read_header(path, data)
    body = memoryview(data)[header.length :]
    for element in header.elements[:-1]:
        body = _behind(path, body, header.encoding, element)
    vertices = header.elements[-1]
    table = _table(path, body, header.encoding, vertices, _dtype(path, body, header.encoding, vertices))
    return cloud_of(path, table, _stamps(table))


def _behind(path: Path, body: memoryview, encoding: str, element: Element) -> memoryview:
    """Return what follows an element before the vertices, which is not needed itself."""
    dtype = _dtype(path, body, encoding, element)
    if encoding != "ascii":
        return body[len(_table(path, body, encoding, element, dtype)) * dtype.itemsize :]
    numbers = element.rows * columns_of(dtype)
    rest = bytes(body).split(None, numbers)[numbers:]
    return memoryview(rest[0] if rest else b"")


def _table(path: Path, body: memoryview, encoding: str, element: Element, dtype: np.dtype[np.void]) -> Table:
    """Return an element as a table.

    Raises:
        InputError: it is cut off, or its lists are not all of one length.
    """
    if encoding == "ascii":
        table = text_table(path, bytes(body), dtype, element.rows)
    else:
        table = binary_table(path, body, dtype, element.rows)
    for name in (one.name for one in element.properties if one.count_kind):
        if (table[COUNT + name] != dtype[name].shape[0]).any():
            raise InputError(
                f"{path}: the list '{name}' of its element '{element.name}' has not the same length everywhere; numbers, or lists "
                "of one length, were wanted: save the cloud without it"
            )
    return table


def _dtype(path: Path, body: memoryview, encoding: str, element: Element) -> np.dtype[np.void]:
    """Return the type of an element; a list is as long as the first one is, and its length stands before it."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    for one in element.properties:
        if one.count_kind:
            fields.append((COUNT + one.name, one.count_kind))
            length = _length(path, body, encoding, np.dtype(fields)) if element.rows else 0
            fields.append((one.name, one.kind, (length,)))
        else:
            fields.append((one.name, one.kind))
    return np.dtype(fields)


def _length(path: Path, body: memoryview, encoding: str, before: np.dtype[np.void]) -> int:
    """Return the length of a list in the first row, of which `before` is the type up to it."""
    name = (before.names or ())[-1]
    table = text_table(path, bytes(body), before, 1) if encoding == "ascii" else binary_table(path, body, before, 1)
    length = int(table[name][0])
    if not 0 <= length <= LARGEST_LIST:
        raise InputError(f"{path}: a list of {length} numbers in the PLY file; at most {LARGEST_LIST} was wanted")
    return length


def _stamps(table: Table) -> npt.NDArray[np.int64] | None:
    names = table.dtype.names or ()
    if "stamp_ns" not in names:
        return None
    stamps = np.nan_to_num(table["stamp_ns"]).clip(-9.2e18, 9.2e18).astype(np.int64)
    return stamps + table["stamp_rest_ns"].astype(np.int64) if "stamp_rest_ns" in names else stamps
