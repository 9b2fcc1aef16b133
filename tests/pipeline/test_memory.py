"""Memory of a long drive on the same tunnels: it is bounded by the map, apart from some numbers a scan."""

from __future__ import annotations

import gc
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from lhdmap import trajectory
from lhdmap.config import Settings
from lhdmap.logs.survey import Survey
from lhdmap.messages import LaserScan
from lhdmap.pipeline import outcome
from lhdmap.pipeline.again import integrate_again
from lhdmap.pipeline.build import BuildRequest, build_map
from lhdmap.pipeline.given import GROUND_TRUTH
from lhdmap.pipeline.inputs import Inputs
from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.pipeline.records import ScanRecords
from lhdmap.pipeline.sweeps import SweepIntegration
from lhdmap.pipeline.track import Track, TrackRows
from lhdmap.simulation.drive import SimulatedDrive
from lhdmap.simulation.planar import PlanarScanner, drift_world, drive_along, simulate_scans
from lhdmap.smoothing import smoother
from lhdmap.smoothing.moves import Moves
from lhdmap.smoothing.smoother import Correction, corrected
from lhdmap.trajectory import Trajectory, write_tum

START_NS, STEP_NS = 1_758_000_000_123_456_789, 40_000_000


def bytes_a_turn(work: Callable[[int], object], turns: int) -> float:
    """Return by how much the memory grows with each turn, after as many turns before."""
    tracemalloc.start()
    for k in range(turns):
        work(k)
    gc.collect()
    before = tracemalloc.get_traced_memory()[0]
    for k in range(turns, 2 * turns):
        work(k)
    gc.collect()
    after = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    return (after - before) / turns


def test_a_scan_leaves_some_numbers_behind() -> None:
    records, track, moves = ScanRecords(), Track(), Moves()

    def scan(k: int) -> None:
        stamp_ns, x = START_NS + k * STEP_NS, 0.1 * k
        records.add_scan(stamp_ns, stamp_ns + 1)
        records.add_processed(stamp_ns, (x, x), (np.full(3, x), np.full(3, x)), "wheels", (True, False), ("used", x))
        records.add_motion(stamp_ns, x, x, None)
        track.append(stamp_ns, np.full(3, x), 0.0, 0.0)
        moves.append(stamp_ns, np.full(3, x))

    # stamps and times 32, match 72, motion 24, flags and words 4; pose 56; move 32; and an eighth of room to grow
    assert bytes_a_turn(scan, 5000) < 1.15 * (132 + 56 + 32)


def test_a_scan_of_a_run_that_is_not_kept_leaves_nothing_behind() -> None:
    records, track = ScanRecords(kept=False), Track(kept=False)

    def scan(k: int) -> None:
        stamp_ns, x = START_NS + k * STEP_NS, 0.1 * k
        records.add_scan(stamp_ns, stamp_ns + 1)
        records.add_processed(
            stamp_ns, (x, x), (np.full(3, x), np.full(3, x)), "wheels", (k % 2 == 0, k % 2 == 1), ("used", x)
        )
        records.add_motion(stamp_ns, x, x, None)
        track.append(stamp_ns, np.full(3, x), 0.0, 0.0)

    assert bytes_a_turn(scan, 1000) < 10.0  # the path has 128 poses more or fewer
    assert (records.scans, records.processed, records.lost_now, records.weak_now) == (1, 1, True, False)
    assert track.newest[:2] == pytest.approx([199.9, 199.9])
    last_ns = START_NS + 1999 * STEP_NS
    assert track.rows_after(0, last_ns).times_ns[-2:].tolist() == [last_ns - STEP_NS, last_ns]


def there_and_back(passes: int) -> Iterator[tuple[float, LaserScan]]:
    """Yield scans of a machine that drives back and forth in 24 m of a drift, with fresh noise each time."""
    world = drift_world(7, pieces=((40.0, 0.0),), cross_drift_at_m=None)
    poses = drive_along(world.centre_line_m, 4.0, 25.0)[:150]
    number = 0
    for turn in range(passes):
        way = poses if turn % 2 == 0 else poses[::-1]
        for scan in simulate_scans(world, way, PlanarScanner(step_deg=1.0), 25.0, turn):
            yield number, scan._replace(stamp_ns=START_NS + number * STEP_NS)
            number += 1


def test_the_pipeline_grows_with_the_map_alone() -> None:
    """Twelve times through the same 24 m, then twelve more: key scans, cloud and walls are there already."""
    scans = (scan for _, scan in there_and_back(24))
    with MappingPipeline(Settings()) as pipeline:
        growth = bytes_a_turn(lambda _: pipeline.update("front", next(scans)), 12 * 150)
        keys = pipeline.evidence.smoother.keys.keys
        assert len(keys) < 0.5 * keys[-1].travelled_m
    assert growth < 600.0  # a scan of 191 beams alone has 764 bytes


def test_both_clouds_are_not_held_at_a_time(
    drive: SimulatedDrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left, again = [], integrate_again

    def watched(inputs: Inputs, pipeline: MappingPipeline, rows: TrackRows, survey: Survey | None) -> SweepIntegration:
        left.append(len(pipeline.sweeps.integrator.grid))
        return again(inputs, pipeline, rows, survey)

    monkeypatch.setattr(outcome, "integrate_again", watched)
    build_map(BuildRequest([drive.log], tmp_path / "map", poses=GROUND_TRUTH))
    assert left == [0]


def test_a_trajectory_is_written_in_parts_as_in_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    stamps_ns = START_NS + STEP_NS * np.arange(25, dtype=np.int64)
    way = Trajectory(stamps_ns, rng.normal(size=(25, 3)), rng.normal(size=(25, 4)))
    write_tum(tmp_path / "one", way)
    monkeypatch.setattr(trajectory, "_LINES", 7)
    write_tum(tmp_path / "parts", way)
    assert (tmp_path / "parts").read_bytes() == (tmp_path / "one").read_bytes()
    lines = (tmp_path / "one").read_text(encoding="ascii").splitlines()
    assert [line.split()[0].replace(".", "") for line in lines] == [str(stamp) for stamp in stamps_ns]


def test_poses_are_moved_in_parts_as_in_one(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    times_ns, at_ns = START_NS + STEP_NS * np.arange(40), START_NS + 5 * STEP_NS * np.arange(8)
    correction, poses = Correction(at_ns, 0.1 * rng.normal(size=(8, 3)), 1), rng.normal(size=(40, 6))
    whole = corrected(poses, times_ns, correction)
    monkeypatch.setattr(smoother, "_BLOCK", 7)
    assert (corrected(poses, times_ns, correction) == whole).all()
    assert (whole[:, 2:5] == poses[:, 2:5]).all()
