"""`eval localization`: errors that are put in come out, and the map's own drift does not count."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.evaluation.localization import LocalizationTable, MapTruth, evaluated, planar, read_nodes
from lhdmap.geometry import se3
from lhdmap.messages import FloatArray
from lhdmap.trajectory import Trajectory

from tests.topology.maps import ladder

RADIUS_M, HZ, SPEED_MPS = 30.0, 10.0, 3.0
STD = np.array([0.02, 0.01, math.radians(0.1)])


def trajectory(poses: FloatArray, start_s: float = 0.0) -> Trajectory:
    """Return a trajectory of poses (N, 4): x, y, z, yaw, at 10 Hz."""
    stamps = (1e9 * (start_s + np.arange(len(poses)) / HZ)).round().astype(np.int64)
    zero = np.zeros(len(poses))
    return Trajectory(stamps, poses[:, :3], se3.quaternions_from_rpy(zero, zero, poses[:, 3]))


def arc(lateral_m: float = 0.0, from_m: float = 0.0, to_m: float = 120.0) -> FloatArray:
    """Return true poses (N, 4) of a drive on a circle of 30 m, 0.3 m apart, rising by 2 %."""
    s = np.arange(from_m, to_m, SPEED_MPS / HZ)
    turn, r = s / RADIUS_M, RADIUS_M - lateral_m
    return np.column_stack([r * np.sin(turn), RADIUS_M - r * np.cos(turn), 0.02 * s, turn])


def moved(poses: FloatArray, x: float, y: float, z: float, yaw: float) -> FloatArray:
    """Return poses (N, 4) as they are in a frame that lies elsewhere."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.column_stack(
        [
            x + c * poses[:, 0] - s * poses[:, 1],
            y + s * poses[:, 0] + c * poses[:, 1],
            poses[:, 2] + z,
            poses[:, 3] + yaw,
        ]
    )


def bent(poses: FloatArray) -> FloatArray:
    """Return poses (N, 4) of an arc as in a map that drifts by 0.01° a metre: turned and shifted piece by piece."""
    out = poses.copy()
    for k in range(1, len(poses)):
        step = poses[k, :2] - poses[k - 1, :2]
        turn = math.radians(0.01) * 0.3 * k
        out[k, 0] = out[k - 1, 0] + math.cos(turn) * step[0] - math.sin(turn) * step[1]
        out[k, 1] = out[k - 1, 1] + math.sin(turn) * step[0] + math.cos(turn) * step[1]
        out[k, 3] = poses[k, 3] + turn
    return out


def off(poses: FloatArray, along: float, across: float, height: float = 0.0, heading: float = 0.0) -> FloatArray:
    """Return poses (N, 4) moved in their own axes."""
    c, s = np.cos(poses[:, 3]), np.sin(poses[:, 3])
    change = [c * along - s * across, s * along + c * across, np.full(len(c), height), np.full(len(c), heading)]
    return poses + np.column_stack(change)


def table(poses: FloatArray, status: list[str] | None = None, start_s: float = 500.0) -> LocalizationTable:
    n = len(poses)
    stamps = trajectory(poses, start_s).stamps_ns
    said = np.array(status or ["tracking"] * n, dtype=object)
    latency = np.linspace(1.0, 2.0, n)
    return LocalizationTable(stamps, said, np.array(["T1.2"] * n, dtype=object), poses, np.tile(STD, (n, 1)), latency)


TEACHING = MapTruth(trajectory(arc()), trajectory(moved(arc(), 100.0, -50.0, 7.0, 2.0)))


def placed(poses: FloatArray) -> FloatArray:
    """Return true poses as they are in the map of `TEACHING`, by the known change of frame."""
    return moved(poses, 100.0, -50.0, 7.0, 2.0)


def truth(poses: FloatArray) -> Trajectory:
    return trajectory(poses, 500.0)


def figures(poses: FloatArray, said: FloatArray, **more: Any) -> dict[str, Any]:
    return evaluated(table(said, more.pop("status", None)), truth(poses), more.pop("teaching", TEACHING), **more)


def test_no_error_in_another_frame_is_none() -> None:
    drive = arc(0.4, 3.0, 100.0)
    found = figures(drive, placed(drive))
    for name in ("along_m", "across_m", "height_m", "heading_deg"):
        assert found[name]["max"] < 1e-6
    assert (found["scans"], found["tracking_share"], found["false_fixes"]) == (len(drive), 1.0, 0)
    assert found["first_fix_s"] == 0.0
    assert found["latency_ms"] == pytest.approx({"median": 1.5, "p99": 1.99})
    assert found["node_accuracy"] is None


def test_errors_come_out_in_the_machines_axes() -> None:
    drive = arc(-0.3)
    found = figures(drive, off(placed(drive), 0.03, -0.008, 0.05, math.radians(0.3)))
    assert found["along_m"] == pytest.approx(dict.fromkeys(("rmse", "mean", "median", "p95", "max"), 0.03), rel=1e-4)
    assert found["across_m"]["rmse"] == pytest.approx(0.008, rel=1e-4)
    assert found["height_m"]["rmse"] == pytest.approx(0.05, rel=1e-4)
    assert found["heading_deg"]["median"] == pytest.approx(0.3, rel=1e-4)
    assert found["nees"] == pytest.approx({"along": 1.5**2, "across": 0.8**2, "heading": 3.0**2}, rel=1e-4)
    assert found["within_2_sigma"] == {"along": 1.0, "across": 1.0, "heading": 0.0}


def test_full_turns_of_the_heading_are_no_error() -> None:
    drive = arc()
    said = placed(drive)
    said[:, 3] = np.remainder(said[:, 3], 2.0 * math.pi) - math.pi * 2.0
    assert figures(drive, said)["heading_deg"]["max"] < 1e-6


def test_the_maps_own_drift_counts_only_globally() -> None:
    """A map that bends by 1.2° over 120 m, with localization exactly where the map is."""
    drive = arc()
    pair = trajectory(arc()), trajectory(bent(arc()))
    near = figures(drive, bent(drive), teaching=MapTruth(*pair))
    assert near["along_m"]["max"] < 1e-3
    assert near["heading_deg"]["max"] < 1e-3
    globally = figures(drive, bent(drive), teaching=MapTruth(*pair, globally=True))
    drift = bent(drive)[-1, :2] - drive[-1, :2]
    end = np.hypot(*drift)
    assert end > 0.3
    assert math.hypot(globally["along_m"]["max"], globally["across_m"]["max"]) > 0.5 * end
    assert globally["heading_deg"]["max"] == pytest.approx(0.01 * 0.3 * (len(drive) - 1), rel=1e-3)


def test_levels_have_their_own_teaching_poses() -> None:
    """The second round of a ramp is 3.8 m above the first, and its part of the map is shifted by 2 m."""
    teaching = arc(to_m=2.0 * math.pi * RADIUS_M * 2.0)
    in_map = teaching.copy()
    in_map[teaching[:, 2] > 0.02 * 2.0 * math.pi * RADIUS_M] += [2.0, 0.0, 0.0, 0.0]
    pairing = MapTruth(trajectory(teaching), trajectory(in_map))
    above = arc(0.2, 250.0, 350.0)
    assert pairing.placed(above)[:, :3] == pytest.approx(above[:, :3] + np.array([2.0, 0.0, 0.0]), abs=1e-6)


def test_false_fixes_are_counted_once_each() -> None:
    drive = arc()
    said = placed(drive)
    said[50:60] = off(said[50:60], 3.0, 0.0)
    said[100:103] = off(said[100:103], 0.0, 0.0, heading=math.radians(15.0))
    said[200:220] = off(said[200:220], 0.0, -5.0)
    status = ["tracking"] * 200 + ["candidate"] * 20 + ["tracking"] * (len(drive) - 220)
    found = figures(drive, said, status=status)
    assert found["false_fixes"] == 2  # what is said to be a candidate is none
    assert found["tracking_share"] == pytest.approx(1.0 - 20 / len(drive))
    assert found["along_m"]["max"] == pytest.approx(3.0, rel=1e-3)


def test_the_first_fix_is_told_by_time_and_way() -> None:
    drive = arc()
    said = placed(drive)
    said[:40] = np.nan
    found = figures(drive, said, status=["unknown"] * 40 + ["tracking"] * (len(drive) - 40))
    assert found["first_fix_s"] == pytest.approx(4.0)
    assert found["first_fix_m"] == pytest.approx(12.0, rel=1e-3)
    assert found["along_m"]["max"] < 1e-6


def test_where_nothing_was_tracked_there_are_no_figures() -> None:
    drive = arc()
    found = figures(drive, np.full_like(drive, np.nan), status=["unknown"] * len(drive))
    assert found["first_fix_s"] is None
    assert found["along_m"] == dict.fromkeys(("rmse", "mean", "median", "p95", "max"))
    assert found["nees"] == dict.fromkeys(("along", "across", "heading"))
    assert found["false_fixes"] == 0


def test_nodes_are_compared_by_the_names_of_the_plan(tmp_path: Path) -> None:
    drive = arc()
    stamps = trajectory(drive, 500.0).stamps_ns
    csv = tmp_path / "nodes.csv"
    names = ["T1"] * 300 + ["T2"] * (len(drive) - 300)
    rows = [f"{stamp},{name},1.0" for stamp, name in zip(stamps.tolist(), names, strict=True)]
    csv.write_text("\n".join(["stamp_ns,node,at_m", *rows]) + "\n")
    assert figures(drive, placed(drive), nodes=read_nodes(csv))["node_accuracy"] == pytest.approx(300 / len(drive))
    places = read_nodes(csv, {"T2"})  # a place in a node, as mine plans name them, says nothing of the node
    assert figures(drive, placed(drive), nodes=places)["node_accuracy"] == 1.0


@pytest.mark.parametrize("text", ["stamp_ns,node,at_m\nnow,T1,2\n", "stamp_ns,node,at_m\n12\n"])
def test_nodes_that_cannot_be_read_are_told(text: str, tmp_path: Path) -> None:
    csv = tmp_path / "nodes.csv"
    csv.write_text(text)
    with pytest.raises(InputError, match=r"nodes\.csv: stamp_ns,node,at_m was wanted"):
        read_nodes(csv)


def test_nothing_in_common_is_refused() -> None:
    drive = arc()
    with pytest.raises(InputError, match="no time in common"):
        evaluated(table(placed(drive), start_s=9000.0), truth(drive), TEACHING)
    with pytest.raises(InputError, match="teaching drive and the map's trajectory"):
        MapTruth(trajectory(arc()), trajectory(arc(), 9000.0))


def test_planar_takes_the_yaw_of_a_tilted_machine() -> None:
    yaw = np.array([0.3, -2.0, 3.1])
    quaternions = se3.quaternions_from_rpy(np.full(3, 0.05), np.full(3, -0.1), yaw)
    poses = planar(Trajectory(np.arange(3), np.arange(9.0).reshape(3, 3), quaternions))
    assert poses[:, 3] == pytest.approx(yaw)
    assert poses[:, :3] == pytest.approx(np.arange(9.0).reshape(3, 3))


def test_without_the_plan_s_nodes_the_map_tells_which_is_right() -> None:
    """Along T1 of the ladder from I1: within 2 m of a boundary either node is right, a wrong name elsewhere is wrong."""
    drive = np.column_stack([np.linspace(10.0, 50.0, 81), np.zeros(81), np.zeros(81), np.zeros(81)])
    said = table(drive)
    same = MapTruth(truth(drive), truth(drive))
    found = [
        evaluated(said._replace(node=np.full(81, name, dtype=object)), truth(drive), same, topology=ladder())
        for name in ("T1", "T2")
    ]
    assert [one["node_accuracy"] for one in found] == [1.0, 0.0]
