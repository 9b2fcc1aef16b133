"""The figures of one drive in the style of Tables 3 and 4 of the navigation paper, without the walls.

The paper states neither rate nor units of Eqs. (22), (23), and both decide their values: E grows with the third power of the
step for a smooth signal. Here they are fixed: samples each 0.1 s; commands propel in ±1 and steering rate over the largest
in ±1; speed in km/h, articulation in degrees.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.evaluation.navigation.signals import Signals
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray

RATE_HZ = 10.0
STEP_S = 1.0 / RATE_HZ
STANDING_MPS = 0.1
_SIDEWAYS_SHARE = 1.0 / 3.0
_BY_PERSON = ("teleoperated", "assisted", "manual")
Flags = npt.NDArray[np.bool_]


class Samples(NamedTuple):
    """A drive sampled at `RATE_HZ`, in the middle of each step, columns (N,); NaN where nothing is known.

    `propel` and `steering` are u_v and u_ω in ±1.
    """

    time_s: FloatArray
    speed_mps: FloatArray
    articulation_rad: FloatArray
    propel: FloatArray
    steering: FloatArray
    mode: npt.NDArray[np.object_]

    @property
    def moving(self) -> Flags:
        """Whether the machine moves, shape (N,)."""
        return np.abs(self.speed_mps) > STANDING_MPS


def sampled(signals: Signals, machine: Machine, mode: str = "") -> Samples:
    """Return the drive at `RATE_HZ`; `mode` holds for all of it where the log has none."""
    time_s: FloatArray = (np.arange(round(signals.length_s * RATE_HZ), dtype=np.float64) + 0.5) * STEP_S
    largest_rps = math.radians(machine.dimensions.max_articulation_rate_dps)
    modes = signals.mode_at(time_s)
    if mode and not len(signals.mode.time_s):
        modes = np.full(len(time_s), mode, dtype=object)
    return Samples(
        time_s,
        signals.speed_mps.at(time_s),
        signals.articulation_rad.at(time_s),
        signals.propel.held(time_s),
        signals.steering_rate_rps.held(time_s) / largest_rps,
        modes,
    )


def operation_of(samples: Samples) -> str | None:
    """Return who drove: `autonomous` or `manual`, whichever moved it for longer, else `teleoperated`; None: not told."""
    times = {name: int(np.count_nonzero(samples.moving & (samples.mode == name))) for name in ("autonomous", "manual")}
    if any(times.values()):
        return max(times, key=lambda name: times[name])
    for name in ("autonomous", "manual", "assisted", "teleoperated"):
        if (samples.mode == name).any():
            return "teleoperated" if name == "assisted" else name
    return None


def table_3(samples: Samples, length_s: float) -> dict[str, float | str | None]:
    """Return times, speeds and distances: length = navigation + stop + tele-operation + unknown time, as in Table 3.

    Tele-operation: all that a person drives in a drive of the autonomous system. TD, TAD net and travelled (erratum).
    """
    operation, known, moving = operation_of(samples), np.isfinite(samples.speed_mps), samples.moving
    by_person = np.isin(samples.mode, [name for name in _BY_PERSON if name != operation])
    navigating = moving & ~by_person
    speed = np.where(moving, samples.speed_mps, 0.0)
    found: dict[str, float | str | None] = dict.fromkeys(TABLE_3)
    found |= {"operation": operation, "length_s": length_s, "unknown_s": length_s}
    if not known.any():
        return found
    seen = len(samples.mode) > 0 and samples.mode[0] != ""
    autonomous = samples.mode == "autonomous"
    navigation_s = STEP_S * float(np.count_nonzero(navigating))
    travelled_m = STEP_S * float(np.abs(speed).sum())
    return found | {
        "heading": _heading(speed),
        "mean_speed_kmh": 3.6 * STEP_S * float(np.abs(speed[navigating]).sum()) / navigation_s
        if navigation_s
        else None,
        "max_speed_kmh": 3.6 * float(np.nanmax(np.abs(samples.speed_mps))),
        "navigation_s": navigation_s,
        "stop_s": STEP_S * float(np.count_nonzero(known & ~moving & ~by_person)),
        "teleoperation_s": STEP_S * float(np.count_nonzero(known & by_person)) if seen else None,
        "unknown_s": max(length_s - STEP_S * float(np.count_nonzero(known)), 0.0),
        "td_net_m": abs(STEP_S * float(speed.sum())),
        "td_travelled_m": travelled_m,
        "tad_net_m": abs(STEP_S * float(speed[autonomous].sum())) if autonomous.any() else None,
        "tad_travelled_m": STEP_S * float(np.abs(speed[autonomous]).sum()) if autonomous.any() else None,
    }


TABLE_3 = (
    "operation", "heading", "mean_speed_kmh", "max_speed_kmh", "length_s", "navigation_s", "stop_s", "teleoperation_s",
    "unknown_s", "td_net_m", "td_travelled_m", "tad_net_m", "tad_travelled_m",
)  # fmt: skip


def _heading(speed_mps: FloatArray) -> str | None:
    """Return `F` or `B` by the sign of travel, `both` where more than a third of the way goes against the rest."""
    ahead, back = float(speed_mps[speed_mps > 0].sum()), -float(speed_mps[speed_mps < 0].sum())
    if ahead + back == 0.0:
        return None
    if min(ahead, back) > _SIDEWAYS_SHARE * (ahead + back):
        return "both"
    return "F" if ahead > back else "B"


def smoothness(samples: Samples) -> dict[str, float | None]:
    """Return ACD, MCD (Eq. (22)), ASD, MSD (Eq. (23)) of the whole drive, and the means while the machine moves."""
    commands = squared_steps(samples.propel, samples.steering)
    states = squared_steps(3.6 * samples.speed_mps, np.degrees(samples.articulation_rad))
    moving = samples.moving[:-1] | samples.moving[1:]
    return {
        "acd": _mean(commands),
        "mcd": _largest(commands),
        "asd": _mean(states),
        "msd": _largest(states),
        "largest_command": _largest(np.abs(np.concatenate([samples.propel, samples.steering]))),
        "acd_moving": _mean(commands[moving]),
        "asd_moving": _mean(states[moving]),
    }


def squared_steps(first: FloatArray, second: FloatArray, step_s: float = STEP_S) -> FloatArray:
    """Return E of Eqs. (22), (23) for each pair of neighbouring samples (N,) of two signals, shape (N - 1,)."""
    return (np.diff(first) ** 2 + np.diff(second) ** 2) * step_s


def _mean(values: FloatArray) -> float | None:
    values = values[np.isfinite(values)]
    return float(values.mean()) if len(values) else None


def _largest(values: FloatArray) -> float | None:
    values = values[np.isfinite(values)]
    return float(values.max()) if len(values) else None
