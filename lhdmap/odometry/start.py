"""The speed at the start: a dry run over the first scans, so that the first metre is not lost to finding it.

Undoing a sweep needs the speed, and a map begun with the wrong one stays distorted; in smooth walls it takes dozens of scans to
see the speed at all. The scans are run twice, the second time from what the first found; then the odometry begins for good.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray, LaserScan
from lhdmap.odometry.planar import Placement, PlanarOdometry, ScanView
from lhdmap.odometry.steps import OdometryStep, WheelStep

_SPAN_SCANS = 6  # the starting speed is the mean over so many scans
_LONGEST_SPAN_S = 1.0  # over more the speed of a machine changes
_WEAK_SHARE = 0.2  # of scans from which the walls are smooth: other speeds are tried, too
_NO_RESIDUAL_M = 1e-6  # of scans without noise
_SPEEDS_MPS = (0.0, 2.0, -2.0, 4.0, 6.0)  # tried: what loaders drive, mostly forward
_FEWEST_SCANS = 3  # two tell one step, which noise may be
_DRY_SCANS = 25  # of a run where walls hold; smooth ones want all there are


class ScanInput(NamedTuple):
    """What `PlanarOdometry.update` takes for one scan."""

    scan: LaserScan
    T_level_sensor: Placement
    wheels: WheelStep | None = None
    view: ScanView = ScanView()


Maker = Callable[[FloatArray | None], PlanarOdometry]  # takes a starting velocity, None: unknown


def starting_velocity(make: Maker, inputs: Sequence[ScanInput]) -> FloatArray | None:
    """Return forward, lateral and turning speed (3,) at the first scan, or None where the scans do not show it."""
    if len(inputs) < _FEWEST_SCANS:
        return None
    all_inputs, inputs = inputs, inputs[:_DRY_SCANS]
    steps = _run(make(None), inputs)
    if any(step.lost for step in steps):
        return None
    weak = np.mean([step.degenerate for step in steps if step.processed]) > _WEAK_SHARE
    if weak and all(one.wheels is None for one in inputs):  # else wheels tell it
        velocity = _by_trial(make, all_inputs, steps[-1].velocity)
    else:
        velocity = steps[-1].velocity
    steps = _run(make(velocity), inputs)
    return velocity if any(step.lost for step in steps) else _mean_velocity(steps)


def _by_trial(make: Maker, inputs: Sequence[ScanInput], about: FloatArray) -> FloatArray:
    """Return the speed (3,) at the last scan of the run that fits best, of runs that begin at one forward speed or another.

    A run from far off ends in a map that is smeared, whose walls fewer hits agree with; `about` (3,) has the turning speed.
    """
    tried = [_run(make(np.array([speed, 0.0, about[2]])), inputs) for speed in _SPEEDS_MPS]
    runs = [_second_half(steps) for steps in tried if not any(step.lost for step in steps)]
    if not runs:
        return about
    residuals_m = [_NO_RESIDUAL_M + float(np.mean([step.residual_m for step in run])) for run in runs]
    fits = [
        float(np.mean([step.support for step in run])) - residual_m / min(residuals_m)
        for run, residual_m in zip(runs, residuals_m, strict=True)
    ]
    best = runs[int(np.argmax(fits))]
    mean = _between(best)
    return best[-1].velocity if mean is None else mean


def _second_half(steps: Sequence[OdometryStep]) -> list[OdometryStep]:
    processed = [step for step in steps if step.processed]
    return processed[len(processed) // 2 :]


def _run(odometry: PlanarOdometry, inputs: Sequence[ScanInput]) -> list[OdometryStep]:
    odometry.clock.expect([one.scan.stamp_ns for one in inputs])
    return [odometry.update(*one) for one in inputs]


def _mean_velocity(steps: Sequence[OdometryStep]) -> FloatArray | None:
    processed = [step for step in steps if step.processed][:_SPAN_SCANS]
    mean = _between(processed)
    return processed[-1].velocity if mean is None and processed else mean


def _between(processed: Sequence[OdometryStep]) -> FloatArray | None:
    """Return the mean speed (3,) from the first to the last step, None where that is no time or a long one."""
    dt_s = (processed[-1].time_ns - processed[0].time_ns) * 1e-9 if len(processed) > 1 else 0.0
    if not 0.0 < dt_s < _LONGEST_SPAN_S:
        return None
    step = se2.between(processed[0].pose_odom_base, processed[-1].pose_odom_base)
    middle = 0.5 * step[2]
    c, s = np.cos(middle), np.sin(middle)
    return np.array([c * step[0] + s * step[1], -s * step[0] + c * step[1], step[2]]) / dt_s
