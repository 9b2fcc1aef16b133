"""The speed at the start: a dry run over the first scans, so that the first metre is not lost to finding it.

Undoing a sweep needs the speed, and a map begun with the wrong one stays distorted; in smooth walls it takes dozens of scans to
see the speed at all. The scans are run twice, the second time from what the first found; then the odometry begins for good.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray, LaserScan
from lhdmap.odometry.planar import Placement, PlanarOdometry, View
from lhdmap.odometry.steps import OdometryStep, WheelStep

_SPAN_SCANS = 6  # the starting speed is the mean over so many scans
_LONGEST_SPAN_S = 1.0
# Share of weak scans from which range flow tells the speed: its information has the noise of the slopes taken out, while a map of
# a few scans of a smooth wall holds any speed fast.
_WEAK_SHARE = 0.2
_FLOW_EVERY = 2  # scans between the beginnings of such runs
_DRY_SCANS = 25  # of a run against the map; range flow wants more


class ScanInput(NamedTuple):
    """What `PlanarOdometry.update` takes for one scan."""

    scan: LaserScan
    T_level_sensor: Placement
    wheels: WheelStep | None = None
    view: View = View()


class Maker(Protocol):
    """Makes an odometry with a starting velocity (None: unknown) and a method (empty: as it is set)."""

    def __call__(self, velocity: FloatArray | None, method: str = "") -> PlanarOdometry:
        """Return the odometry."""


def starting_velocity(make: Maker, inputs: Sequence[ScanInput]) -> FloatArray | None:
    """Return forward, lateral and turning speed (3,) at the first scan, or None where the scans do not show it."""
    if len(inputs) < 3:
        return None
    all_inputs, inputs = inputs, inputs[:_DRY_SCANS]
    steps = _run(make(None), inputs)
    if any(step.lost for step in steps):
        return None
    if np.mean([step.degenerate for step in steps if step.processed]) > _WEAK_SHARE:
        velocity = _by_flow(make, all_inputs)
    else:
        velocity = steps[-1].velocity
    steps = _run(make(velocity), inputs)
    return velocity if any(step.lost for step in steps) else _mean_velocity(steps)


def _by_flow(make: Maker, inputs: Sequence[ScanInput]) -> FloatArray:
    """Return the speed (3,) at the last scan by range flow, the median over runs that begin at one scan or another.

    A run whose first pair is far off stays off; where it begins elsewhere it is not.
    """
    late = range(0, len(inputs) // 2, _FLOW_EVERY)
    runs = [_settled_velocity(_run(make(None, "range_flow"), inputs[first:])) for first in late]
    found: FloatArray = np.median(runs, axis=0)
    return found


def _settled_velocity(steps: Sequence[OdometryStep]) -> FloatArray:
    """Return the mean speed (3,) over the second half of a run."""
    processed = [step for step in steps if step.processed]
    mean = _between(processed[len(processed) // 2 :])
    return steps[-1].velocity if mean is None else mean


def _run(odometry: PlanarOdometry, inputs: Sequence[ScanInput]) -> list[OdometryStep]:
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
    step = se2.between(processed[0].T_odom_base, processed[-1].T_odom_base)
    middle = 0.5 * step[2]
    c, s = np.cos(middle), np.sin(middle)
    return np.array([c * step[0] + s * step[1], -s * step[0] + c * step[1], step[2]]) / dt_s
