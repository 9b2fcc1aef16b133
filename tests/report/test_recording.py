"""The Rerun recording, read back with Rerun's own reader: entities, times, points and curves are what went in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.integration.cloud import GridCloud
from lhdmap.machine import Machine
from lhdmap.messages import Joints, LaserScan, Mount, Tachometer
from lhdmap.report.log_recording import LogRecorder
from lhdmap.report.recording import RecordingWriter
from lhdmap.report.recording_layout import ASPECT, FIELD_OF_VIEW_RAD, PLAN_ASPECT, eye_of, whole_of
from lhdmap.report.recording_settings import RecordingSettings
from lhdmap.report.run_recording import record_run

from tests.report.synthetic import START_NS, drive, report_data


def read(path: Path) -> dict[str, list[Any]]:
    """Return the record batches of each entity of a recording; the layout is left out."""
    from rerun.chunk import RrdReader

    batches: dict[str, list[Any]] = {}
    for chunk in RrdReader(path).stream():
        batches.setdefault(str(chunk.entity_path).strip("/"), []).append(chunk.to_record_batch())
    return batches


def column(batches: list[Any], ending: str) -> list[Any]:
    """Return the values of the column with that ending, over all batches."""
    return [
        value
        for batch in batches
        for name in batch.schema.names
        if name.endswith(ending)
        for value in batch.column(name).to_pylist()
    ]


def seconds(batches: list[Any]) -> list[float]:
    """Return the times of all rows on the timeline `time`."""
    import pyarrow as pa

    return [
        value / 1e9
        for batch in batches
        if "time" in batch.schema.names
        for value in batch.column("time").cast(pa.int64()).to_pylist()
    ]


def count(batches: list[Any]) -> int:
    return sum(len(points) for points in column(batches, ":positions"))


def test_a_run_is_recorded_whole(tmp_path: Path) -> None:
    data = report_data(scans=1000, points=5000)
    with RecordingWriter(tmp_path / "r.rrd", "drive", START_NS) as writer:
        record_run(writer, data, Machine())
    found = read(tmp_path / "r.rrd")
    assert data.cloud is not None
    parts = [batches for entity, batches in found.items() if entity.startswith("map/cloud/")]
    assert len(parts) == 90
    assert sum(count(part) for part in parts) == len(data.cloud)
    assert len(column(found["map/base_link"], ":translation")) == 1000
    assert {"map/path/final", "map/path/odometry", "map/base_link/rear_link/rear_body"} <= found.keys()
    assert seconds(found["scan_match/deviation/along"])[-1] == pytest.approx(19.92)
    assert column(found["motion/slip"], ":scalars")[0][0] == pytest.approx(100 * data.diagnostics.slip[0])  # type: ignore[union-attr]
    assert column(found["log"], ":text") == [[text] for text in data.warnings]


def test_the_machine_moves_along_the_trajectory(tmp_path: Path) -> None:
    path = drive(200)
    with RecordingWriter(tmp_path / "r.rrd", "drive", START_NS) as writer:
        writer.add_motion(path, Machine())
    found = read(tmp_path / "r.rrd")["map/base_link"]
    positions = np.array([value[0] for value in column(found, ":translation")])
    assert np.abs(positions - path.positions_m).max() < 1e-5
    assert np.abs(np.array(seconds(found)) - 0.02 * np.arange(200)).max() < 1e-9


def test_points_appear_when_they_were_first_measured(tmp_path: Path) -> None:
    stamps = START_NS + np.array([5, 1, 3]) * 1_000_000_000
    cloud = GridCloud(np.array([[5, 0, 0], [1, 0, 0], [3, 0, 0]], np.float32), stamps_ns=stamps)
    with RecordingWriter(tmp_path / "r.rrd", "drive", START_NS, RecordingSettings(cloud_parts=3)) as writer:
        writer.add_cloud(cloud)
    found = read(tmp_path / "r.rrd")
    for number, second in enumerate((1.0, 3.0, 5.0)):
        part = found[f"map/cloud/{number:03d}"]
        assert seconds(part) == [second]
        assert column(part, ":positions") == [[[second, 0.0, 0.0]]]


def test_scans_are_thinned_to_the_interval(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "r.rrd", "drive", START_NS, RecordingSettings(scan_interval_s=0.5)) as writer:
        for number in range(100):
            stamp = START_NS + number * 40_000_000
            assert writer.wants_scan(stamp) == (number % 13 == 0)
            writer.add_scan(stamp, np.ones((7, 3)))
    found = read(tmp_path / "r.rrd")["map/scan/front"]
    assert seconds(found) == pytest.approx([0.52 * i for i in range(8)])
    assert count(found) == 56


def test_an_interrupted_recording_can_be_read(tmp_path: Path) -> None:
    def interrupted() -> None:
        with RecordingWriter(tmp_path / "r.rrd", "drive", START_NS) as writer:
            writer.add_scan(START_NS, np.ones((3, 3)))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert count(read(tmp_path / "r.rrd")["map/scan/front"]) == 3


def test_a_log_is_recorded_where_its_sensors_are_mounted(tmp_path: Path) -> None:
    recorder = LogRecorder(tmp_path / "log.rrd", "log")
    T_base_scanner = np.eye(4)
    T_base_scanner[:3, 3] = [10.0, 0.0, 2.0]
    recorder.update("tf_static", Mount(0, "base_link", "laser", T_base_scanner))
    for number in range(20):
        stamp = START_NS + number * 50_000_000
        ranges = np.array([2.0, np.inf, 3.0], np.float32)
        recorder.update("front", LaserScan(stamp, "laser", 0.0, np.pi / 4, 0.0, 0.1, 30.0, ranges))
        recorder.update("tachometer", Tachometer(stamp, 1.5))
        recorder.update("joints", Joints(stamp, {"articulation": np.pi / 6}, {}))
    recorder.finish(["a remark"])
    found = read(tmp_path / "log.rrd")
    assert recorder.scans == 10
    assert np.array(column(found["map/scan/front"], ":positions")[0]) == pytest.approx(
        np.array([[12.0, 0.0, 2.0], [10.0, 3.0, 2.0]]), abs=1e-5
    )
    assert column(found["motion/speed/tachometer"], ":scalars") == [[1.5]] * 20
    assert column(found["angles/articulation"], ":scalars")[0] == pytest.approx([30.0])
    assert column(found["log"], ":text") == [["a remark"]]


def test_a_rear_scanner_follows_the_joint(tmp_path: Path) -> None:
    recorder = LogRecorder(tmp_path / "log.rrd", "log")
    T_rear_plate, T_plate_scanner = np.eye(4), np.eye(4)
    T_rear_plate[0, 3], T_plate_scanner[0, 3] = -2.0, -1.0
    recorder.update("tf_static", Mount(0, "rear_link", "plate", T_rear_plate))
    recorder.update("tf_static", Mount(0, "plate", "laser", T_plate_scanner))
    recorder.update("joints", Joints(START_NS, {"articulation": np.pi / 2}, {}))
    ranges = np.array([1.0], np.float32)
    recorder.update("rear", LaserScan(START_NS, "laser", 0.0, 0.1, 0.0, 0.1, 30.0, ranges))
    recorder.finish()
    found = column(read(tmp_path / "log.rrd")["map/scan/rear"], ":positions")[0][0]
    # bent by 90 degrees to the left, the rear body points to the left of the joint: 1.7 m to its axle, 2 m further back
    assert found == pytest.approx([-1.7, 1.7 + 2.0, 0.0], abs=1e-5)


def test_a_log_without_scans_is_an_error(tmp_path: Path) -> None:
    recorder = LogRecorder(tmp_path / "log.rrd", "empty.mcap")
    recorder.update("tachometer", Tachometer(START_NS, 1.0))
    with pytest.raises(InputError, match=r"empty.mcap: no scan"):
        recorder.finish()


def test_paths_have_a_name_and_a_colour_of_their_own_and_a_legend(tmp_path: Path) -> None:
    data = report_data(scans=1000, points=1000)
    with RecordingWriter(tmp_path / "r.rrd", "drive", START_NS) as writer:
        writer.add_scan(START_NS, np.ones((3, 3)))
        record_run(writer, data, Machine())
    found = read(tmp_path / "r.rrd")
    names = {name: column(found[f"map/path/{name}/name"], ":labels")[0] for name in ("final", "odometry")}
    assert names == {"final": ["final path"], "odometry": ["odometry alone"]}
    entities = ("map/path/final", "map/path/odometry", "map/scan/front", "map/base_link/front_body")
    colours = [column(found[entity], ":colors")[0][0] for entity in entities]
    assert len(set(colours)) == len(entities)
    (legend,) = column(found["legend"], ":text")[0]
    for words in ("| blue line | final path |", "| orange line | odometry alone |", "| yellow boxes | the machine |"):
        assert words in legend


def test_a_path_that_is_the_final_one_is_drawn_once(tmp_path: Path) -> None:
    data = report_data(scans=300, points=1000)
    with RecordingWriter(tmp_path / "r.rrd", "drive", START_NS) as writer:
        record_run(writer, replace(data, odometry=data.trajectory), Machine())
    assert not any(name.startswith("map/path/odometry") for name in read(tmp_path / "r.rrd"))


def test_a_recorded_slip_has_gaps_where_the_machine_stands(tmp_path: Path) -> None:
    data = report_data(scans=400, points=1000)
    assert data.odometry_speed is not None
    speed = data.odometry_speed.speed_mps.copy()
    speed[:200] = 0.0
    still = data.odometry_speed._replace(speed_mps=speed)
    with RecordingWriter(tmp_path / "r.rrd", "drive", START_NS) as writer:
        record_run(writer, replace(data, odometry_speed=still, tachometer_speed=still), Machine())
    values = np.array([value[0] for value in column(read(tmp_path / "r.rrd")["motion/slip"], ":scalars")])
    assert np.isnan(values[:49]).all()
    assert np.isfinite(values[51:]).all()


@pytest.mark.parametrize("oblique", [True, False])
@pytest.mark.parametrize("span_m", [(400.0, 20.0, 4.0), (10.0, 300.0, 30.0), (5.0, 5.0, 3.0), (80.0, 60.0, 0.0)])
def test_the_first_view_holds_the_whole_map(oblique: bool, span_m: tuple[float, float, float]) -> None:
    """All corners lie in the picture of a camera at the eye, and some of them near its edge."""
    bounds = np.array([[100.0, -40.0, 7.0], np.array([100.0, -40.0, 7.0]) + span_m])
    eye, target = eye_of(bounds, oblique=oblique)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0] if oblique else [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    corners = (
        np.array([[bounds[i, 0], bounds[j, 1], bounds[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) - eye
    )
    depth = corners @ forward
    assert (depth > 0.0).all()
    half = np.tan(FIELD_OF_VIEW_RAD / 2)
    aspect = ASPECT if oblique else PLAN_ASPECT
    across, high = (
        np.abs(corners @ right) / depth / half / aspect,
        np.abs(corners @ np.cross(right, forward)) / depth / half,
    )
    assert max(across.max(), high.max()) < 1.0
    if min(span_m) >= 5.0 or max(span_m) > 50.0:
        assert max(across.max(), high.max()) > 0.7


def test_bounds_hold_all_points_but_strays() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform([0, 0, 0], [100, 50, 3], (5000, 3)).astype(np.float32)
    low, high = whole_of(points)
    assert (points >= low).all()
    assert (points <= high).all()
    points[0] = 5000.0
    assert (whole_of(points)[1] < 200.0).all()
