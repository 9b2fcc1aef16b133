"""What of a map is written, in the frame that is wanted: its topology, free space and cloud."""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from lhdmap.errors import InputError
from lhdmap.exports.registration import GRID, Transform
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.cloud_fields import local_points
from lhdmap.integration.cloud_io import read_cloud
from lhdmap.json_files import read_json
from lhdmap.mapfolder import MapFolder
from lhdmap.messages import FloatArray
from lhdmap.topology.geojson import content_sha256, from_geojson
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.sheet import Sheet, read_sheets

MAP = "map"
TOPOLOGY, FREE_SPACE, CLOUD = "topology.geojson", "free_space.npz", "cloud.ply"
Table = Mapping[str, Any]


@dataclass(frozen=True)
class Content:
    """A map folder seen in one frame: in the grid with `T_grid_map`, in `map` without.

    `registration`: as GeoJSON's member has it, None where the map has none. Coordinates are float64 throughout.
    """

    folder: MapFolder
    registration: Table | None = None
    T_grid_map: Transform | None = None

    @property
    def frame(self) -> str:
        """Name of the frame that all coordinates are in."""
        return MAP if self.T_grid_map is None else GRID

    @cached_property
    def table(self) -> dict[str, Any]:
        """The topology as GeoJSON, with the registration.

        Raises:
            InputError: the map has no topology, or it is damaged.
        """
        table = table_in_map(self.folder)
        table = table if self.T_grid_map is None else moved_table(table, self.T_grid_map)
        member = table["lhdmap"] | {"frame": self.frame, "registration": self.registration}
        return table | {"lhdmap": member | {"content_sha256": content_sha256(table["features"])}}

    @cached_property
    def topology(self) -> TopologicalMap:
        """The topology; raises InputError as `table`."""
        return from_geojson(self.table, str(self.folder.path / TOPOLOGY))

    @cached_property
    def times_s(self) -> dict[tuple[str, str], float]:
        """What each connection costs, by the ids of its two points (s)."""
        rows = (one["properties"] for one in self.table["features"] if one["properties"]["kind"] == "connection")
        return {
            (str(row["from"]), str(row["to"])): float(row["cost_s"]) for row in rows if row.get("cost_s") is not None
        }

    @cached_property
    def sheets(self) -> list[Sheet]:
        """The free space of each level, always in `map`; raises InputError where it is missing or damaged."""
        return read_sheets(self.folder.file(FREE_SPACE))

    @cached_property
    def cloud(self) -> GridCloud:
        """The cloud; in the grid its points are about an origin of their own, so that float32 keeps their millimetres.

        Raises:
            InputError: the map has no cloud, or it is damaged.
        """
        path = self.folder.file(CLOUD)
        cloud = read_cloud(path)
        if self.T_grid_map is None:
            return cloud
        points, origin = local_points(path, self.T_grid_map.points(cloud.exact_m()), exact=True)
        normals = cloud.normals
        if normals is not None:
            normals = self.T_grid_map.directions(normals.astype(np.float64)).astype(np.float32)
        return replace(cloud, points_m=points, origin_m=origin, normals=normals, viewpoints_m=None)

    def in_frame(self, points_map: FloatArray) -> FloatArray:
        """Return points (…, 3) or (…, 2) of `map` in the frame that is written."""
        return points_map if self.T_grid_map is None else self.T_grid_map.points(points_map)


def table_in_map(folder: MapFolder) -> dict[str, Any]:
    """Return a map's `topology.geojson` with coordinates in `map`, also where the file has them in the grid.

    Raises:
        InputError: the map has no topology, or it is damaged.
    """
    path = folder.file(TOPOLOGY)
    table = read_json(path, "a topological map of lhdmap", "build the map again with lhdmap build-map")
    from_geojson(table, str(path))  # refuses what is damaged
    if table["lhdmap"].get("frame", MAP) != GRID:
        return table
    registration = table["lhdmap"].get("registration")
    if not isinstance(registration, Mapping):
        raise InputError(f"{path}: in the mine's grid, but without a registration; build the map again")
    from lhdmap.exports.registration import read_transform

    return moved_table(table, read_transform(registration, str(path)).inverse())


def moved_table(table: Table, transform: Transform) -> dict[str, Any]:
    """Return GeoJSON with all coordinates, node frames and headings moved."""
    moved = deepcopy(dict(table))
    turn_deg = math.degrees(transform.rotation_rad)
    for feature in moved["features"]:
        geometry, properties = feature["geometry"], feature["properties"]
        geometry["coordinates"] = _moved(geometry["coordinates"], transform)
        if "T_map_node" in properties:
            pose = transform.pose(np.array(properties["T_map_node"], dtype=float))
            properties["T_map_node"] = [*np.round(pose[:3], 4).tolist(), round(float(pose[3]), 6)]
        if "heading_deg" in properties:
            properties["heading_deg"] = round(math.remainder(properties["heading_deg"] + turn_deg, 360.0), 4)
    return moved


def _moved(coordinates: Any, transform: Transform) -> Any:
    """Return a position, or lists of them however deep, moved."""
    if coordinates and isinstance(coordinates[0], list):
        return [_moved(one, transform) for one in coordinates]
    return np.round(transform.points(np.array(coordinates, dtype=float)), 4).tolist() if coordinates else coordinates
