"""Roll and pitch of the front body from the inclinometer: smoothed without delay, and its lag undone.

The paper (Section 3.2) says only that the inclinometer's data "is filtered". Here a local quadratic is fitted around
the wanted time, with samples before and after it: no phase error, at the price that the attitude of a moment is final
only `lag_s + half_window_s` later (`ready_until_ns`). What it is worth: 0.3 s of lag left in costs 2.8 degrees of a
pile's inclination, 0.4 degrees of white noise 6.6 degrees. The lag is a delay or a first-order low pass, which
x + lag dx/dt undoes; they differ only where the body moves fast, and a wrong guess then leaves 0.1 degrees.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.geometry import se3
from lhdmap.messages import FloatArray, Inclination
from lhdmap.proprioception.local_fit import fit_at
from lhdmap.proprioception.samples import SampleBuffer, Warnings
from lhdmap.settings import setting

_SILENT_S = 1.0  # not worth a word below
LARGEST_TILT_RAD = math.radians(60.0)
_BEST_STD_RAD = math.radians(0.03)  # no attitude claims to be better
JUMP_RUN = 10  # so many samples in a row at a new level are no outliers but the level
THIRD_DIFFERENCE = math.sqrt(20.0)  # its standard deviation for white noise of one
NOISE_EVERY = 50
_ALIKE_M = (
    0.1  # way over which noise of the samples adds to the height as one error: a fit's window, less its averaging
)
_AT_BENDS_M = 0.03  # where the grade changes the body pitches about another point; measured on simulated drives


@dataclass(frozen=True, slots=True)
class AttitudeSettings:
    """Filter of the inclinometer."""

    lag_s: float = setting(
        0.1, unit="s", source="issue: inclinometer with 0.1 s lag", minimum=0.0, maximum=2.0,
        doc="Lag of the inclinometer that is undone.",
    )  # fmt: skip
    lag_kind: str = setting(
        "delay", choices=("delay", "first_order"),
        doc="delay: a sample stamped t shows the attitude at t - lag_s; first_order: a low pass of that time constant.",
    )  # fmt: skip
    half_window_s: float = setting(
        0.2, unit="s", source="measured: docs/integration.md", minimum=0.0, maximum=5.0,
        doc="Samples this long before and after a moment take part in its attitude.",
    )  # fmt: skip
    max_gap_s: float = setting(
        0.5, unit="s", minimum=0.01, doc="Across a longer gap, or farther from any sample, there is no attitude."
    )
    jump_deg: float = setting(
        4.0, unit="deg", minimum=0.1, doc="A sample this far from the last one is an outlier, unless it lasts."
    )
    bias_std_deg: float = setting(
        0.03, unit="deg", minimum=0.0, source="lhdmap: of an inclinometer whose mount was levelled",
        doc="How far its zero may be off, standard deviation: a height integrated over a way is off by that slope.",
    )  # fmt: skip
    frozen_s: float = setting(
        5.0, unit="s", minimum=0.1, doc="A sensor that repeats one value for this long is reported."
    )
    keep_s: float = setting(60.0, unit="s", minimum=1.0, doc="Samples are kept for this long.")


class Attitude(NamedTuple):
    """Attitude of `base_link` at one moment, radians; `std_rad` holds for roll and for pitch."""

    roll_rad: float
    pitch_rad: float
    std_rad: float


class Attitudes(NamedTuple):
    """Attitudes at many moments, each of shape (N,), radians; NaN where `valid` is false."""

    roll_rad: FloatArray
    pitch_rad: FloatArray
    std_rad: FloatArray
    valid: npt.NDArray[np.bool_]


class _SampleWatch:
    """Judges each sample by those before it: a jump, a value that stays to the last bit."""

    def __init__(self, settings: AttitudeSettings, samples: SampleBuffer, warnings: Warnings) -> None:
        self._settings, self._samples, self._warnings = settings, samples, warnings
        self._jump_rad = math.radians(settings.jump_deg)
        self._outliers = 0
        self._same_since_ns: int | None = None

    def is_outlier(self, stamp_ns: int, roll: float, pitch: float) -> bool:
        """Return whether a sample is far from the last one, and has not lasted yet."""
        newest_ns, last = self._samples.latest_ns, self._samples.latest_row
        if newest_ns is None or stamp_ns - newest_ns > self._settings.max_gap_s * 1e9:
            return False
        if not max(abs(roll - last[0]), abs(pitch - last[1])) > self._jump_rad:
            self._outliers = 0
            return False
        self._outliers += 1
        if self._outliers < JUMP_RUN:
            self._warnings.add(f"inclinometer: a jump of more than {self._settings.jump_deg:g} degrees; left out")
            return True
        self._warnings.add("inclinometer: its level changed at once and stayed; taken as true")
        self._outliers = 0
        return False

    def frozen(self, stamp_ns: int, roll: float, pitch: float) -> None:
        """Warn of a sensor that repeats one value."""
        if (roll, pitch) != self._samples.latest_row:
            self._same_since_ns = None
        elif self._same_since_ns is None:
            self._same_since_ns = self._samples.latest_ns
        elif stamp_ns - self._same_since_ns > self._settings.frozen_s * 1e9:
            self._warnings.add(f"inclinometer: the same values for more than {self._settings.frozen_s:g} s; frozen?")
            self._same_since_ns = stamp_ns


class _Held:
    """The last roll and pitch (rad) that were known, and for how long (s) they had to do at most."""

    def __init__(self) -> None:
        self._roll_pitch, self.silent_s = (0.0, 0.0), 0.0
        self._known_ns: int | None = None

    def after(self, stamp_ns: int, found: Attitude | None) -> tuple[float, float]:
        """Return what holds at a time, where this was found."""
        if found is not None:
            self._roll_pitch, self._known_ns = (found.roll_rad, found.pitch_rad), stamp_ns
        elif self._known_ns is not None:
            self.silent_s = max(self.silent_s, (stamp_ns - self._known_ns) * 1e-9)
        return self._roll_pitch


class AttitudeFilter:
    """Takes inclinometer messages in the order of the log and gives the attitude at any moment that is kept."""

    def __init__(self, settings: AttitudeSettings, R_base_sensor: FloatArray | None = None) -> None:
        """Args: `R_base_sensor`: how the inclinometer is mounted, shape (3, 3); None where its axes are the body's."""
        self.settings = settings
        self.warnings = Warnings()
        self._samples = SampleBuffer("inclinometer", 2, settings.keep_s, self.warnings)
        turned = R_base_sensor is not None and not np.array_equal(R_base_sensor, np.eye(3))
        self._R_sensor_base = np.asarray(R_base_sensor, dtype=float).T if turned else None
        self._watch = _SampleWatch(settings, self._samples, self.warnings)
        self._noise_rad = _BEST_STD_RAD
        self._taken = 0
        self._finished = False
        self._asked: tuple[int, int] = (0, -1)
        self._answer: Attitude | None = None
        self._held = _Held()

    def update(self, message: Inclination) -> None:
        """Take one message; values that cannot be are left out, with a warning."""
        roll, pitch = message.roll_rad, message.pitch_rad
        if self._R_sensor_base is not None and math.isfinite(roll) and math.isfinite(pitch):
            roll, pitch, _ = se3.to_rpy(se3.from_rpy(roll, pitch, 0.0)[:3, :3] @ self._R_sensor_base)
        if abs(roll) > LARGEST_TILT_RAD or abs(pitch) > LARGEST_TILT_RAD:
            self.warnings.add("inclinometer: a tilt of more than 60 degrees; left out")
            return
        self._watch.frozen(message.stamp_ns, roll, pitch)
        if self._watch.is_outlier(message.stamp_ns, roll, pitch):
            return
        if self._samples.append(message.stamp_ns, (roll, pitch)):
            self._taken += 1
            if self._taken % NOISE_EVERY == 0:
                self._noise_rad = _noise(self._samples.rows[-4 * NOISE_EVERY :])

    def finish(self) -> None:
        """Say that no more messages come: what there is, is final."""
        self._finished = True

    def ready_until_ns(self, now_ns: int) -> int:
        """Return the latest time whose attitude later messages will not change any more.

        `now_ns` is the newest stamp of the log: where the inclinometer has been silent for `max_gap_s`, or the log has
        ended, nothing is waited for.
        """
        newest_ns = self._samples.latest_ns
        if self._finished or (newest_ns is not None and now_ns - newest_ns > self.settings.max_gap_s * 1e9):
            return now_ns
        wait_ns = round((self.settings.lag_s + self.settings.half_window_s) * 1e9)
        return (now_ns - round(self.settings.max_gap_s * 1e9) if newest_ns is None else newest_ns) - wait_ns

    def attitude_at(self, stamp_ns: int) -> Attitude | None:
        """Return the attitude of `base_link` at a time, or None where there are no samples around it."""
        asked = stamp_ns, self._taken
        if asked != self._asked:  # the stages ask for the same moment one after the other
            self._answer, self._asked = self._attitude(stamp_ns), asked
        return self._answer

    def roll_pitch_at(self, stamp_ns: int) -> tuple[float, float]:
        """Return roll and pitch at a time, radians; where nothing is known the last ones, with a warning. Times rise."""
        found = self.attitude_at(stamp_ns)
        return self._held.after(stamp_ns, found)

    def causal_at(self, now_ns: int) -> Attitude | None:
        """Return the latest attitude that the samples so far tell of, at `now_ns` or before it; None where there is none.

        Not what `attitude_at` will say later: the samples lie on one side only, and the lag is not waited for.
        """
        newest_ns = self._samples.latest_ns
        if newest_ns is None:
            return None
        delay_s = self.settings.lag_s if self.settings.lag_kind == "delay" else 0.0
        return self._attitude(min(now_ns, newest_ns - round(delay_s * 1e9)))

    def height_std_m(self, way_m: float) -> float:
        """Return the standard deviation (m) of a height that was integrated along the slope of a way."""
        constant_m = math.radians(self.settings.bias_std_deg) * way_m
        return math.hypot(constant_m, self._noise_rad * math.sqrt(_ALIKE_M * way_m), _AT_BENDS_M)

    def texts(self) -> list[str]:
        """Return what was odd, in words."""
        silent_s = self._held.silent_s
        silent = f"inclinometer: silent for {silent_s:.1f} s and more; the attitude before was kept there"
        return [*self.warnings.texts(), *([silent] if silent_s > _SILENT_S else [])]

    def _attitude(self, stamp_ns: int) -> Attitude | None:
        values, factor = self._fit(np.array([stamp_ns], dtype=np.int64))
        noise = float(factor[0])
        if not math.isfinite(noise):
            return None
        std_rad = math.hypot(self._noise_rad * noise, _BEST_STD_RAD)
        return Attitude(float(values[0, 0]), float(values[0, 1]), std_rad)

    def attitudes_at(self, stamps_ns: npt.NDArray[np.int64]) -> Attitudes:
        """Return the attitudes of `base_link` at many times, shape (N,), in any order."""
        values, factor = self._fit(np.asarray(stamps_ns, dtype=np.int64))
        std = np.hypot(self._noise_rad * factor, _BEST_STD_RAD)
        return Attitudes(values[:, 0], values[:, 1], std, np.isfinite(factor))

    def _fit(self, stamps_ns: npt.NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
        """Return roll and pitch (N, 2) and how much of the noise is left in them (N,), NaN where there are no samples."""
        s, samples = self.settings, self._samples
        delay_s, rate_s = (s.lag_s, 0.0) if s.lag_kind == "delay" else (0.0, s.lag_s)
        shown_ns = stamps_ns + round(delay_s * 1e9)
        return fit_at(samples.stamps_ns, samples.rows, shown_ns, s.half_window_s, s.max_gap_s, rate_s)


def _noise(rows: FloatArray) -> float:
    """Return the standard deviation of the samples' white noise, robustly, from their third differences."""
    differences = np.abs(np.diff(rows, n=3, axis=0)).ravel()
    return float(1.4826 * np.median(differences) / THIRD_DIFFERENCE)
