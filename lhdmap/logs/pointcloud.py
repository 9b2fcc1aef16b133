"""`sensor_msgs/PointCloud2` to a `PointCloud`: any order of fields, time fields of the usual drivers (`cloud_times`)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.logs.cloud_times import CloudTimes
from lhdmap.logs.cursor import UINT8, Cursor, FieldLayout
from lhdmap.messages import Message, PointCloud

_FIELD = FieldLayout("IB", 4)
_KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
_TIME_FIELDS = ("t", "time", "time_offset", "offset_time", "timestamp", "time_stamp", "timeStamp", "ts")


class _Shape(NamedTuple):
    height: int
    width: int
    point_step: int
    row_step: int


def point_cloud(cursor: Cursor, times: CloudTimes | None = None) -> tuple[Message, ...]:
    """Decode a cloud; points that are not finite, or at the scanner itself, are no returns and dropped with their times.

    `times` knows the times of the clouds before, and notes what is odd.

    Raises:
        InputError: no x, y, z, or sizes that do not fit the data.
    """
    stamp, frame = cursor.header()
    height, width = cursor.uint32(), cursor.uint32()
    fields = _fields(cursor)
    big = bool(cursor.numbers(UINT8)[0])
    shape = _Shape(height, width, cursor.uint32(), cursor.uint32())
    table = _table(cursor.view(), shape, fields, ">" if big else "<")
    points = np.stack([table[name].astype(np.float32) for name in "xyz"], axis=1)
    returned = np.asarray(np.isfinite(points).all(axis=1) & points.any(axis=1))
    field = _time_field(table)
    raw = np.empty(0) if field is None else table[field][returned]
    return (PointCloud(stamp, frame, points[returned], (times or CloudTimes()).seconds(raw, stamp, frame)),)


def _fields(cursor: Cursor) -> dict[str, tuple[int, int]]:
    fields = {}
    for _ in range(cursor.count(least_bytes=13)):
        name = cursor.text()
        offset, kind = cursor.numbers(_FIELD)
        cursor.uint32()
        fields[name] = (int(offset), int(kind))
    known = {name: field for name, field in fields.items() if field[1] in _KINDS}
    if not {"x", "y", "z"} <= known.keys():
        raise InputError("a cloud without x, y, z")
    return known


def _table(data: memoryview, shape: _Shape, fields: dict[str, tuple[int, int]], order: str) -> npt.NDArray[Any]:
    """Return a structured array of all points, shape (height * width,)."""
    wanted = {name: field for name, field in fields.items() if name in ("x", "y", "z", *_TIME_FIELDS)}
    sizes = [offset + np.dtype(_KINDS[kind]).itemsize for offset, kind in wanted.values()]
    row_bytes = shape.width * shape.point_step
    row_step = shape.row_step if shape.height > 1 else row_bytes
    if max(sizes) > shape.point_step or row_bytes > row_step or shape.height * row_step > len(data):
        raise InputError(f"a cloud of {shape.height} x {shape.width} points in {len(data)} bytes")
    kind = np.dtype(
        {
            "names": list(wanted),
            "formats": [order + _KINDS[k] for _, k in wanted.values()],
            "offsets": [offset for offset, _ in wanted.values()],
            "itemsize": shape.point_step,
        }
    )
    if not shape.height * shape.width:
        return np.empty(0, kind)
    if row_step == row_bytes:
        return np.frombuffer(data, kind, shape.height * shape.width)
    rows = [np.frombuffer(data, kind, shape.width, row * row_step) for row in range(shape.height)]
    return np.concatenate(rows)


def _time_field(table: npt.NDArray[Any]) -> str | None:
    return next((name for name in _TIME_FIELDS if name in (table.dtype.names or ())), None)
