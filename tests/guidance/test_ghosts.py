"""What has left is forgotten once a machine that stands has seen through its place; low rock that is near stays."""

from __future__ import annotations

import math

import numpy as np
from lhdmap.guidance.ghosts import Eye
from lhdmap.guidance.local_walls import LocalWalls
from lhdmap.messages import FloatArray

HALF_M, PERSON_X_M = 2.2, 6.0
RAYS = np.radians(np.arange(-135.0, 135.1, 0.5))


def scan(person_m: float | None = None) -> FloatArray:
    """Return the hits of a scanner at the origin of a drift along x, 20 m to its end, with a person of 0.5 m before it."""
    c, s = np.cos(RAYS), np.sin(RAYS)
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = np.minimum(HALF_M / np.abs(s), np.where(c > 0.0, 20.0 / c, np.inf))
        if person_m is not None:
            hit = (c > 0.0) & (np.abs(np.tan(RAYS) * person_m) < 0.25)
            ranges = np.where(hit, person_m / c, ranges)
    near = ranges < 20.5
    return np.column_stack([ranges * c, ranges * s])[near]


def at(x_m: float) -> FloatArray:
    return np.array([x_m, 0.0, 0.0])


def feed(walls: LocalWalls, x_m: float, points: FloatArray, times: int = 1) -> None:
    for _ in range(times):
        walls.add(at(x_m), points, [Eye(np.zeros(2), points)])


def on_the_way(walls: LocalWalls) -> int:
    points = walls.points()
    return int(((np.abs(points[:, 1]) < 0.5) & (points[:, 0] < 15.0)).sum())


def test_a_person_that_leaves_is_forgotten_and_the_walls_are_not() -> None:
    walls = LocalWalls(14.0)
    for x in np.arange(0.0, 3.1, 0.5):
        feed(walls, x, scan(PERSON_X_M - x))
    feed(walls, 3.0, scan(PERSON_X_M - 3.0), times=20)
    assert on_the_way(walls) > 20
    kept = len(walls.points())
    feed(walls, 3.0, scan(), times=40)
    assert on_the_way(walls) == 0
    beside = walls.points()
    assert (np.abs(np.abs(beside[:, 1]) - HALF_M) < 0.01).sum() > 0.7 * kept


def test_a_machine_that_drives_on_forgets_nothing() -> None:
    walls = LocalWalls(14.0)
    for x in np.arange(0.0, 3.1, 0.25):
        feed(walls, x, scan(PERSON_X_M - x))
    feed(walls, 3.25, scan())
    before = on_the_way(walls)
    assert before > 20
    for x in np.arange(3.5, 5.5, 0.25):
        feed(walls, x, scan())
    assert on_the_way(walls) >= before


def test_low_rock_that_was_seen_from_afar_alone_stays() -> None:
    walls = LocalWalls(14.0)
    for x in np.arange(0.0, 2.1, 0.5):  # seen while it is farther than 3.9 m; from nearer the scanner looks over it
        feed(walls, x, scan(PERSON_X_M - x))
    feed(walls, 4.0, scan(), times=40)
    assert on_the_way(walls) > 5


def test_what_hides_behind_something_nearer_stays() -> None:
    walls = LocalWalls(14.0)
    feed(walls, 0.0, scan(8.0), times=8)
    feed(walls, 0.0, scan(4.0), times=40)
    assert math.isclose(8.0, walls.points()[:, 0][np.abs(walls.points()[:, 1]) < 0.1].max(), abs_tol=13.0)
    assert ((np.abs(walls.points()[:, 0] - 8.0) < 0.05) & (np.abs(walls.points()[:, 1]) < 0.2)).any()
