"""PCD files (version 0.7): written as binary, read as ascii, binary and binary_compressed."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.cloud_fields import PCD_NAMES, Table, binary_table, cloud_of, table_of, text_table

TYPES = {(kind, size): f"<{kind.lower()}{size}" for kind in "IU" for size in (1, 2, 4, 8)} | {
    ("F", 4): "<f4",
    ("F", 8): "<f8",
}
LARGEST_HEADER = 1 << 16
LZF_GROWTH = 264  # one pair of LZF bytes stands for 264 bytes at most


def write_pcd(path: Path, cloud: GridCloud) -> None:
    """Write a binary PCD: x y z normal_x normal_y normal_z curvature stamp_ns (int64) hits, as far as known."""
    table = table_of(cloud, PCD_NAMES, [("stamp_ns", "<i8")])
    if cloud.stamps_ns is not None:
        table["stamp_ns"] = cloud.stamps_ns
    names = table.dtype.names or ()
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        f"FIELDS {' '.join(names)}",
        f"SIZE {' '.join(str(table.dtype[name].itemsize) for name in names)}",
        f"TYPE {' '.join(table.dtype[name].kind.upper() for name in names)}",
        f"COUNT {' '.join('1' for _ in names)}",
        f"WIDTH {len(cloud)}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {len(cloud)}",
        "DATA binary",
    ]
    with path.open("wb") as file:
        file.write(("\n".join(lines) + "\n").encode("ascii"))
        file.write(table.tobytes())


def read_pcd(path: Path) -> GridCloud:
    """Return the points of a PCD file; unknown fields are passed over.

    Raises:
        InputError: it is no PCD file, or it is cut off or damaged.
    """
    data = path.read_bytes()
    header = _header(path, data)
    body = memoryview(data)[header.length :]
    if header.encoding == "ascii":
        table = text_table(path, bytes(body), header.dtype, header.points)
    elif header.encoding == "binary":
        table = binary_table(path, body, header.dtype, header.points)
    else:
        table = _decompressed(path, body, header)
    has_stamps = "stamp_ns" in (table.dtype.names or ()) and table.dtype["stamp_ns"].kind in "iu"
    return cloud_of(path, table, table["stamp_ns"].astype(np.int64) if has_stamps else None)


class _Header(NamedTuple):
    length: int
    encoding: str
    points: int
    dtype: np.dtype[np.void]


def _header(path: Path, data: bytes) -> _Header:
    end = data.find(b"\nDATA", 0, LARGEST_HEADER)
    newline = data.find(b"\n", end + 1) if end >= 0 else -1
    if newline < 0:
        raise InputError(f"{path}: no PCD file (no DATA line in its header), or it is cut off")
    lines = [line.split() for line in data[:newline].decode("ascii", errors="replace").splitlines()]
    entries = {line[0].upper(): line[1:] for line in lines if line and not line[0].startswith("#")}
    encoding = " ".join(entries.get("DATA", []))
    if encoding not in ("ascii", "binary", "binary_compressed"):
        raise InputError(f"{path}: PCD data '{encoding}'; ascii, binary or binary_compressed was wanted")
    try:
        dtype = _dtype(entries)
        count = int((entries.get("POINTS") or [])[0]) if "POINTS" in entries else _width_by_height(entries)
    except (KeyError, ValueError, IndexError, OverflowError):
        raise InputError(
            f"{path}: the PCD header (FIELDS, SIZE, TYPE, COUNT, POINTS) is incomplete or damaged"
        ) from None
    room = len(data) * (LZF_GROWTH if encoding == "binary_compressed" else 1)
    if not 0 <= count <= room:
        raise InputError(f"{path}: the header promises {count} points, the file has {len(data)} bytes")
    return _Header(newline + 1, encoding, count, dtype)


def _width_by_height(entries: dict[str, list[str]]) -> int:
    return int(entries["WIDTH"][0]) * int(entries["HEIGHT"][0])


def _dtype(entries: dict[str, list[str]]) -> np.dtype[np.void]:
    """Return the type of one point; padding fields (named `_`, several of them) get names of their own."""
    names, sizes, kinds = entries["FIELDS"], entries["SIZE"], entries["TYPE"]
    counts = entries.get("COUNT") or ["1"] * len(names)
    fields = []
    for number, (name, kind, size, width) in enumerate(zip(names, kinds, sizes, counts, strict=True)):
        if not 0 < int(width) < 10_000:
            raise ValueError(width)
        shape = () if int(width) == 1 else (int(width),)
        fields.append((f"_{number}" if name == "_" else name.lower(), TYPES[kind.upper(), int(size)], shape))
    return np.dtype(fields)


def _decompressed(path: Path, body: memoryview, header: _Header) -> Table:
    """Return the table of LZF data, in which each field stands by itself for all points."""
    wanted = header.points * header.dtype.itemsize
    sizes = np.frombuffer(body[:8] if len(body) >= 8 else bytes(8), dtype="<u4")
    if len(body) < 8 or len(body) - 8 < int(sizes[0]):
        raise InputError(f"{path}: cut off: the compressed block is not complete")
    if int(sizes[1]) < wanted or wanted > LZF_GROWTH * int(sizes[0]):
        raise InputError(f"{path}: damaged: {int(sizes[1])} bytes for {header.points} points, {wanted} were wanted")
    out = np.empty(wanted, dtype=np.uint8)
    if lzf_decompress(np.frombuffer(body[8 : 8 + int(sizes[0])], dtype=np.uint8), out) != wanted:
        raise InputError(f"{path}: damaged: the compressed block cannot be unpacked")
    table = np.zeros(header.points, dtype=header.dtype)
    at = 0
    for name in header.dtype.names or ():
        size = header.dtype[name].itemsize * header.points
        table[name] = out[at : at + size].view(header.dtype[name].base).reshape(table[name].shape)
        at += size
    return table


@nb.njit(cache=True, nogil=True)
def lzf_decompress(packed: npt.NDArray[np.uint8], out: npt.NDArray[np.uint8]) -> int:
    """Unpack LZF data into `out`; return the bytes written, or -1 where the data makes no sense.

    A control byte c < 32 is followed by c + 1 plain bytes; otherwise it is a copy of (c >> 5) + 2 bytes (7: one more
    byte adds to the length) from (c & 31) * 256 + next + 1 bytes back.
    """
    i, o = 0, 0
    while i < packed.shape[0] and o < out.shape[0]:
        control = int(packed[i])
        i += 1
        if control < 32:
            if i + control + 1 > packed.shape[0]:
                return -1
            length = min(control + 1, out.shape[0] - o)
            out[o : o + length] = packed[i : i + length]
            i += control + 1
            o += length
            continue
        length = (control >> 5) + 2
        extra = 1 if length == 9 else 0
        if i + extra >= packed.shape[0]:
            return -1
        if extra:
            length += int(packed[i])
        source = o - ((control & 31) << 8) - int(packed[i + extra]) - 1
        i += extra + 1
        if source < 0:
            return -1
        for k in range(min(length, out.shape[0] - o)):  # may overlap itself: byte by byte
            out[o + k] = out[source + k]
        o += min(length, out.shape[0] - o)
    return o
