"""What the paper's Table 1 does, and what the machine that is used does instead."""

from __future__ import annotations

import pytest
from lhdmap.haulage.mission_io import Buckets
from lhdmap.haulage.paper import LEAVES, NOMINAL, At, events_at, run, stages_at
from lhdmap.haulage.stages import STAGES

from tests.haulage.drives import Drive
from tests.haulage.sites import hejase


def test_a_nominal_cycle_runs_to_stage_13_and_stops_there() -> None:
    assert run(NOMINAL) == list(range(1, 14))  # the second bucket is loaded, and nothing notices
    assert LEAVES[13] == ()


@pytest.mark.parametrize(
    ("at", "loaded", "events"),
    [
        (At.A1_A2_ENTRY, True, ["E7", "E10"]),
        (At.A3_A2_ENTRY, False, ["E10", "E14"]),
        (At.A2_A1_EXIT, False, ["E8", "E12"]),
    ],
)
def test_two_events_are_true_at_three_places(at: At, loaded: bool, events: list[str]) -> None:
    assert events_at(at, loaded=loaded) == events


def test_nowhere_else_more_than_one_is_true() -> None:
    several = [(at, loaded) for at in At for loaded in (True, False) if len(events_at(at, loaded=loaded)) > 1]
    assert len(several) == 3


def test_a_truck_found_loaded_on_the_way_back_has_no_stage() -> None:
    """Of the places on the roads half have none: those where the direction does not go with the load."""
    without = [(at, loaded) for at in At for loaded in (True, False) if not stages_at(at, loaded=loaded)]
    assert (At.A2_BACK, True) in without
    assert (At.A2_OUT, False) in without
    assert len(without) >= 12


def test_the_machine_that_is_used_goes_through_the_stages_again_and_again() -> None:
    drive = Drive(hejase())
    drive.run((Buckets("L1", "D1", 3),), 3000.0)
    assert drive.stages == [12, *list(range(1, 13)) * 3, 13]
    assert len(STAGES) == 13
