"""Pedals of a loading controller: only while they are fresh, armed and nobody wants a stop; the pile is no obstacle to them."""

from __future__ import annotations

import numpy as np
from lhdmap.executor.notes import Stop
from lhdmap.messages import Command

from tests.executor.rig import PERIOD_MS, Rig

AROUND = np.array([[1.0, -2.0], [30.0, -2.0], [30.0, 2.0], [1.0, 2.0]])


def armed() -> Rig:
    rig = Rig()
    rig.plans = False
    rig.run(0.5)
    assert rig.control.rearm(rig.now_ns, "autonomous") == ()
    assert rig.control.mode("autonomous", rig.now_ns)
    rig.run(0.1)
    return rig


def push(rig: Rig, seconds: float, propel: float = 0.2) -> None:
    """Ask for pedals each period."""

    def ask() -> None:
        pedals = Command(rig.now_ns, propel, 0.0, -0.5, 0.25, full_rpm=True, brake=False)
        rig.control.dig(pedals, rig.now_ns)

    ask()
    rig.run(seconds, ask)


def test_pedals_go_through_with_their_stamp_of_now() -> None:
    rig = armed()
    push(rig, 2.0)
    assert rig.speed > 0.3
    command = rig.command
    assert (command.propel, command.tilt, command.lift, command.full_rpm, command.brake) == (
        0.2,
        -0.5,
        0.25,
        True,
        False,
    )
    assert command.stamp_ns == rig.now_ns


def test_pedals_that_are_old_are_none() -> None:
    rig = armed()
    push(rig, 2.0)
    rig.run(0.1 + 2 * PERIOD_MS * 1e-3)
    assert rig.command.brake
    assert (rig.command.tilt, rig.command.lift) == (0.0, 0.0)
    rig.run(3.0)
    assert rig.speed == 0.0


def test_what_was_asked_while_not_armed_does_not_count() -> None:
    rig = Rig()
    rig.run(0.5)
    pedals = Command(rig.now_ns, 0.5, 0.0, 0.0, 0.0, full_rpm=False, brake=False)
    assert not rig.control.dig(pedals, rig.now_ns)
    rig.run(0.5)
    assert rig.x_m == 0.0


def test_a_stop_of_anybody_wins() -> None:
    rig = armed()
    push(rig, 2.0)
    pedals = Command(rig.now_ns, 0.5, 0.0, 0.0, 0.0, full_rpm=False, brake=False)
    rig.control.dig(pedals, rig.now_ns)
    for stop in (Stop.SERVICE, Stop.FULL):
        assert rig.control.step(rig.now_ns, rig.motion(), stop, "test").brake
    rig.control.emergency("test")
    push(rig, 3.0)
    assert rig.speed == 0.0


def test_the_guard_stops_before_a_thing_but_not_before_the_pile() -> None:
    rig = armed()
    rig.thing_m = 8.0
    push(rig, 30.0)
    assert rig.speed == 0.0
    assert rig.x_m + 3.2 < rig.thing_m
    stood_m = rig.x_m
    rig.control.touches(AROUND)
    push(rig, 6.0)
    assert rig.x_m > stood_m + 0.5


def test_the_other_gear_comes_through_standstill() -> None:
    rig = armed()
    push(rig, 3.0)
    assert rig.speed > 0.3
    push(rig, 0.02, propel=-0.5)
    assert rig.command.propel == 0.0
    push(rig, 6.0, propel=-0.5)
    assert rig.speed < -0.3
