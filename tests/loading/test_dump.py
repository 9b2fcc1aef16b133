"""Dumping on a linkage of two lines: what is in the bucket falls once it is tipped, and the machine ends in tramming posture."""

from __future__ import annotations

import math

from lhdmap.loading.dump import Dump
from lhdmap.loading.signals import Signals

STEP_NS = 20_000_000


def run(
    *, bucket_sticks_at: float = -math.inf, most_s: float = 60.0, old_from_rad: float = -math.inf, old_s: float = 0.0
) -> tuple[list[tuple[float, float]], str]:
    """Dump; returns boom and bucket angles over time, and how it ended.

    Once the bucket is below `old_from_rad`, joints tell what they told then for `old_s` seconds.
    """
    dump, boom, bucket, now_ns, ways = Dump(), 0.2, 0.0, 0, list[tuple[float, float]]()
    said = Signals(0, 0.0, 0.0, 0, 0.0, boom, bucket, 0.0, 20.0, 90.0, 10.0)
    dump.begin(said)
    old_ns, told = 0, (boom, bucket)
    while now_ns < most_s * 1e9:
        now_ns += STEP_NS
        if bucket > old_from_rad or old_ns >= old_s * 1e9:
            told = boom, bucket
        else:
            old_ns += STEP_NS
        turn = dump.step(said._replace(now_ns=now_ns, boom_rad=told[0], bucket_rad=told[1]))
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
    tipped = [boom for boom, bucket in ways if bucket < -0.7]
    assert len(tipped) * 0.02 > 2.0
    assert min(tipped) > 0.4
    boom, bucket = ways[-1]
    assert boom < 0.05
    assert bucket > -0.05


def test_a_bucket_at_its_stop_is_tipped_enough() -> None:
    ways, ended = run(bucket_sticks_at=-0.5)
    assert ended == "dumped"
    assert min(bucket for _, bucket in ways) == -0.5
    assert len(ways) * 0.02 < 30.0


def test_an_angle_that_stays_as_it_was_is_no_bucket_at_its_stop() -> None:
    ways, ended = run(old_from_rad=-0.1, old_s=2.0)
    assert ended == "dumped"
    assert min(bucket for _, bucket in ways) < -0.7


def test_a_bucket_that_does_not_tip_is_told() -> None:
    ways, ended = run(bucket_sticks_at=-0.2)
    assert ended == "stuck"
    assert len(ways) * 0.02 < 30.0
