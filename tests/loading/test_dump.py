"""Dumping on a linkage of two lines: what is in the bucket falls once it is tipped, and the machine ends in tramming posture."""

from __future__ import annotations

import math

from lhdmap.loading.dump import Dump
from lhdmap.loading.signals import Signals
from lhdmap.messages import Command
from lhdmap.simulation.ground.vehicle import LoadingVehicle

from tests.simulation.ground.test_vehicle import MACHINE, start
from tests.simulation.vehicle.grounds import Plane

STEP_NS = 20_000_000
FULL_BAR, EMPTY_BAR = 100.4, 52.0  # Table 2 of autonomous_loading


def run(
    *,
    bucket_sticks_at: float = -math.inf,
    most_s: float = 60.0,
    old_from_rad: float = -math.inf,
    old_s: float = 0.0,
    tips_rad: float = -0.66,
) -> tuple[list[tuple[float, float]], str]:
    """Dump; returns boom and bucket angles over time, and how it ended.

    Once the bucket is below `old_from_rad`, joints tell what they told then for `old_s` seconds. With its floor below `tips_rad`
    it is empty.
    """
    dump, boom, bucket, now_ns, ways = Dump(), 0.2, 0.0, 0, list[tuple[float, float]]()
    said = Signals(0, 0.0, 0.0, 0, 0.0, boom, bucket, 0.0, 20.0, FULL_BAR, 10.0)
    dump.begin(said)
    old_ns, told, emptied = 0, (boom, bucket), False
    while now_ns < most_s * 1e9:
        now_ns += STEP_NS
        if bucket > old_from_rad or old_ns >= old_s * 1e9:
            told = boom, bucket
        else:
            old_ns += STEP_NS
        emptied |= 0.8 + bucket + 0.5 * boom < tips_rad  # the bucket's floor: a rock slides on it
        lift_bar = EMPTY_BAR if emptied else FULL_BAR
        turn = dump.step(said._replace(now_ns=now_ns, boom_rad=told[0], bucket_rad=told[1], lift_bar=lift_bar))
        assert turn.pedals.brake
        assert turn.pedals.propel == 0.0
        boom = min(max(boom + 0.16 * turn.pedals.lift * 0.02, 0.0), 1.2)
        bucket = min(max(bucket + 0.24 * turn.pedals.tilt * 0.02, bucket_sticks_at, -2.2), 0.0)
        ways.append((boom, bucket))
        if turn.ended:
            return ways, turn.ended
    return ways, ""


def test_the_bucket_is_tipped_with_the_boom_up_and_comes_back() -> None:
    ways, ended = run()
    assert ended == "dumped"
    tipped = [boom for boom, bucket in ways if bucket < -1.7]
    assert len(tipped) * 0.02 > 2.0
    assert min(tipped) > 0.4
    boom, bucket = ways[-1]
    assert boom < 0.05
    assert bucket > -0.05


def test_a_bucket_at_its_stop_is_tipped_enough() -> None:
    ways, ended = run(bucket_sticks_at=-1.75)
    assert ended == "dumped"
    assert min(bucket for _, bucket in ways) == -1.75
    assert len(ways) * 0.02 < 40.0


def test_an_angle_that_stays_as_it_was_is_no_bucket_at_its_stop() -> None:
    ways, ended = run(old_from_rad=-0.1, old_s=2.0)
    assert ended == "dumped"
    assert min(bucket for _, bucket in ways) < -1.7


def test_a_bucket_that_does_not_tip_is_told() -> None:
    ways, ended = run(bucket_sticks_at=-0.2)
    assert ended == "stuck"
    assert len(ways) * 0.02 < 40.0


def test_a_bucket_that_keeps_its_ore_is_not_told_as_dumped() -> None:
    ways, ended = run(tips_rad=-9.0)
    assert ended == "not empty"
    assert len(ways) * 0.02 < 45.0


def test_the_machine_of_the_simulator_is_empty_afterwards() -> None:
    vehicle = LoadingVehicle(MACHINE, Plane())
    state = start(vehicle, load_kg=10_000.0)
    dump, ended = Dump(MACHINE.linkage), ""
    for number in range(6000):
        said = Signals(
            state.time_ns, 0.0, 0.0, 0, 0.0, state.boom_rad, state.bucket_rad, 0.0, 20.0, state.lift_bar, 10.0
        )
        if number == 0:
            dump.begin(said)
        turn = dump.step(said)
        p = turn.pedals
        command = Command(state.time_ns, p.propel, 0.0, p.tilt, p.lift, p.full_rpm, p.brake)
        state = vehicle.step(state, command, 0.01)
        if turn.ended:
            ended = turn.ended
            break
    assert ended == "dumped"
    assert state.load_kg < 50.0
