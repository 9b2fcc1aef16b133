"""What the machine must not touch, read from files: boxes of a TOML file, points of a cloud."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lhdmap.errors import InputError
from lhdmap.geometry import se3
from lhdmap.integration.cloud_io import read_cloud
from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.collision import Obstacles
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.settings import REQUIRED, check_corners, setting
from lhdmap.settings_tree import load_tree, part


@dataclass(frozen=True, slots=True)
class ObstacleBox:
    """A box in the base's frame."""

    min_m: tuple[float, float, float] = setting(REQUIRED, unit="m", doc="Lower corner (x, y, z).")
    max_m: tuple[float, float, float] = setting(REQUIRED, unit="m", doc="Upper corner (x, y, z).")

    def __post_init__(self) -> None:
        """Raise ConfigError where it has no inside."""
        check_corners(self.min_m, self.max_m)


@dataclass(frozen=True, slots=True)
class ObstacleFile:
    """A file of boxes."""

    boxes: dict[str, ObstacleBox] = part(dict, key="box")


def read_boxes(path: Path) -> Obstacles:
    """Return the boxes of a TOML file, a section `[box.NAME]` with `min_m` and `max_m` each.

    Raises:
        InputError: the file cannot be read, or holds no box.
        ConfigError: a key or value is wrong.
    """
    boxes = load_tree(ObstacleFile, path, "file of boxes").boxes
    if not boxes:
        raise InputError(
            f"{path}: the file holds no box: a section [box.NAME] with min_m and max_m for each was wanted"
        )
    corners = np.array([[box.min_m, box.max_m] for box in boxes.values()], dtype=float).reshape(-1, 2, 3)
    return Obstacles(corners, tuple(boxes))


def cloud_in_base(path: Path, machine: Rockbreaker) -> FloatArray:
    """Return the points (N, 3) of a cloud file in the base's frame, NaN and the machine's own post left out.

    Raises:
        InputError: the file cannot be read, or holds no point.
    """
    points = read_cloud(path).exact_m()
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        raise InputError(f"{path}: the cloud holds no point")
    T_base_cloud = se3.inverse(machine.T_cloud_base)
    in_base = points @ T_base_cloud[:3, :3].T + T_base_cloud[:3, 3]
    post_m = machine.links_m[0] + machine.joints[0].radius_m
    return np.asarray(in_base[np.hypot(in_base[:, 0], in_base[:, 1]) > post_m])
