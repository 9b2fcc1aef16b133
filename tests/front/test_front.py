"""The front door: paths as text, a map as arrays, against the truth of a simulated drive; errors for a person."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import lhdmap
import numpy as np
import pytest
from lhdmap.evaluation.trajectory import evaluate_trajectory
from lhdmap.geometry import se3
from lhdmap.machine import Machine, machine_toml
from lhdmap.simulation.drive import SimulatedDrive
from lhdmap.trajectory import Trajectory, read_tum

from tests.integration.truth import distances_to_mesh, in_truth_frame


def test_the_trajectory_is_that_of_the_drive(built: lhdmap.Map, drive: SimulatedDrive) -> None:
    found = built.trajectory
    count = len(drive.truth.stamps_ns)
    assert (found.stamps_ns == drive.truth.stamps_ns).all()
    assert found.positions_m.shape == (count, 3)
    assert found.quaternions_xyzw.shape == (count, 4)
    assert evaluate_trajectory(found, drive.truth).to_json()["end_pct"] < 1.0
    assert built.odometry.positions_m.shape == (count, 3)


def test_poses_as_matrices_take_points_from_the_machine_to_the_map(built: lhdmap.Map) -> None:
    poses = built.trajectory.T_map_base
    assert poses.shape == (len(built.trajectory.stamps_ns), 4, 4)
    assert poses[:, :3, 3] == pytest.approx(built.trajectory.positions_m)
    forward = poses[:, :3, 0]  # where x of base_link points to: along the way, while the machine moves
    step = np.diff(built.trajectory.positions_m, axis=0)
    moving = np.linalg.norm(step, axis=1) > 0.05
    step = step[moving] / np.linalg.norm(step[moving], axis=1, keepdims=True)
    assert (forward[:-1][moving] * step).sum(axis=1).min() > 0.98


def test_matrices_are_those_of_roll_pitch_and_yaw() -> None:
    rpy = np.array([[0.3, -0.2, 2.0], [-1.0, 0.4, -3.0], [0.0, 0.0, 0.0]])
    quaternions = 3.0 * se3.quaternions_from_rpy(*rpy.T)
    positions = np.arange(9.0).reshape(3, 3)
    found = Trajectory(np.arange(3), positions, quaternions).T_map_base
    for T, (roll, pitch, yaw), (x, y, z) in zip(found, rpy, positions, strict=True):
        assert np.allclose(T, se3.from_rpy(roll, pitch, yaw, (x, y, z)), atol=1e-12)


def test_the_cloud_is_of_arrays_and_lies_on_the_walls(built: lhdmap.Map, drive: SimulatedDrive) -> None:
    cloud = built.cloud()
    count = len(cloud)
    assert count > 5_000
    assert cloud.points_m.shape == (count, 3)
    assert cloud.normals is not None
    assert cloud.normals.shape == (count, 3)
    assert cloud.curvature is not None
    assert cloud.curvature.shape == (count,)
    assert cloud.stamps_ns is not None
    assert cloud.stamps_ns.dtype == np.int64
    assert (
        drive.truth.stamps_ns[0] <= cloud.stamps_ns.min() <= cloud.stamps_ns.max() < drive.truth.stamps_ns[-1] + 10**8
    )
    assert drive.mesh_file is not None
    points = in_truth_frame(cloud.points_m.astype(float), built.trajectory, drive.truth)
    assert np.median(distances_to_mesh(points, drive.mesh_file)) < 0.08  # 0.04 to 0.06 by the noise of the sensors


def test_open3d_gets_the_same_points_and_normals(built: lhdmap.Map) -> None:
    cloud = built.cloud()
    found = cloud.to_open3d()
    assert np.asarray(found.points) == pytest.approx(cloud.points_m)
    assert np.asarray(found.normals) == pytest.approx(cloud.normals)
    assert not type(cloud)(cloud.points_m).to_open3d().has_normals()


def test_figures_warnings_report_and_pile_are_those_of_the_folder(built: lhdmap.Map, drive: SimulatedDrive) -> None:
    summary = built.summary
    assert summary["map"] == str(built.folder)
    assert summary["scans"] == drive.scans
    assert summary["distance_m"] == pytest.approx(drive.distance_m, rel=0.01)
    assert summary["warnings"] == built.warnings
    assert built.report.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert built.pile is not None
    assert built.pile["status"] == summary["pile"]
    assert len(built.diagnostics().stamp_ns) == summary["scans_processed"]
    assert f"{drive.scans} scans" in repr(built)


def test_the_figures_are_those_of_the_command(
    beside_the_log: Path, built: lhdmap.Map, capsys: pytest.CaptureFixture[str]
) -> None:
    from lhdmap.cli.main import main

    assert main(["build-map", "drive.mcap", "-o", "map", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert lhdmap.open_map("map").summary | {"map": "map"} == told | {"map": "map"}
    assert built.summary.keys() == told.keys()


def test_open_map_gives_what_build_map_gave(built: lhdmap.Map) -> None:
    again = lhdmap.open_map(str(built.folder))
    assert again.folder == built.folder
    assert again.summary == built.summary
    assert again.pile == built.pile
    for mine, theirs in zip(again.trajectory, built.trajectory, strict=True):
        assert (mine == theirs).all()


def test_a_map_stays_open_when_the_working_folder_changes(
    built: lhdmap.Map, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(built.folder.parent)
    found = lhdmap.open_map(built.folder.name)
    monkeypatch.chdir(tmp_path)
    assert len(found.trajectory.stamps_ns) == built.summary["scans"]


def test_paths_lists_and_options_are_taken(beside_the_log: Path, drive: SimulatedDrive) -> None:
    Path("machine.toml").write_text(machine_toml(Machine(name="mine")), encoding="utf-8")
    found = lhdmap.build_map(
        [Path("drive.mcap")],
        settings={"integration": {"voxel_size_m": [0.4, 0.4, 0.4]}, "odometry.method": "range_flow"},
        topics={"front": "/lidar/front/scan"},
        poses=drive.truth_file,
        machine="machine.toml",
    )
    assert found.folder == beside_the_log / "drive_map"  # beside the log
    options = json.loads((found.folder / "map.json").read_text(encoding="utf-8"))["options"]
    assert options["integration"]["voxel_size_m"] == [0.4, 0.4, 0.4]
    assert options["odometry"]["method"] == "range_flow"
    assert options["request"]["topics"] == {"front": "/lidar/front/scan"}
    assert options["request"]["machine"] == "mine"
    truth = read_tum(drive.truth_file)
    assert found.trajectory.positions_m == pytest.approx(truth.positions_m, abs=1e-3)  # the given poses


def test_settings_may_be_a_file(built: lhdmap.Map, beside_the_log: Path) -> None:
    Path("mine.toml").write_text("[integration]\nvoxel_size_m = [0.5, 0.5, 0.5]\n", encoding="utf-8")
    assert len(lhdmap.build_map("drive.mcap", "map", settings="mine.toml").cloud()) < 0.5 * len(built.cloud())


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"odometry.metod": "range_flow"}, "did you mean .*method"),
        ({"odometri.method": "range_flow"}, "did you mean .*odometry"),
        ({"odometry": {"method": "magic"}}, "one of"),
        ({"step_m": 0.2}, "did you mean .*odometry.step_m"),
        ({"odometry.step_m": "far"}, "float"),
        ("none.toml", "No such file"),
    ],
)
def test_wrong_settings_are_refused_before_anything_is_made(settings: Any, told: str, beside_the_log: Path) -> None:
    with pytest.raises(lhdmap.ConfigError, match=told):
        lhdmap.build_map("drive.mcap", "map", settings=settings)
    assert not list(beside_the_log.glob("map*"))


@pytest.mark.parametrize(
    ("log", "error", "told"),
    [
        ("none.mcap", lhdmap.InputError, "none.mcap"),
        ([], lhdmap.InputError, "empty"),
        ("", lhdmap.UsageError, "log is empty"),
        (7, lhdmap.UsageError, "log = 7"),
        (["drive.mcap", None], lhdmap.UsageError, "log = None"),
    ],
)
def test_wrong_logs_are_refused(log: Any, error: type[Exception], told: str, beside_the_log: Path) -> None:
    with pytest.raises(error, match=told):
        lhdmap.build_map(log, "map")


def test_wrong_roles_topics_and_machines_are_refused(beside_the_log: Path) -> None:
    with pytest.raises(lhdmap.UsageError, match="frnt"):
        lhdmap.build_map("drive.mcap", "map", topics={"frnt": "/lidar/front/scan"})
    with pytest.raises(lhdmap.InputError, match="/scan"):
        lhdmap.build_map("drive.mcap", "map", topics={"front": "/scan"})
    with pytest.raises(lhdmap.InputError, match=r"none\.toml"):
        lhdmap.build_map("drive.mcap", "map", machine="none.toml")


def test_what_is_no_map_is_refused(built: lhdmap.Map, drive: SimulatedDrive, tmp_path: Path) -> None:
    for path in (tmp_path / "none", tmp_path, drive.log):
        with pytest.raises(lhdmap.InputError, match=path.name):
            lhdmap.open_map(path)
    (tmp_path / "map.json").write_text((built.folder / "map.json").read_text(encoding="utf-8"), encoding="utf-8")
    hollow = lhdmap.open_map(tmp_path)
    assert hollow.pile is None
    for ask in (hollow.cloud, lambda: hollow.trajectory, lambda: hollow.report, hollow.diagnostics):
        with pytest.raises(lhdmap.InputError, match="has no"):
            ask()
    (tmp_path / "pile.json").write_text("[]", encoding="utf-8")
    with pytest.raises(lhdmap.InputError, match=r"pile\.json"):
        assert lhdmap.open_map(tmp_path).pile


def test_the_names_are_there_before_they_are_loaded() -> None:
    code = "import lhdmap; print(sorted(set(lhdmap.__all__) - set(dir(lhdmap))), lhdmap.InputError.exit_code)"
    code += "; import sys; print('numpy' in sys.modules); lhdmap.build_map; print('numpy' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=dict(os.environ)
    )
    assert done.stdout.split() == ["[]", "3", "False", "True"]
    assert all(hasattr(lhdmap, name) for name in lhdmap.__all__)
    with pytest.raises(AttributeError, match="no attribute 'build_mapp'"):
        lhdmap.build_mapp  # type: ignore[attr-defined]  # noqa: B018


def test_a_folder_that_exists_is_refused_or_replaced(beside_the_log: Path) -> None:
    first = lhdmap.build_map("drive.mcap", "map", settings={"integration.voxel_size_m": (0.5, 0.5, 0.5)})
    with pytest.raises(lhdmap.UsageError, match="is there already"):
        lhdmap.build_map("drive.mcap", "map")
    coarse = len(first.cloud())
    assert len(lhdmap.build_map("drive.mcap", "map", force=True).cloud()) > 2 * coarse
    assert {path.name for path in beside_the_log.iterdir()} == {"drive.mcap", "map"}
