"""The inclinometer as the pipeline takes it: attitude and turns of its gyroscope, at a mount that may be told late."""

from __future__ import annotations

from collections import deque

from lhdmap.messages import Inclination
from lhdmap.pipeline.mounts import SensorMounts
from lhdmap.proprioception.attitude import AttitudeFilter, AttitudeSettings
from lhdmap.proprioception.gyro import Gyro, GyroSettings

_EARLY = 10_000  # inclinations that wait for their mount at most


class AttitudeSource:
    """Takes inclinations; `attitude` and `gyro` are there from the start, and `there` says whether any message came."""

    def __init__(self, attitude: AttitudeSettings, gyro: GyroSettings, mounts: SensorMounts) -> None:
        self._settings, self._gyro_settings, self._mounts = attitude, gyro, mounts
        self.attitude, self.gyro = AttitudeFilter(attitude), Gyro(gyro, attitude.lag_s)
        self.there = False
        self._early: deque[Inclination] | None = deque(maxlen=_EARLY)  # None once the attitude is in use
        self._newest: tuple[int, tuple[float, float]] = (-(2**63), (0.0, 0.0))  # what was asked for last

    def update(self, message: Inclination) -> None:
        """Take a message of the inclinometer."""
        first, self.there = not self.there, True
        if self._early is not None:
            self._early.append(message)
        if first:
            self.mount()
        else:
            self.attitude.update(message)
            self.gyro.update(message)

    def mount(self) -> None:
        """Begin the attitude, with the inclinometer's mount if it is known; once more where that comes late."""
        if not self._early:  # what was used already stands
            return
        frame, R_base_sensor = self._early[0].frame_id, None
        if self._mounts.known(frame):
            R_base_sensor = self._mounts.of(frame, "inclinometer").T_parent_child[:3, :3]
        self.attitude = AttitudeFilter(self._settings, R_base_sensor)
        self.gyro = Gyro(self._gyro_settings, self._settings.lag_s, R_base_sensor)
        for message in self._early:
            self.attitude.update(message)
            self.gyro.update(message)

    def begin(self) -> None:
        """Say that the first scan is used: the attitude stands from here on."""
        self._early = None

    def roll_pitch_at(self, time_ns: int) -> tuple[float, float]:
        """Return roll and pitch (rad); a log without inclinometer counts as level."""
        if self._newest[0] != time_ns:  # a scan asks twice, and the filter fits anew each time
            known = self.attitude.roll_pitch_at(time_ns) if self.there else (0.0, 0.0)
            self._newest = (time_ns, known)
        return self._newest[1]
