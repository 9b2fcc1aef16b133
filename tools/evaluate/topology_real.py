"""Topologies of real logs against what a person drew (`../shared/truth`)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from lhdmap.messages import FloatArray
from lhdmap.topology.build import topology_of
from lhdmap.topology.settings import TopologySettings
from scipy.optimize import linear_sum_assignment

from tools.evaluate.topology_drives import log_views
from tools.evaluate.topology_score import rigid

LOGS = (
    ("aces", "02_carmen_aces/aces.clf.bz2"),
    ("csail", "03_carmen_csail/mit-csail.clf.bz2"),
    ("intel", "01_carmen_intel/intel.clf.bz2"),
)
_ROUNDS, _FIT_M = 6, 6.0


class RealScore(NamedTuple):
    """Core intersections that were drawn, those found, with the right degree, found ones that nobody drew; distances (m).

    `extra_all`: these with the drawing fitted by all its intersections, optional ones too: where few are core that differs.
    """

    name: str
    core: int
    found: int
    degrees: int
    extra: int
    extra_all: int
    apart_m: FloatArray


class _Match(NamedTuple):
    """Drawn core intersection of each one found, by numbers; how many found ones nobody drew; distances (m)."""

    pairs: dict[int, int]
    extra: int
    apart_m: FloatArray


def real_score(name: str, log: Path, truth_file: Path, folder: Path) -> RealScore:
    """Return how the map of a log compares with the drawing, which is fitted onto it by its core intersections."""
    truth: dict[str, Any] = json.loads(truth_file.read_text(encoding="utf-8"))
    nodes = topology_of(log_views(log, folder), TopologySettings()).map.intersections
    places = np.array([node.pose_map_node[:2] for node in nodes]).reshape(-1, 2)
    drawn = [node for node in truth["nodes"] if node["kind"] == "intersection"]
    core = [node for node in drawn if not node.get("optional")]
    match, loose = _matched(truth, core, core, places), _matched(truth, core, drawn, places)
    degrees = sum(
        core[i]["degree"] <= nodes[k].degree <= core[i].get("degmax", core[i]["degree"]) for k, i in match.pairs.items()
    )
    return RealScore(name, len(core), len(match.pairs), degrees, match.extra, loose.extra, match.apart_m)


def _matched(
    truth: dict[str, Any], core: list[dict[str, Any]], fitted: list[dict[str, Any]], places: FloatArray
) -> _Match:
    """Compare with the drawing, fitted by its core intersections first and then by those of `fitted` near one found."""
    R, shift = _fit(core, fitted, places)
    apart = np.linalg.norm((_at(core) @ R.T + shift)[:, None] - places[None], axis=2)
    pairs = {k: i for i, k in zip(*linear_sum_assignment(apart), strict=True) if apart[i, k] <= core[i]["tol"]}
    allowed = [(node["x"], node["y"], node["tol"]) for node in truth["nodes"] if node not in core]
    allowed += [tuple(one[:3]) for one in truth.get("ignore", [])]
    strange = [
        k
        for k in range(len(places))
        if k not in pairs
        and not any(np.linalg.norm(R @ np.array([x, y]) + shift - places[k]) <= r for x, y, r in allowed)
    ]
    return _Match(pairs, len(strange), np.array([apart[i, k] for k, i in pairs.items()]))


def _fit(core: list[dict[str, Any]], fitted: list[dict[str, Any]], places: FloatArray) -> tuple[FloatArray, FloatArray]:
    R, shift = np.eye(2), np.zeros(2)
    for turn in range(_ROUNDS):
        points = _at(core if turn < _ROUNDS // 2 else fitted)
        apart = np.linalg.norm((points @ R.T + shift)[:, None] - places[None], axis=2)
        rows, columns = linear_sum_assignment(apart)
        near = apart[rows, columns] < (_FIT_M if turn < _ROUNDS // 2 else 0.4 * _FIT_M)
        if near.sum() >= 2:
            R, shift = rigid(points[rows[near]], places[columns[near]])
    return R, shift


def _at(nodes: list[dict[str, Any]]) -> FloatArray:
    return np.array([[node["x"], node["y"]] for node in nodes], dtype=float)
