"""Types of cyclonedds from those of rosbags: enough to match a writer's type; what comes is handed on as bytes."""

from __future__ import annotations

from functools import cache
from typing import Any

from cyclonedds.idl import IdlStruct, make_idl_struct, types
from rosbags.interfaces import Nodetype

from lhdmap.live.zenoh_keys import dds_type
from lhdmap.logs.ros_messages import field_definitions

_array: Any = types.array
_sequence: Any = types.sequence
_BASE: dict[str, Any] = {
    "bool": bool,
    "byte": types.byte,
    "char": types.char,
    "string": str,
    **{name: getattr(types, name) for name in ("int8", "uint8", "int16", "uint16", "int32", "uint32")},
    **{name: getattr(types, name) for name in ("int64", "uint64", "float32", "float64")},
}


class Raw:
    """The bytes of a sample, with the encapsulation header before them, as ROS 2 logs have them."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.sample_info: Any = None  # cyclonedds sets it


def raw_type(type_name: str) -> type[IdlStruct]:
    """Return the class of a ROS 2 type whose samples come as `Raw`."""
    made = struct_of(type_name)
    made.deserialize = classmethod(lambda _cls, data, **_: Raw(bytes(data)))
    return made


@cache
def struct_of(type_name: str) -> Any:
    """Return the class of a ROS 2 type, as a writer uses it."""
    fields = {name: _field(kind) for name, kind in field_definitions(type_name)}
    plain = dds_type(type_name).replace("::", ".")
    return make_idl_struct(type_name.replace("/", "_"), plain, fields)


def _field(kind: Any) -> Any:
    node, what = kind
    if node == Nodetype.BASE:
        return _BASE[what[0]]
    if node == Nodetype.NAME:
        return struct_of(what)
    inner, count = what
    return _array[_field(inner), count] if node == Nodetype.ARRAY else _sequence[_field(inner)]
