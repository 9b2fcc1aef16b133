"""GraphML of the graph of places (http://graphml.graphdrawing.org/specification.html): undirected, parallel edges with ids."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from lhdmap.exports.content import Content
from lhdmap.exports.places import Place, Way, places_graph

_TYPES = {bool: "boolean", int: "int", float: "double", str: "string"}
_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
_SCHEMA = "http://graphml.graphdrawing.org/xmlns"
Rows = list[tuple[dict[str, str], dict[str, Any]]]


def write(content: Content, path: Path, at: Callable[[Path], Path]) -> dict[str, Any]:
    """Write all places and ways, also those that are closed or cannot be driven: the attributes say so."""
    graph = places_graph(content.topology, content.times_s)
    names = [place.points[0].id for place in graph.places]
    nodes: Rows = [({"id": name}, _place(place)) for name, place in zip(names, graph.places, strict=True)]
    edges: Rows = [
        ({"id": f"e{k}", "source": names[way.start], "target": names[way.end]}, _way(way))
        for k, way in enumerate(graph.ways)
    ]
    root = ET.Element("graphml", {"xmlns": _SCHEMA})
    body = ET.Element("graph", {"id": "places", "edgedefault": "undirected"})
    keys = _keys(
        root,
        {"graph": [{"frame": content.frame}], "node": [row for _, row in nodes], "edge": [row for _, row in edges]},
    )
    root.append(body)
    _data(body, {"frame": content.frame}, keys["graph"])
    for tag, rows in (("node", nodes), ("edge", edges)):
        for attributes, values in rows:
            _data(ET.SubElement(body, tag, attributes), values, keys[tag])
    ET.indent(root, " ")
    ET.ElementTree(root).write(at(path), encoding="utf-8", xml_declaration=True)
    return {"nodes": len(nodes), "edges": len(edges)}


def _place(place: Place) -> dict[str, Any]:
    x, y, z, yaw = (float(value) for value in place.points[0].pose)
    return {
        "name": place.name,
        "kind": place.kind,
        "x_m": round(x, 4),
        "y_m": round(y, 4),
        "z_m": round(z, 4),
        "heading_deg": round(math.degrees(math.remainder(yaw, 2.0 * math.pi)), 4),
        "within": " ".join(one.node for one in place.points),
    }


def _way(way: Way) -> dict[str, Any]:
    one = way.connection
    return {
        "within": way.node,
        "type": one.kind,
        "length_m": float(one.length_m),
        "time_s": float(way.time_s),
        "min_radius_m": float(one.min_radius_m),
        "clearance_m": float(one.clearance_m),
        "speed_limit_kmh": float(one.speed_limit_kmh),
        "feasible": bool(one.feasible),
        "closed": bool(one.closed),
        "drivable": bool(way.drivable),
    }


def _keys(root: ET.Element, rows: Mapping[str, list[dict[str, Any]]]) -> dict[str, dict[str, str]]:
    """Declare the attributes of each kind of element, and return their keys by name."""
    keys: dict[str, dict[str, str]] = {kind: {} for kind in rows}
    for kind, of_kind in rows.items():
        for name, value in (of_kind[0] if of_kind else {}).items():
            keys[kind][name] = f"{kind}_{name}"
            names = {"id": keys[kind][name], "for": kind, "attr.name": name, "attr.type": _TYPES[type(value)]}
            ET.SubElement(root, "key", names)
    return keys


def _data(element: ET.Element, values: Mapping[str, Any], keys: Mapping[str, str]) -> None:
    """Write attributes; one that is infinite (a straight line's radius) is left out."""
    for name, value in values.items():
        if not isinstance(value, float) or math.isfinite(value):
            text = str(value).lower() if isinstance(value, bool) else _NOT_XML.sub(" ", str(value))
            ET.SubElement(element, "data", {"key": keys[name]}).text = text
