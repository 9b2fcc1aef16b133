"""The recording of a replay, read back: machine, plans, map, legs and place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lhdmap.machine import Machine
from lhdmap.report.replay_recording import BATCH_COLUMNS, ReplayRecording

from tests.report.drives import START_NS, drive, replayed, rows
from tests.report.test_recording import column, read
from tests.topology.maps import ladder


def test_all_of_a_drive_is_in_it(tmp_path: Path) -> None:
    recording = ReplayRecording(tmp_path / "r.rrd", "drive", START_NS, Machine())
    recording.begin(replayed().lines_m, 20.0)
    table = np.column_stack([rows(), rows()[:, 6], rows()[:, 8] - 0.1])
    assert table.shape[1] == len(BATCH_COLUMNS)
    recording.add_rows(table, np.zeros((len(table), 2)))
    way = np.array([[0.0, 0.0, 0.4], [1.0, 0.5, 0.4]])
    for k, one in enumerate((np.empty((0, 3)), way, np.empty((0, 3)), np.empty((0, 3)))):
        recording.add_horizon(START_NS + k * 10**9, one)
    recording.add_map(ladder())
    recording.close(replayed())
    found = read(tmp_path / "r.rrd")
    strips = column(found["map/plan/horizon"], ":strips")
    assert np.array(strips[0][0]) == pytest.approx(way)
    assert len(strips) == 2  # the way, and once that there is none any more
    assert not len(strips[1])
    assert len(column(found["map/route/forward"], ":strips")[0]) == 1
    assert column(found["map/topology/tunnels/driven"], ":labels")[0] == [one.name for one in ladder().tunnels]
    across = np.array([values[0] for values in column(found["place/across"], ":scalars")])
    assert across == pytest.approx(100.0 * drive().place("across_m"))
    for entity in ("motion/speed/planned", "motion/clearance/predicted", "motion/steering", "map/base_link/rear_link"):
        assert entity in found
