"""`topology.geojson` of the map folder: the topological map as GeoJSON features (contract: topology), written and read back.

Coordinates are metres in `map`, or in the mine's grid where the member `lhdmap.registration` says so; never degrees on the globe.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from lhdmap.errors import InputError
from lhdmap.json_files import plain
from lhdmap.messages import FloatArray
from lhdmap.topology.model import (
    KINDS,
    AccessPoint,
    Connection,
    Intersection,
    Kind,
    Preference,
    Purpose,
    TopologicalMap,
    Tunnel,
    Waypoint,
)

FORMAT = 1
_WHAT_IS_WANTED = "build the map again with lhdmap build-map"


def to_geojson(topology: TopologicalMap, times_s: Mapping[tuple[str, str], float] | None = None) -> dict[str, Any]:
    """Return the feature collection; `times_s`: what each connection costs, by its points (else its length at its limit)."""
    times = times_s or {}
    features = [
        *map(_tunnel, topology.tunnels),
        *map(_intersection, topology.intersections),
        *map(_access_point, topology.access_points),
        *map(_waypoint, topology.waypoints),
        *(_connection(one, times.get((one.start, one.end), _plain_s(one))) for one in topology.connections),
    ]
    return {
        "type": "FeatureCollection",
        "lhdmap": {
            "format": FORMAT,
            "map_version": topology.version,
            "content_sha256": content_sha256(features),
            "frame": topology.frame,
            "coordinates": "metres in the frame named here, the mine's local grid; not longitude and latitude",
            "registration": plain(topology.registration) if topology.registration is not None else None,
            "remarks": list(topology.remarks),
        },
        "features": features,
    }


def content_sha256(features: list[dict[str, Any]]) -> str:
    """Return the hash of a map's features: the same map, the same hash."""
    text = json.dumps(plain(features), sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def from_geojson(table: Mapping[str, Any], where: str = "topology.geojson") -> TopologicalMap:
    """Return the topological map that a feature collection describes; `where` it stands is for the error.

    Raises:
        InputError: it is none of lhdmap's, of a newer format, or damaged.
    """
    member = table.get("lhdmap")
    if table.get("type") != "FeatureCollection" or not isinstance(member, Mapping):
        raise InputError(f"{where}: not a topological map of lhdmap; {_WHAT_IS_WANTED}")
    if member.get("format", FORMAT) > FORMAT:
        raise InputError(f"{where}: format {member['format']}, this software reads up to {FORMAT}; update it")
    found: dict[str, list[Any]] = {kind: [] for kind in _READERS}
    try:
        for feature in table["features"]:
            kind = feature["properties"]["kind"]
            if kind in found:
                found[kind].append(_READERS[kind](feature["properties"], feature["geometry"]["coordinates"]))
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(f"{where}: damaged ({type(error).__name__}: {error}); {_WHAT_IS_WANTED}") from error
    registration = member.get("registration")
    return TopologicalMap(
        tuple(found["tunnel"]),
        tuple(found["intersection"]),
        tuple(found["access_point"]),
        tuple(found["waypoint"]),
        tuple(found["connection"]),
        version=int(member.get("map_version", 1)),
        frame=str(member.get("frame", "map")),
        registration=registration,
        remarks=tuple(map(str, member.get("remarks", ()))),
    )


def _feature(kind: str, geometry: str, coordinates: Any, properties: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": geometry, "coordinates": coordinates},
        "properties": {"kind": kind, **properties},
    }


def _tunnel(one: Tunnel) -> dict[str, Any]:
    widths = one.widths_m
    return _feature(
        "tunnel",
        "LineString",
        _rounded(one.line_m),
        {
            "id": one.id,
            "name": one.name,
            "length_m": round(one.length_m, 3),
            "width_min_m": round(float(widths.min()), 3),
            "width_mean_m": round(float(widths.mean()), 3),
            "grade_max_pct": round(one.grade_max_pct, 2),
            "speed_limit_kmh": one.speed_limit_kmh,
            "wall_preference": one.wall_preference,
            "T_map_node": _pose(one.pose_map_node),
            "not_distinctive_m": [list(stretch) for stretch in one.not_distinctive_m],
            "ends": list(one.ends),
            "half_widths_m": np.round(one.half_widths_m, 3).tolist(),
            "driven": one.driven,
            "closed": one.closed,
        },
    )


def _intersection(one: Intersection) -> dict[str, Any]:
    ring = _rounded(np.vstack([one.outline_m, one.outline_m[:1]])) if len(one.outline_m) else []
    return _feature(
        "intersection",
        "Polygon",
        [ring],
        {
            "id": one.id,
            "name": one.name,
            "degree": one.degree,
            "T_map_node": _pose(one.pose_map_node),
            "level": one.level,
        },
    )


def _access_point(one: AccessPoint) -> dict[str, Any]:
    return _feature(
        "access_point",
        "Point",
        _rounded(one.pose[:3]),
        {"id": one.id, "node": one.node, "heading_deg": _degrees(one.pose[3]), "joins": one.joins},
    )


def _waypoint(one: Waypoint) -> dict[str, Any]:
    return _feature(
        "waypoint",
        "Point",
        _rounded(one.pose[:3]),
        {
            "id": one.id,
            "name": one.name,
            "node": one.node,
            "heading_deg": _degrees(one.pose[3]),
            "purpose": one.purpose,
            "speed_limit_kmh": one.speed_limit_kmh,
        },
    )


def _connection(one: Connection, time_s: float) -> dict[str, Any]:
    return _feature(
        "connection",
        "LineString",
        _rounded(one.line_m),
        {
            "from": one.start,
            "to": one.end,
            "type": one.kind,
            "length_m": round(one.length_m, 3),
            "min_radius_m": _finite(one.min_radius_m),
            "clearance_m": _finite(one.clearance_m),
            "speed_limit_kmh": one.speed_limit_kmh,
            "feasible": one.feasible,
            "closed": one.closed,
            "cost_s": round(time_s, 3),
            "reason": one.reason,
        },
    )


def _read_tunnel(properties: Mapping[str, Any], line: Any) -> Tunnel:
    first, second = properties["ends"]
    return Tunnel(
        str(properties["id"]),
        str(properties["name"]),
        (str(first), str(second)),
        _points(line),
        np.array(properties["half_widths_m"], dtype=float).reshape(-1, 2),
        np.array(properties["T_map_node"], dtype=float),
        bool(properties["driven"]),
        bool(properties["closed"]),
        float(properties["speed_limit_kmh"]),
        cast("Preference", properties["wall_preference"]),
        float(properties["grade_max_pct"]),
        tuple((float(a), float(b)) for a, b in properties["not_distinctive_m"]),
    )


def _read_intersection(properties: Mapping[str, Any], rings: Any) -> Intersection:
    ring = [point[:2] for point in (rings[0] if rings else ())]  # exports have heights
    outline = np.array(ring, dtype=float).reshape(-1, 2)[:-1]
    frame = np.array(properties["T_map_node"], dtype=float)
    degree, level = int(properties["degree"]), properties["level"]
    return Intersection(str(properties["id"]), str(properties["name"]), degree, frame, outline, level)


def _read_access_point(properties: Mapping[str, Any], point: Any) -> AccessPoint:
    joins = properties["joins"]
    return AccessPoint(
        str(properties["id"]),
        str(properties["node"]),
        _read_pose(point, properties["heading_deg"]),
        None if joins is None else str(joins),
    )


def _read_waypoint(properties: Mapping[str, Any], point: Any) -> Waypoint:
    return Waypoint(
        str(properties["id"]),
        str(properties["name"]),
        str(properties["node"]),
        _read_pose(point, properties["heading_deg"]),
        cast("Purpose", properties["purpose"]),
        float(properties["speed_limit_kmh"]),
    )


def _read_connection(properties: Mapping[str, Any], line: Any) -> Connection:
    if properties["type"] not in KINDS:
        raise ValueError(f"connection of type {properties['type']!r}")
    return Connection(
        str(properties["from"]),
        str(properties["to"]),
        cast("Kind", properties["type"]),
        _points(line),
        float(properties["length_m"]),
        _or_inf(properties["min_radius_m"]),
        _or_inf(properties["clearance_m"]),
        float(properties["speed_limit_kmh"]),
        bool(properties["feasible"]),
        bool(properties["closed"]),
        str(properties["reason"]),
    )


_READERS = {
    "tunnel": _read_tunnel,
    "intersection": _read_intersection,
    "access_point": _read_access_point,
    "waypoint": _read_waypoint,
    "connection": _read_connection,
}


def _plain_s(one: Connection) -> float:
    return one.length_m / (one.speed_limit_kmh / 3.6)


def _points(coordinates: Any) -> FloatArray:
    return np.array(coordinates, dtype=float).reshape(-1, 3)


def _read_pose(point: Any, heading_deg: float) -> FloatArray:
    x, y, z = map(float, point)
    return np.array([x, y, z, math.radians(heading_deg)])


def _rounded(values: FloatArray) -> Any:
    return np.round(values, 4).tolist()


def _pose(pose: FloatArray) -> list[float]:
    return [*_rounded(pose[:3]), round(math.remainder(float(pose[3]), 2.0 * math.pi), 6)]


def _degrees(angle_rad: float) -> float:
    return round(math.degrees(math.remainder(float(angle_rad), 2.0 * math.pi)), 4)


def _finite(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None


def _or_inf(value: float | None) -> float:
    return math.inf if value is None else float(value)
