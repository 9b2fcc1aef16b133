"""Planning time of the rockbreaker: warm, over random pairs of poses, and whether it grows in proportion with their number."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.plan import Planner, Request
from lhdmap.rockbreaker.timing import Timing

from tools.bench.stages import reference_kernel
from tools.evaluate.figures import Figure
from tools.evaluate.rockbreaker import random_poses

_GROUP = "Rockbreaker: a whole plan with validation, random pairs of poses, warm"
_TARGETS_MS: dict[Timing, float] = {"paper": 20.0, "smooth": 50.0}
_PAIRS, _SHIFT = 300, 10_000


def rockbreaker_figures(shift: int = _SHIFT) -> Iterator[Figure]:
    """Measure single plans by timing, then a shift of `shift` plans beside a tenth of it."""
    planner = Planner()
    poses = random_poses(planner.machine, 2 * _PAIRS)
    for timing, target in _TARGETS_MS.items():
        requests = _requests(poses, timing)
        planner.warm_up(requests[0])
        started = time.thread_time()
        reference_kernel(50_000)
        reference_ms = 1e3 * (time.thread_time() - started)
        spent = np.array([planner.plan(one).planning_ms for one in requests])
        note = f"{np.median(spent) / reference_ms:.1f} × reference; p99 {np.percentile(spent, 99):.1f} ms"
        yield Figure(_GROUP, f"`{timing}`: median", float(np.median(spent)), "ms", target, note)
    few, many = (_total_s(planner, poses, count) for count in (shift // 10, shift))
    yield Figure(_GROUP, f"{shift} plans over ten times {shift // 10}", many / (10.0 * few), "×", 1.15, f"{many:.0f} s")


def _requests(poses: FloatArray, timing: Timing) -> list[Request]:
    pairs = zip(poses[::2], poses[1::2], strict=True)
    return [Request(a[:3], b[:3], float(a[3]), float(b[3]), "dsjm", timing) for a, b in pairs]


def _total_s(planner: Planner, poses: FloatArray, count: int) -> float:
    """Return the CPU time of `count` plans, pairs over and over."""
    requests = _requests(poses, "smooth")
    started = time.thread_time()
    for k in range(count):
        planner.plan(requests[k % len(requests)])
    return time.thread_time() - started
