"""How right a localization is: its rows against the truth, placed on the map so that the map's own drift does not count.

The truth of each scan is put onto the map by the nearest pose of the teaching drive: its truth against its place in the map
(`localization_findings`, "error is against the map"). With `globally` it is aligned once, at the start of the teaching drive.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from lhdmap.errors import InputError
from lhdmap.messages import FloatArray
from lhdmap.topology.lookup import Lookup
from lhdmap.topology.model import TopologicalMap
from lhdmap.trajectory import Trajectory

_HEIGHT = 2.0
_FALSE_M, _FALSE_DEG = 1.0, 10.0  # a fix farther off than that is of another place
_APART_NS = 60_000_000
_BOUNDARY_M = 2.0  # nearer to another node than this, either is right


class LocalizationTable(NamedTuple):
    """What of `localization.parquet` is judged: columns (N,)."""

    stamp_ns: npt.NDArray[np.int64]
    status: npt.NDArray[np.object_]
    node: npt.NDArray[np.object_]
    poses: FloatArray  # (N, 4): x, y, z, yaw
    deviations: FloatArray  # (N, 3): along, across, heading
    latency_ms: FloatArray

    @classmethod
    def of(cls, columns: Mapping[str, npt.NDArray[Any]]) -> LocalizationTable:
        """Return the table of the file's columns."""
        pose = [columns[name] for name in ("x_m", "y_m", "z_m", "yaw_rad")]
        std = [columns[name] for name in ("std_along_m", "std_across_m", "std_heading_rad")]
        return cls(
            columns["stamp_ns"].astype(np.int64),
            columns["status"],
            columns["node"],
            np.column_stack(pose).astype(float),
            np.column_stack(std).astype(float),
            columns["latency_ms"].astype(float),
        )


def planar(trajectory: Trajectory) -> FloatArray:
    """Return x, y, z, yaw (N, 4) of a trajectory."""
    x, y, z, w = trajectory.quaternions_xyzw.T
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.column_stack([trajectory.positions_m, yaw])


class MapTruth:
    """Puts true poses onto a map."""

    def __init__(self, teaching: Trajectory, in_map: Trajectory, *, globally: bool = False) -> None:
        """Pair the teaching drive's truth with its place in the map.

        Raises:
            InputError: they have no time in common.
        """
        keep = _covered(teaching.stamps_ns, in_map.stamps_ns)
        if not keep.any():
            raise InputError("the truth of the teaching drive and the map's trajectory have no time in common")
        self._truth, self._map = _at(teaching, in_map.stamps_ns[keep]), planar(in_map)[keep]
        if globally:
            self._truth, self._map = self._truth[:1], self._map[:1]
        self._tree = KDTree(self._truth[:, :3] * [1.0, 1.0, _HEIGHT])

    def placed(self, poses: FloatArray) -> FloatArray:
        """Return true poses (N, 4) as they lie on the map."""
        rows = self._tree.query(poses[:, :3] * [1.0, 1.0, _HEIGHT])[1]
        truth, place = self._truth[rows], self._map[rows]
        turn = place[:, 3] - truth[:, 3]
        off = poses[:, :2] - truth[:, :2]
        c, s = np.cos(turn), np.sin(turn)
        x = place[:, 0] + c * off[:, 0] - s * off[:, 1]
        y = place[:, 1] + s * off[:, 0] + c * off[:, 1]
        return np.column_stack([x, y, place[:, 2] + poses[:, 2] - truth[:, 2], poses[:, 3] + turn])


def evaluated(
    table: LocalizationTable,
    truth: Trajectory,
    map_truth: MapTruth,
    nodes: Mapping[int, str] | None = None,
    topology: TopologicalMap | None = None,
) -> dict[str, Any]:
    """Return the figures of `eval localization --json`.

    `nodes`: the true node's name by stamp; without them the true node is the one of `topology` that the true pose is in.

    Raises:
        InputError: truth and localization have no time in common.
    """
    known = _covered(truth.stamps_ns, table.stamp_ns)
    if not known.any():
        raise InputError("truth and localization have no time in common")
    true = map_truth.placed(_at(truth, table.stamp_ns))
    tracking = known & (table.status == "tracking") & np.isfinite(table.poses[:, 0])
    error = table.poses - true
    c, s = np.cos(true[:, 3]), np.sin(true[:, 3])
    along, across = c * error[:, 0] + s * error[:, 1], -s * error[:, 0] + c * error[:, 1]
    heading = (error[:, 3] + math.pi) % (2.0 * math.pi) - math.pi
    off = np.hypot(along, across)
    false = tracking & ((off > _FALSE_M) | (np.abs(np.degrees(heading)) > _FALSE_DEG))
    std = np.maximum(table.deviations, 1e-9)
    ratios = np.column_stack([along, across, heading]) / std
    first = np.flatnonzero(tracking)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(true[:, :2], axis=0), axis=1))])
    return {
        "scans": len(table.stamp_ns),
        "tracking_share": float(tracking.mean()),
        "along_m": _statistics(along[tracking]),
        "across_m": _statistics(across[tracking]),
        "height_m": _statistics(error[tracking, 2]),
        "heading_deg": _statistics(np.degrees(heading[tracking])),
        "node_accuracy": _node_accuracy(table, tracking, nodes) if nodes else _on_map(table, tracking, true, topology),
        "first_fix_s": float((table.stamp_ns[first[0]] - table.stamp_ns[0]) * 1e-9) if len(first) else None,
        "first_fix_m": float(way[first[0]]) if len(first) else None,
        "false_fixes": int(np.count_nonzero(false & ~np.concatenate([[False], false[:-1]]))),
        "nees": {
            name: float(np.mean(ratios[tracking, k] ** 2)) if tracking.any() else None
            for k, name in enumerate(("along", "across", "heading"))
        },
        "within_2_sigma": {
            name: float(np.mean(np.abs(ratios[tracking, k]) <= 2.0)) if tracking.any() else None
            for k, name in enumerate(("along", "across", "heading"))
        },
        "latency_ms": {
            "median": float(np.median(table.latency_ms)),
            "p99": float(np.quantile(table.latency_ms, 0.99)),
        },
    }


def read_nodes(path: Path, places: AbstractSet[str] = frozenset()) -> dict[int, str]:
    """Return the true nodes by stamp of a `.nodes.csv` (contract: mine plans); empty where it tells one of the `places` in a node.

    Raises:
        InputError: it cannot be read.
    """
    try:
        rows = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()[1:] if line]
        return {int(stamp): "" if node in places else node for stamp, node, *_ in rows}
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: stamp_ns,node,at_m was wanted ({error})") from error


def names_of(geojson: Path, *kinds: str) -> dict[str, str]:
    """Return the names of a map's nodes (kinds `tunnel`, `intersection`) or places (`waypoint`) by id."""
    features = json.loads(geojson.read_text(encoding="utf-8"))["features"]
    return {f["properties"]["id"]: f["properties"]["name"] for f in features if f["properties"]["kind"] in kinds}


def _node_accuracy(
    table: LocalizationTable, tracking: npt.NDArray[np.bool_], nodes: Mapping[int, str] | None
) -> float | None:
    """Return the share of tracked scans whose node's name is the true one's (numbers after a dot are the map's own).

    Scans whose true node is not told (an empty name) are left out.
    """
    if not nodes:
        return None
    stamps = np.array(sorted(nodes))
    true = [nodes[int(stamp)] for stamp in stamps[_nearest(stamps, table.stamp_ns)]]
    right = [said.split(".")[0] == name.split(".")[0] for said, name in zip(table.node, true, strict=True)]
    judged = tracking & np.array([name != "" for name in true])
    return float(np.mean(np.array(right)[judged])) if judged.any() else None


def _on_map(
    table: LocalizationTable, tracking: npt.NDArray[np.bool_], true: FloatArray, topology: TopologicalMap | None
) -> float | None:
    """Return the share of tracked scans that are in the map's node of their true pose (N, 4), away from boundaries."""
    if topology is None or not tracking.any():
        return None
    lookup, poses = Lookup(topology), true[tracking]
    ahead = np.column_stack([np.cos(poses[:, 3]), np.sin(poses[:, 3]), np.zeros(len(poses))])
    names = [
        np.array([topology.nodes[one].name if one else "" for one in lookup.nodes_at(poses[:, :3] + off * ahead)])
        for off in (-_BOUNDARY_M, 0.0, _BOUNDARY_M)
    ]
    inner = (names[0] == names[1]) & (names[1] == names[2])
    right = np.asarray(table.node[tracking]).astype(str) == names[1]
    return float(right[inner].mean()) if inner.any() else None


def _covered(stamps_ns: npt.NDArray[np.int64], at_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Return which times (M,) are within a moment of rising stamps (N,)."""
    covered: npt.NDArray[np.bool_] = np.abs(stamps_ns[_nearest(stamps_ns, at_ns)] - at_ns) <= _APART_NS
    return covered


def _at(trajectory: Trajectory, at_ns: npt.NDArray[np.int64]) -> FloatArray:
    """Return x, y, z, yaw (M, 4) of a trajectory at times (M,), linear between its poses."""
    poses = planar(trajectory)
    poses[:, 3] = np.unwrap(poses[:, 3])
    since = (trajectory.stamps_ns - trajectory.stamps_ns[0]).astype(float)
    at = (at_ns - trajectory.stamps_ns[0]).astype(float)
    return np.column_stack([np.interp(at, since, column) for column in poses.T])


def _nearest(stamps_ns: npt.NDArray[np.int64], at_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return the rows of rising stamps (N,) nearest to others (M,)."""
    after = np.clip(np.searchsorted(stamps_ns, at_ns), 1, max(len(stamps_ns) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(stamps_ns) - 1)
    nearer = np.abs(stamps_ns[before] - at_ns) <= np.abs(stamps_ns[after] - at_ns)
    rows: npt.NDArray[np.int64] = np.where(nearer, before, after)
    return rows


def _statistics(values: FloatArray) -> dict[str, float | None]:
    names = ("rmse", "mean", "median", "p95", "max")
    if not len(values):
        return dict.fromkeys(names)
    size = np.abs(values)
    rmse, p95 = math.sqrt(float((values**2).mean())), float(np.quantile(size, 0.95))
    return dict(zip(names, (rmse, float(size.mean()), float(np.median(size)), p95, float(size.max())), strict=True))
