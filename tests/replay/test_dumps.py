"""Dumping as a process, on joints that follow the pedals of an armed machine: a stop in its midst empties no bucket."""

from __future__ import annotations

import pytest
from lhdmap.messages import Joints, Tachometer
from lhdmap.replay.journal import Journal
from lhdmap.replay.process import DUMPING, MACHINE_SAYS, ORDERS, PEDALS, Received
from lhdmap.replay.processes.dumps import DONE, DUMPS, FAILED, Dumps
from lhdmap.replay.processes.feed import JOINTS, TACHOMETER
from lhdmap.replay.processes.told import Health, Orders

STEP_NS = Dumps.period_ns
RATE_RPS = 0.15  # of both joints


def dumped(
    disarmed_s: tuple[float, float], *, sticks_at: float = -2.0, for_s: float = 60.0
) -> tuple[str, float, float]:
    """Dump with a stop; return how it ended, after how long (s), and the lowest angle of the bucket (rad)."""
    process, boom, bucket, lowest = Dumps(Journal(None).of(DUMPS)), 0.2, 0.0, 0.0
    for now_ns in range(STEP_NS, round(for_s * 1e9), STEP_NS):
        armed = not disarmed_s[0] <= now_ns * 1e-9 < disarmed_s[1]
        told = {"boom_lift": boom, "bucket_tilt": bucket, "articulation": 0.0}
        heard = [
            Received(JOINTS, now_ns, Joints(now_ns, told, {})),
            Received(TACHOMETER, now_ns, Tachometer(now_ns, 0.0)),
            Received(ORDERS, now_ns, Orders(now_ns, 1, "", loaded=True, dumping=1)),
            Received(MACHINE_SAYS, now_ns, Health(now_ns, armed, "autonomous", standing=True, causes=())),
        ]
        for topic, message, _ in process.step(now_ns, heard):
            if topic == PEDALS and armed:
                boom = min(max(boom + 1e-9 * STEP_NS * RATE_RPS * message.pedals.lift, 0.0), 1.2)
                bucket = min(max(bucket + 1e-9 * STEP_NS * RATE_RPS * message.pedals.tilt, sticks_at), 0.0)
                lowest = min(lowest, bucket)
            if topic == DUMPING and message.state in (DONE, FAILED):
                return message.state, now_ns * 1e-9, lowest
    return "", for_s, lowest


@pytest.mark.parametrize("at_s", [1.0, 6.0, 14.0, 20.0, 29.0])
def test_a_stop_of_the_machine_makes_it_later_and_nothing_else(at_s: float) -> None:
    whole, stopped = dumped((0.0, 0.0)), dumped((at_s, at_s + 5.0))
    assert (whole[0], stopped[0]) == (DONE, DONE)
    assert whole[2] == pytest.approx(-1.79, abs=0.03)
    assert stopped[2] == pytest.approx(whole[2], abs=0.01)  # the bucket was tipped as far
    assert stopped[1] - whole[1] == pytest.approx(5.0, abs=0.2)


def test_a_long_stop_is_no_failed_dump() -> None:
    assert dumped((2.0, 92.0), for_s=160.0)[0] == DONE


def test_a_bucket_that_does_not_tip_is_told() -> None:
    assert dumped((0.0, 0.0), sticks_at=-0.2)[0] == FAILED
