"""The guard in use where a machine creeps from one of its stops into the next: it holds the gear for a while."""

from __future__ import annotations

import numpy as np
import pytest
from lhdmap.driving.motion import Motion
from lhdmap.executor.guard_watch import GuardWatch
from lhdmap.executor.settings import ExecutorSettings
from lhdmap.messages import FloatArray

from tests.guidance.tunnels import BODIES, MODEL

LOOK_NS = 50_000_000
NOSE_M = float(BODIES.front_m[:, 0].max())
NOTHING: FloatArray = np.zeros((0, 2))


class Bench:
    def __init__(self) -> None:
        self.watch = GuardWatch(MODEL, BODIES, ExecutorSettings())
        self.now_ns = 0

    def look(
        self, x_m: float, wall: bool, asked_mps: float = 0.3, *, standing: bool = True, digs: bool = False
    ) -> bool:
        """Look once more; `wall`: a point is 1 cm before the nose (behind the tail in reverse)."""
        self.now_ns += LOOK_NS
        motion = Motion(self.now_ns, x_m, 0.0, 0.0, 0.0, 0.0, 0.0 if standing else asked_mps)
        self.watch.points("front", np.array([[NOSE_M + 0.01, 0.2]]) if wall else NOTHING, motion)
        self.watch.look(self.now_ns, motion, asked_mps, None, 0.0, standing=standing, digs=digs)
        return self.watch.holds

    def stop(self, x_m: float, asked_mps: float = 0.3, *, digs: bool = False) -> None:
        """Run into the guard once, and stand."""
        assert any(self.look(x_m, True, asked_mps, standing=False, digs=digs) for _ in range(4))

    def held_s(self, x_m: float, asked_mps: float = 0.3, most_s: float = 20.0) -> float:
        """Return how long it is held with nothing in its way that is seen."""
        begin_ns = self.now_ns
        while self.look(x_m, False, asked_mps) and self.now_ns - begin_ns < most_s * 1e9:
            pass
        return (self.now_ns - begin_ns) * 1e-9


def test_after_one_stop_it_goes_on_from_standstill() -> None:
    bench = Bench()
    bench.stop(0.0)
    assert bench.held_s(0.0) <= 0.1


def test_after_another_one_at_the_same_place_the_gear_is_held() -> None:
    """What was: eight stops in four seconds, each a centimetre farther, until a bucket touched what no scanner saw."""
    bench = Bench()
    bench.stop(0.0)
    bench.held_s(0.0)
    bench.stop(0.05)
    assert bench.held_s(0.05) == pytest.approx(12.0, abs=0.3)  # longer than who drives takes it for stuck (8 s)


@pytest.mark.parametrize(("x_m", "asked_mps"), [(2.0, 0.3), (0.05, -0.3)])
def test_elsewhere_and_in_the_other_gear_it_is_free(x_m: float, asked_mps: float) -> None:
    bench = Bench()
    bench.stop(0.0)
    bench.held_s(0.0)
    bench.stop(0.05)
    bench.look(0.05, False)
    assert bench.held_s(x_m, asked_mps) <= 0.1


def test_near_a_stop_it_keeps_farther_off() -> None:
    """Rock stands out at another height than the scanner's: what was near enough to pass is too near there."""

    def free_at(bench: Bench, off_m: float) -> bool:
        bench.now_ns += LOOK_NS
        motion = Motion(bench.now_ns, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3)
        bench.watch.points("front", np.array([[NOSE_M + off_m, 0.2]]), motion)
        bench.watch.look(bench.now_ns, motion, 0.3, None, 0.0, standing=False)
        return not bench.watch.holds

    near_m = next(
        off for off in np.arange(0.02, 1.0, 0.01) if all(free_at(one, off) for one in [Bench()] for _ in range(4))
    )
    bench = Bench()
    bench.stop(0.0)
    bench.held_s(0.0)
    assert not all(free_at(bench, near_m + 0.01) for _ in range(4))


def test_where_nobody_asks_and_the_speed_is_noise_it_stays_held() -> None:
    bench = Bench()
    bench.stop(0.0)
    bench.held_s(0.0)
    bench.stop(0.05)
    for k in range(100):
        bench.now_ns += LOOK_NS
        motion = Motion(bench.now_ns, 0.05, 0.0, 0.0, 0.0, 0.0, 0.003 * (-1) ** k)
        bench.watch.points("front", NOTHING, motion)
        bench.watch.look(bench.now_ns, motion, None, None, 0.0, standing=True)
        assert bench.watch.holds


def test_who_digs_is_not_held() -> None:
    bench = Bench()
    for _ in range(3):
        bench.stop(0.0, digs=True)
        while bench.look(0.0, False, digs=True):
            pass
    assert bench.held_s(0.0) <= 0.1
