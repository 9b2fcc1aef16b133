"""Relations: errors known by construction, stamps that run backwards, and the figures published for the real ones."""

from __future__ import annotations

import bz2
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.evaluation.relations import evaluate_relations, read_relations
from lhdmap.evaluation.sources import read_corrected_carmen
from lhdmap.trajectory import Trajectory, seconds_to_ns

from tests.evaluation.paths import part, trajectory


def on_a_line(seconds: list[float], heading_rad: float = 0.0) -> Trajectory:
    """Return poses that move 1 m/s along their common heading, in the order of the given seconds."""
    t = np.array(seconds)
    positions = np.column_stack([t * math.cos(heading_rad), t * math.sin(heading_rad), 0 * t])
    rpy = np.column_stack([0 * t, 0 * t, np.full(len(t), heading_rad)])
    return trajectory(positions, rpy, np.round(t * 1e9).astype(np.int64))


def write(path: Path, rows: Sequence[tuple[float, ...]]) -> Path:
    path.write_text("# t1 t2 dx dy dz roll pitch yaw\n" + "\n".join(" ".join(f"{v:.6f}" for v in row) for row in rows))
    return path


def test_errors_are_taken_in_the_frame_of_the_relation_and_split_by_time(tmp_path: Path) -> None:
    file = write(
        tmp_path / "x.relations",
        [
            (0, 1, 1.1, 0, 0, 0, 0, 0),
            (0, 30, 30, 0.4, 0, 0, 0, 0.05),
            (0, 100, 98, 0, 0, 0, 0, 0),
            (2, 1, -1, 0, 0, 0, 0, 0),
        ],
    )
    path = on_a_line([0, 1, 2, 30, 100], heading_rad=2.0)
    found = evaluate_relations(path, read_relations(file))
    groups = {group.name: group for group in found.groups}
    assert {name: group.n for name, group in groups.items()} == {"all": 4, "short": 2, "up_to_60_s": 3, "long": 1}
    assert groups["short"].translation_m is not None
    assert groups["short"].translation_m.mean == pytest.approx(0.05)
    assert groups["up_to_60_s"].translation_m is not None
    assert groups["up_to_60_s"].translation_m.max == pytest.approx(0.4)
    assert groups["up_to_60_s"].rotation_deg is not None
    assert groups["up_to_60_s"].rotation_deg.max == pytest.approx(math.degrees(0.05))
    assert groups["long"].translation_m is not None
    assert groups["long"].translation_m.mean == pytest.approx(2.0)


def test_stamps_in_any_order_give_the_same(tmp_path: Path) -> None:
    relations = read_relations(
        write(tmp_path / "x.relations", [(0, 1, 1.1, 0, 0, 0, 0, 0), (1, 7, 6.2, 0, 0, 0, 0, 0)])
    )
    path = on_a_line([float(t) for t in range(9)])
    shuffled = part(path, np.array([3, 1, 0, 2, 8, 7, 6, 5, 4]))
    assert evaluate_relations(shuffled, relations) == evaluate_relations(path, relations)


def test_relations_without_a_stamp_are_left_out_and_counted(tmp_path: Path) -> None:
    rows = [(0, 1, 1.0, 0, 0, 0, 0, 0), (0, 1.4, 1.4, 0, 0, 0, 0, 0)]
    found = evaluate_relations(on_a_line([0.0005, 1, 2]), read_relations(write(tmp_path / "x.relations", rows)))
    assert (found.matched, found.total) == (1, 2)
    assert found.to_json()["relations"][3] == {"group": "long", "n": 0, "translation_m": None, "rotation_deg": None}


def test_no_common_stamp_is_an_error(tmp_path: Path) -> None:
    relations = read_relations(write(tmp_path / "x.relations", [(50, 51, 1, 0, 0, 0, 0, 0)]))
    with pytest.raises(InputError, match="no relation has both its stamps"):
        evaluate_relations(on_a_line([0, 1, 2]), relations)


@pytest.mark.parametrize("text", ["1 2 3", "1 2 3 4 5 6 7 x", "1 2 3 4 5 6 7 8 9"])
def test_broken_lines_are_named(tmp_path: Path, text: str) -> None:
    file = tmp_path / "x.relations"
    file.write_text(text)
    with pytest.raises(InputError, match="line 1: eight numbers"):
        read_relations(file)


def test_empty_and_missing_files_are_errors(tmp_path: Path) -> None:
    (tmp_path / "x.relations").write_text("# nothing\n")
    with pytest.raises(InputError, match="no relation in it"):
        read_relations(tmp_path / "x.relations")
    with pytest.raises(InputError, match="No such file"):
        read_relations(tmp_path / "y.relations")


def wheel_odometry(log: Path) -> Trajectory:
    """Return the odometry fields of the FLASER lines of a CARMEN log, in the order of the file."""
    with bz2.open(log, "rt") as file:
        rows = [line.split() for line in file if line.startswith("FLASER ")]
    x, y, heading = np.array([[float(field) for field in row[-6:-3]] for row in rows]).T
    stamps = np.array([seconds_to_ns(row[-3]) for row in rows], dtype=np.int64)
    zero = np.zeros(len(x))
    return trajectory(np.column_stack([x, y, zero]), np.column_stack([zero, zero, heading]), stamps)


@pytest.mark.shared
def test_published_figures_of_wheel_odometry_on_intel(shared_data: Path) -> None:
    folder = shared_data / "01_carmen_intel"
    found = evaluate_relations(wheel_odometry(folder / "intel.clf.bz2"), read_relations(folder / "intel.relations"))
    short = next(group for group in found.groups if group.name == "short")
    assert (found.matched, found.total, short.n) == (2984, 2984, 1732)
    assert short.translation_m is not None
    assert short.translation_m.mean == pytest.approx(0.022, abs=0.0005)
    assert short.rotation_deg is not None
    assert short.rotation_deg.mean == pytest.approx(1.46, abs=0.005)


@pytest.mark.shared
def test_published_agreement_of_the_intel_graph_log(shared_data: Path) -> None:
    folder = shared_data / "01_carmen_intel"
    graph = read_corrected_carmen(folder / "intel-lab.graph.log")
    found = evaluate_relations(graph, read_relations(folder / "intel.relations"), tolerance_ns=100_000_000)
    everything = found.groups[0]
    assert everything.n == 762
    assert everything.translation_m is not None
    assert everything.translation_m.mean == pytest.approx(0.055, abs=0.0005)
    assert everything.rotation_deg is not None
    assert everything.rotation_deg.median == pytest.approx(0.54, abs=0.005)


@pytest.mark.shared
def test_published_steps_of_wheel_odometry_on_csail(shared_data: Path) -> None:
    from lhdmap.evaluation.trajectory import TrajectoryEvaluationSettings, evaluate_trajectory

    folder = shared_data / "03_carmen_csail"
    truth = read_corrected_carmen(folder / "mit-csail.graph.log")
    settings = TrajectoryEvaluationSettings(rpe_delta=1, rpe_unit="frames")
    found = evaluate_trajectory(wheel_odometry(folder / "mit-csail.clf.bz2"), truth, settings)
    assert found.pairs == 1051
    assert found.rpe.translation_m.mean() == pytest.approx(0.034, abs=0.0005)
    assert np.median(found.rpe.translation_m) == pytest.approx(0.023, abs=0.0005)
    assert found.rpe.rotation_deg.mean() == pytest.approx(2.88, abs=0.005)
