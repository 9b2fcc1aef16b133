"""Where a place is that the operator named: where the machine stood, or where its drive began or ended."""

from __future__ import annotations

import numpy as np
import pytest
from lhdmap.topology.model import UNEXPLORED, TopologicalMap, Tunnel
from lhdmap.topology.names import Names, Place
from lhdmap.topology.points import waypoints_of
from lhdmap.topology.settings import TopologySettings

LINE = np.column_stack([np.arange(0.0, 41.0), np.zeros(41), np.zeros(41)])
TUNNEL = Tunnel("t1", "T1", (UNEXPLORED, UNEXPLORED), LINE, np.full((41, 2), 2.0), np.zeros(4))
PATH = np.column_stack([np.arange(8.0, 32.01, 0.25), np.zeros(97), np.zeros(97), np.zeros(97)])


@pytest.mark.parametrize(
    ("rows", "waits_at", "wanted_m"),
    [
        (range(17), None, 8.0),  # the drive begins here, and goes on at once
        (range(80, 97), None, 32.0),  # and ends here
        (range(40, 61), None, 20.5),  # driven through: the middle
        (range(40, 61), 52, 21.0),  # a rest on the way
        (range(17), 12, 11.0),  # it went on, and rested
    ],
)
def test_a_named_place_is_where_the_machine_stood(rows: range, waits_at: int | None, wanted_m: float) -> None:
    stamps = np.arange(97, dtype=np.int64) * 125_000_000
    if waits_at is not None:
        stamps[waits_at + 1 :] += 6_000_000_000
    names = Names([], ["T1"], [Place("A", 0, np.array(rows))])
    where = np.zeros(97, dtype=np.int64)
    found = waypoints_of(TopologicalMap(tunnels=(TUNNEL,)), names, where, PATH, stamps, TopologySettings())
    assert [one.name for one in found] == ["A"]
    assert found[0].pose[0] == pytest.approx(wanted_m, abs=0.51)
