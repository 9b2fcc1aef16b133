"""The order of poses: lines in any order give the same evaluation; stamps that step back keep it; two paths are refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.cli.main import main
from lhdmap.errors import InputError
from lhdmap.evaluation.ordering import file_in_order, in_order_of_drive
from lhdmap.evaluation.sources import load_estimate, load_truth
from lhdmap.evaluation.trajectory import evaluate_trajectory
from lhdmap.trajectory import Trajectory, write_tum

from tests.evaluation.paths import arc, disturbed, part, straight, wandering

TRUTH = wandering(5, poses=60)
ESTIMATE = disturbed(TRUTH, 6)
LENGTH_M = float(np.linalg.norm(np.diff(TRUTH.positions_m, axis=0), axis=1).sum())
ORDERS = st.permutations(range(60))


def joined(*parts: Trajectory) -> Trajectory:
    return Trajectory(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


@given(ORDERS, ORDERS, st.lists(st.integers(0, 59), max_size=5))
def test_lines_in_any_order_or_twice_give_the_same_evaluation(
    of_truth: list[int], of_estimate: list[int], twice: list[int]
) -> None:
    truth = file_in_order(part(TRUTH, np.array(of_truth + twice)), Path("truth.tum")).trajectory
    estimate = file_in_order(part(ESTIMATE, np.array(twice + of_estimate)), Path("estimate.tum")).trajectory
    found, expected = evaluate_trajectory(estimate, truth).to_json(), evaluate_trajectory(ESTIMATE, TRUTH).to_json()
    assert found == expected
    assert found["distance_m"] == pytest.approx(LENGTH_M)
    assert evaluate_trajectory(part(ESTIMATE, np.array(of_estimate)), part(TRUTH, np.array(of_truth))).ape_m == (
        evaluate_trajectory(ESTIMATE, TRUTH).ape_m
    )


@pytest.mark.parametrize("length_m", [20.0, 2.0 * np.pi * 5.0])
def test_halves_that_changed_places_are_sorted_and_told(length_m: float, tmp_path: Path) -> None:
    """On a closed circle the jump between the halves is no longer than a step: there nothing else than time tells."""
    truth = arc(5.0, length_m)
    half = len(truth.stamps_ns) // 2
    write_tum(tmp_path / "swapped.tum", joined(part(truth, slice(half, None)), part(truth, slice(0, half))))
    with pytest.warns(UserWarning, match="sorted by time"):
        found = load_truth(tmp_path / "swapped.tum")
    assert found.stamps_ns.tolist() == truth.stamps_ns.tolist()
    np.testing.assert_allclose(found.positions_m, truth.positions_m, atol=1e-6)


def test_stamps_that_scatter_keep_the_order_of_the_drive() -> None:
    """As in CARMEN's Intel log: each twentieth stamp is 0.3 s early, the path goes on."""
    truth = straight(40.0)
    stamps = truth.stamps_ns.copy()
    stamps[20::20] -= 310_000_001
    late = truth._replace(stamps_ns=stamps)
    assert file_in_order(late, Path("carmen.tum")) == (late, "")
    found, remark = in_order_of_drive(late)
    assert found.stamps_ns.tolist() == stamps.tolist()
    assert "0.29 s" in remark
    assert "kept" in remark
    assert evaluate_trajectory(late, late).distance_m == pytest.approx(40.0)


def test_a_clock_that_was_set_back_keeps_the_order_and_its_jump_has_no_length() -> None:
    truth = straight(40.0)
    stamps = truth.stamps_ns.copy()
    stamps[400:] -= 5_000_000_000
    found = evaluate_trajectory(truth._replace(stamps_ns=stamps), truth._replace(stamps_ns=stamps))
    assert found.distance_m == pytest.approx(40.0 - 0.05)
    assert any("kept" in text for text in found.warnings)


@pytest.mark.parametrize("shift_ns", [0, 7_000_000])
def test_two_trajectories_in_one_file_are_refused(shift_ns: int) -> None:
    one, other = straight(20.0), arc(5.0, 20.0)
    both = joined(one, other._replace(stamps_ns=other.stamps_ns + shift_ns))
    with pytest.raises(InputError, match=r"both\.tum: .*two trajectories in one file"):
        file_in_order(both, Path("both.tum"))


def test_one_stamp_with_two_poses_counts_once() -> None:
    truth = straight(20.0)
    doubled = joined(truth, part(straight(20.0, scale=1.1), slice(200, 202)))
    found, remark = file_in_order(doubled, Path("doubled.tum"))
    assert found.stamps_ns.tolist() == truth.stamps_ns.tolist()
    assert "2 poses have the stamp of another one" in remark


def test_what_was_noticed_is_in_the_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_tum(tmp_path / "estimate.tum", part(ESTIMATE, slice(None, None, -1)))
    write_tum(tmp_path / "truth.tum", TRUTH)
    words = ["eval", "trajectory", str(tmp_path / "estimate.tum"), "--truth", str(tmp_path / "truth.tum"), "--json"]
    assert main(words) == 0
    told = capsys.readouterr()
    values = json.loads(told.out)
    assert values["distance_m"] == pytest.approx(LENGTH_M, abs=1e-3)
    assert any("estimate.tum: stamps run backwards 59 times" in text for text in values["warnings"])
    assert "warning: " in told.err


def test_the_order_of_a_map_folder_is_kept(tmp_path: Path) -> None:
    backwards = part(ESTIMATE, slice(None, None, -1))
    write_tum(tmp_path / "trajectory.tum", backwards)
    assert load_estimate(tmp_path).stamps_ns.tolist() == backwards.stamps_ns.tolist()


@pytest.mark.shared
def test_the_key_scans_of_intel_keep_their_order(shared_data: Path) -> None:
    """97 of the 2672 corrected key scans are up to 0.9 s early; sorted, the path would be a tenth longer."""
    truth = load_truth(shared_data / "01_carmen_intel" / "intel-lab.graph.log")
    assert np.count_nonzero(np.diff(truth.stamps_ns) < 0) == 97
    assert file_in_order(truth, Path("intel.tum")) == (truth, "")
    found, remark = in_order_of_drive(truth)
    assert found.stamps_ns.tolist() == truth.stamps_ns.tolist()
    assert "0.893 s" in remark
    assert evaluate_trajectory(truth, truth).distance_m == pytest.approx(360.69, abs=0.01)
