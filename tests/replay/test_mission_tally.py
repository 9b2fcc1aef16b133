"""What is counted of a mission from its journal: time by phase, and each request for help, whoever asks."""

from __future__ import annotations

import pytest
from lhdmap.replay.journal import Event
from lhdmap.replay.mission_tally import MissionTally
from lhdmap.replay.processes.executive import EXECUTIVE
from lhdmap.simulation.history import SECOND_NS, START_NS


def test_a_loading_tasks_request_counts_as_one_of_navigation_does() -> None:
    """It is a phase of the mission alone: a shift with three of them was told to have none."""
    tally, before = MissionTally(), "idle"
    for at_s, phase in (
        (10, "tram"),
        (50, "load"),
        (70, "assistance"),
        (90, "load"),
        (120, "assistance"),
        (125, "haul"),
    ):
        tally(Event(START_NS + at_s * SECOND_NS, EXECUTIVE, "state", before, phase, "", {}))
        before = phase
    told = tally.verdict(START_NS + 200 * SECOND_NS)
    assert told["assists"] == 2
    assert told["assist_s"] == pytest.approx(25.0)
    assert sum(told["time_by_phase_s"].values()) == pytest.approx(200.0)
