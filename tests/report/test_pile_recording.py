"""The pile in a recording, read back with Rerun's own reader."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lhdmap.pile.result import PileReport, Snapshot
from lhdmap.report.pile_recording import residual_colours, write_pile_recording

from tests.report.test_pile_page import pile
from tests.report.test_recording import column, count, read, seconds

SECOND_NS = 1_000_000_000


def test_pile_is_recorded_with_its_course(tmp_path: Path) -> None:
    history = tuple(Snapshot(i * SECOND_NS, 30.0 - i, pile(width_m=4.0 + 0.01 * i)) for i in range(10))
    around = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 3)) + history[-1].estimate.center_m
    write_pile_recording(PileReport(history[4], history[-1], history, around_m=around), tmp_path / "p.rrd", "p")
    found = read(tmp_path / "p.rrd")
    shown = {name for name in found if name.startswith("map/")}
    parts = ("face", "toe", "limits", "limits/deviation", "boulders", "attack")
    assert shown >= {"map/around", "map/pile/n_y", *(f"map/pile/{name}" for name in parts)}
    assert count(found["map/pile/face"]) == len(history[-1].estimate.face_m)
    assert count(found["map/around"]) == 50
    assert [value[0] for value in column(found["pile/width/value"], ":scalars")] == pytest.approx(
        [4.0 + 0.01 * i for i in range(10)]
    )
    high, low = (column(found[f"pile/width/{part}"], ":scalars") for part in ("high", "low"))
    assert high[0][0] - low[0][0] == pytest.approx(4.0 * 0.07)
    assert sorted(seconds(found["pile/probability/loadable"])) == pytest.approx(np.arange(10.0))


def test_nothing_found_leaves_a_readable_file(tmp_path: Path) -> None:
    write_pile_recording(PileReport(None, None), tmp_path / "p.rrd", "p")
    assert not any(name.startswith("map/pile") for name in read(tmp_path / "p.rrd"))


def test_red_stands_out_and_blue_lies_behind() -> None:
    rgba = residual_colours(np.array([-1.0, 0.0, 1.0]))
    red, blue = rgba >> 24, (rgba >> 8) & 0xFF
    assert red[0] < blue[0]
    assert red[1] == blue[1]
    assert red[2] > blue[2]
