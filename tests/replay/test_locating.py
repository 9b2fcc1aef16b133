"""When a machine that has dug keeps its place against what it sees of its pile: until it is away from it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest
from lhdmap.replay.processes.locating import Locating


def beside(places: list[tuple[float, ...]], digs: list[bool]) -> list[bool]:
    """Return what is said at poses, one after the other, with the loading task digging or not."""
    told = SimpleNamespace(_dug_at=None, localizer=SimpleNamespace(pipeline=SimpleNamespace(track=SimpleNamespace())))
    found = []
    for place, digs_now in zip(places, digs, strict=True):
        told.localizer.pipeline.track.newest = place
        found.append(Locating._beside_its_pile(cast("Locating", told), digs=digs_now))
    return found


def test_it_is_beside_its_pile_until_it_has_driven_off() -> None:
    """What was: a loaded machine that had to back up towards its pile lost its place there, and asked for ever."""
    places: list[tuple[float, ...]] = [(0.0, 0.0), (0.0, 0.0), (-5.0, 2.0), (-2.0, 0.0), (-12.0, 0.0), (0.0, 0.0)]
    assert beside(places, [False, True, False, False, False, False]) == [False, True, True, True, False, False]


@pytest.mark.parametrize("digs", [False, True])
def test_without_a_pose_it_is_what_the_task_says(digs: bool) -> None:
    assert beside([()], [digs]) == [digs]
