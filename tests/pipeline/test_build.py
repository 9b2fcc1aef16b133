"""`build-map` on a simulated drive: what is in the folder, what is no input, how near the truth it comes."""

from __future__ import annotations

import html
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lhdmap.config import Settings
from lhdmap.errors import InputError
from lhdmap.evaluation.trajectory import evaluate_trajectory
from lhdmap.integration.cloud_io import read_cloud
from lhdmap.logs.source import LogSource
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import LaserScan, Mount
from lhdmap.pipeline.build import BuildRequest, BuildResult, build_map
from lhdmap.pipeline.inputs import ROLES_READ
from lhdmap.provenance import sha256_of
from lhdmap.simulation.drive import SimulatedDrive
from lhdmap.trajectory import read_tum

from tests.integration.truth import distances_to_mesh, in_truth_frame

FILES = {
    "map.json",
    "trajectory.tum",
    "odometry.tum",
    "diagnostics.parquet",
    "cloud.ply",
    "pile.json",
    "topology.geojson",
    "free_space.npz",
    "views.npz",
    "landmarks.npz",
    "recording.rrd",
    "report.html",
}


def test_the_folder_is_the_contracts(built: BuildResult, drive: SimulatedDrive) -> None:
    assert {path.name for path in built.folder.iterdir()} == FILES
    info = json.loads((built.folder / "map.json").read_text(encoding="utf-8"))
    assert info["sources"][0]["sha256"] == sha256_of(drive.log)
    for name, entry in info["files"].items():
        assert entry["sha256"] == sha256_of(built.folder / name)
    assert info["counts"]["scans"] == drive.scans
    assert "http://" not in (built.folder / "report.html").read_text(encoding="utf-8").replace("http://www.w3.org", "")


@pytest.mark.parametrize("name", ["trajectory.tum", "odometry.tum"])
def test_one_line_for_each_scan_at_its_own_stamp(built: BuildResult, drive: SimulatedDrive, name: str) -> None:
    found = read_tum(built.folder / name)
    assert (found.stamps_ns == drive.truth.stamps_ns).all()
    assert np.isfinite(found.positions_m).all()
    assert np.linalg.norm(found.quaternions_xyzw, axis=1) == pytest.approx(1.0, abs=1e-6)


def test_the_truth_in_a_log_is_no_input(built: BuildResult, untold: Path, tmp_path: Path) -> None:
    blind = build_map(BuildRequest([untold], tmp_path / "map"))
    for name in ("trajectory.tum", "odometry.tum", "cloud.ply"):
        assert (blind.folder / name).read_bytes() == (built.folder / name).read_bytes()


def test_the_trajectory_is_near_the_truth(built: BuildResult, drive: SimulatedDrive) -> None:
    found = evaluate_trajectory(built.trajectory, drive.truth).to_json()
    assert found["end_pct"] < 1.0  # a short drive: 0.1 m weighs more than over 60 m
    assert built.summary["distance_m"] == pytest.approx(drive.distance_m, rel=0.01)
    assert built.summary["lost_stretches"] == 0


def test_the_cloud_lies_on_the_walls(built: BuildResult, drive: SimulatedDrive) -> None:
    """The figures over 60 m, with exact poses and with own odometry, are in evaluation/integration.md."""
    assert drive.mesh_file is not None
    cloud = read_cloud(built.folder / "cloud.ply")
    points = in_truth_frame(cloud.points_m.astype(float), built.trajectory, drive.truth)
    distance = distances_to_mesh(points, drive.mesh_file)
    assert np.median(distance) < 0.06
    assert np.percentile(distance, 95) < 0.20


def test_diagnostics_have_a_row_for_each_processed_scan(built: BuildResult) -> None:
    import pyarrow.parquet as pq

    table = pq.read_table(built.folder / "diagnostics.parquet")
    assert table.num_rows == built.summary["scans_processed"] <= built.summary["scans"]
    stamps = table["stamp_ns"].to_numpy()
    assert (np.diff(stamps) > 0).all()
    assert (table["information_across"].to_numpy() >= 0.0).all()


def rewritten(log: Path, target: Path, change: str) -> Path:
    """Write the front scanner of a log anew: gaps, scans that are not numbers, neighbours in the wrong order."""
    with LogSource([log]) as source, LogWriter(target) as writer:
        scans = [m for _, m in source.messages(["front"]) if isinstance(m, LaserScan)][:120]
        if change == "gappy":
            scans = [scan for k, scan in enumerate(scans) if not 40 <= k < 60]
        elif change == "swapped":
            scans[50:54] = scans[53:49:-1]
        for k, scan in enumerate(scans):
            if change == "nan" and k % 9 == 4:
                scan = scan._replace(ranges_m=np.full_like(scan.ranges_m, np.nan))
            writer.write("/lidar/front/scan", scan, scans[0].stamp_ns + k * 40_000_000)
    return target


@pytest.mark.parametrize("change", ["gappy", "swapped", "nan"])
def test_bad_streams_make_a_map(untold: Path, tmp_path: Path, change: str) -> None:
    log = rewritten(untold, tmp_path / "bad.mcap", change)
    found = build_map(BuildRequest([log], tmp_path / "map"))
    assert np.isfinite(found.trajectory.positions_m).all()
    assert len(found.trajectory.stamps_ns) == (100 if change == "gappy" else 120)
    assert np.abs(found.trajectory.positions_m[:, 2]).max() == 0.0  # no inclinometer: planar
    assert any("inclinometer" in text for text in found.warnings)


@pytest.mark.parametrize("roles", [("front",), ("front", "tachometer", "joints", "tf_static")])
def test_a_log_whose_scans_are_all_blind_is_refused_as_by_doctor(
    roles: tuple[str, ...], untold: Path, tmp_path: Path
) -> None:
    """Also where the wheels tell of a drive: a map without a wall is none."""
    with LogSource([untold]) as source, LogWriter(tmp_path / "blind.mcap") as writer:
        for role, message in source.messages(roles):
            if isinstance(message, LaserScan):
                message = message._replace(ranges_m=np.full_like(message.ranges_m, np.inf))
            writer.write(source.roles[role], [message] if isinstance(message, Mount) else message)
    with pytest.raises(InputError, match=r"blind\.mcap: /lidar/front/scan: dead: only 0\.0 % of the beams"):
        build_map(BuildRequest([tmp_path / "blind.mcap"], tmp_path / "map"))
    with pytest.raises(InputError, match=r"blind\.mcap: no scan fitted"):
        build_map(BuildRequest([tmp_path / "blind.mcap"], tmp_path / "forced", force=True))


def test_a_front_scanner_that_dies_ends_the_map_there(untold: Path, tmp_path: Path) -> None:
    """The rear scanner went on: all its sweeps were put at the last pose that was known."""
    with LogSource([untold]) as source, LogWriter(tmp_path / "dies.mcap") as writer:
        start = source.start_ns or 0
        for role, message in source.messages([role for role in ROLES_READ if role in source.roles]):
            if role != "front" or message.stamp_ns < start + 2 * 10**9:
                writer.write(source.roles[role], [message] if isinstance(message, Mount) else message)
    found = build_map(BuildRequest([tmp_path / "dies.mcap"], tmp_path / "map"))
    (warning,) = (text for text in found.warnings if "rear" in text)
    assert "without a pose" in warning
    assert len(found.trajectory.stamps_ns) < 60
    assert found.summary["duration_s"] > 4.0


def test_sweeps_of_the_rear_body_need_the_angle_of_the_joint(untold: Path, tmp_path: Path) -> None:
    """A straight machine was assumed: in the bend the rear scanner's walls stood in the drift."""
    with LogSource([untold]) as source, LogWriter(tmp_path / "stiff.mcap") as writer:
        for role, message in source.messages([role for role in ROLES_READ if role in source.roles]):
            if role != "joints":
                writer.write(source.roles[role], [message] if isinstance(message, Mount) else message)
    found = build_map(BuildRequest([tmp_path / "stiff.mcap"], tmp_path / "map"))
    assert any("no angle of the joint" in text for text in found.warnings)


def test_a_log_without_scans_is_refused(untold: Path, tmp_path: Path) -> None:
    with LogSource([untold]) as source, LogWriter(tmp_path / "none.mcap") as writer:
        for _, message in source.messages(["tachometer"]):
            writer.write("/machine/tachometer", message)
    with pytest.raises(InputError, match=r"none\.mcap"):
        build_map(BuildRequest([tmp_path / "none.mcap"], tmp_path / "map"))


def test_a_pause_in_the_log_is_told(untold: Path, tmp_path: Path) -> None:
    with LogSource([untold]) as source, LogWriter(tmp_path / "pause.mcap") as writer:
        start = source.start_ns or 0
        for role, message in source.messages(["front", "tf_static"]):
            if isinstance(message, LaserScan) and message.stamp_ns > start + 3 * 10**9:
                message = message._replace(stamp_ns=message.stamp_ns + 60 * 10**9)
            if not start + 2 * 10**9 < message.stamp_ns <= start + 3 * 10**9:  # driven on meanwhile
                writer.write(source.roles[role], [message] if isinstance(message, Mount) else message)
    found = build_map(BuildRequest([tmp_path / "pause.mcap"], tmp_path / "map"))
    assert any("no scan for 61 s" in text for text in found.warnings)


@pytest.mark.parametrize("why", ["inclinometer", "off"])
def test_a_pile_that_was_not_looked_for_is_null_with_the_reason(untold: Path, tmp_path: Path, why: str) -> None:
    log, settings = untold, Settings()
    if why == "off":
        settings = replace(settings, pile=replace(settings.pile, method="off"))
    else:
        log = rewritten(untold, tmp_path / "scans.mcap", "as it is")
    found = build_map(BuildRequest([log], tmp_path / "map", settings))
    assert found.summary["pile"] is None
    assert why in found.summary["pile_reason"]
    assert not (found.folder / "pile.json").exists()
    page = (found.folder / "report.html").read_text(encoding="utf-8")
    assert "<p>No pile was looked for: " in page
    assert "probability" not in page


def test_no_warning_is_said_twice(built: BuildResult) -> None:
    assert len(set(built.warnings)) == len(built.warnings)
    page = (built.folder / "report.html").read_text(encoding="utf-8")
    for text in built.warnings:
        assert page.count(html.escape(text)) == 1
