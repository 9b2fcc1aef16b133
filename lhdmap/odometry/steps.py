"""What the planar odometry says of each scan."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.scan_matching.step_error import NO_ERROR, StepError

BY_DEFINITION = 1e8 * np.eye(3)  # information of the pose that defines a frame


class WheelStep(NamedTuple):
    """Motion of the body by the wheels since the scan before: forward (m) and turn (rad) with standard deviations.

    `None` for what is not measured.
    """

    forward_m: float
    forward_sigma_m: float
    turn_rad: float | None
    turn_sigma_rad: float


class Matched(NamedTuple):
    """What a matcher says of one scan.

    `information` (3, 3) of the scan alone in `odom` axes, residual, share of hits that agree, whether the scan could not be
    placed (the pose is then the prediction), whether it was placed where the motion did not predict it, now or a moment ago, and
    whether just now. `noise` (3, 3): what of the information comes from noise of the walls' directions; `layered`: the scanner
    tilts; `alone`: no other scanner sees its walls again.
    """

    information: FloatArray
    residual_m: float
    support: float
    lost: bool
    doubtful: bool = False
    jumped: bool = False
    noise: FloatArray | None = None
    layered: bool = False
    alone: bool = True


class OdometryStep(NamedTuple):
    """Outcome of one scan.

    `pose_odom_base`: planar pose (3,) at `time_ns`, the middle of the sweep: there an error of the speed that undid the sweep does
    not move the scan as a whole; `covariance`: (3, 3) of that pose against the local map, in body axes (m, rad), a weak
    direction as wide as it is; `error`: what the step from the processed scan before adds to the error of the path, none where the
    scan was not processed; `information`: (3,) along, across (1/m²), heading (1/rad²) of this scan, the others unknown;
    `degenerate`: a direction was not observed; `substitute`: what stood in for it (`wheels`, `motion` or empty);
    `processed`: False where the adaptive rate only predicted; `lost`: the scan did not fit the map; `wheels`: what became of the
    wheels' step before it, and why (`WheelUse`); `unseen`: neither walls nor wheels told the motion in all directions.
    """

    stamp_ns: int
    time_ns: int
    pose_odom_base: FloatArray
    covariance: FloatArray
    velocity: FloatArray
    information: FloatArray
    residual_m: float
    support: float
    degenerate: bool
    substitute: str
    processed: bool
    lost: bool
    wheels: str = "none"
    error: StepError = NO_ERROR
    unseen: bool = False
