"""GeoJSON of the topology, the contract's features in the frame that is written: positions have three numbers, rings run left."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.exports.content import Content
from lhdmap.exports.registration import GRID
from lhdmap.json_files import write_json
from lhdmap.topology.geojson import content_sha256


def write(content: Content, path: Path, at: Callable[[Path], Path]) -> dict[str, Any]:
    """Write the features; in the grid, headings get an azimuth beside them (clockwise from grid north)."""
    features = deepcopy(content.table["features"])
    for feature in features:
        properties = feature["properties"]
        if feature["geometry"]["type"] == "Polygon":
            height_m = properties["T_map_node"][2]
            feature["geometry"]["coordinates"] = [
                _ring(one, height_m)
                for one in feature["geometry"]["coordinates"]
                if one  # [] where its outline is not known
            ]
        if content.frame == GRID and "heading_deg" in properties:
            properties["azimuth_deg"] = round((90.0 - properties["heading_deg"]) % 360.0, 4)
    member = content.table["lhdmap"] | {"content_sha256": content_sha256(features)}
    write_json(at(path), content.table | {"lhdmap": member, "features": features})
    return dict(Counter(one["properties"]["kind"] for one in features))


def _ring(ring: list[list[float]], height_m: float) -> list[list[float]]:
    """Return a closed ring with heights, counter-clockwise as RFC 7946, Section 3.1.6, wants an outer one."""
    plan = np.array([position[:2] for position in ring], dtype=float)
    near = plan - plan[0]
    area = float(np.sum(near[:-1, 0] * near[1:, 1] - near[1:, 0] * near[:-1, 1]))
    ordered = plan if area >= 0.0 else plan[::-1]
    return [[*point, height_m] for point in ordered.tolist()]
