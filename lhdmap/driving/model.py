"""The numbers of a machine that control predicts with: from the machine file, for the load that it is told to carry."""

from __future__ import annotations

import math
from typing import NamedTuple

from lhdmap.machine import Machine


class DriveModel(NamedTuple):
    """Lengths, limits and lags, SI units.

    `brake_mps2`: mean deceleration of a full brake once its ramp (`brake_ramp_s`) is over; `deceleration_mps2`: of the drive.
    """

    front_m: float
    rear_m: float
    max_articulation_rad: float
    max_rate_rps: float
    steering_lag_s: float
    top_speed_mps: float
    drive_lag_s: float
    acceleration_mps2: float
    deceleration_mps2: float
    brake_mps2: float
    brake_ramp_s: float
    dead_time_s: float

    @property
    def wheelbase_m(self) -> float:
        """Distance of the axles when the machine is straight."""
        return self.front_m + self.rear_m

    def stopping_m(self, speed_mps: float, reaction_s: float = 0.0) -> float:
        """Return the way from a fault to standstill on a full brake: reaction, dead time, ramp, brake (guidance findings, Q6)."""
        speed = abs(speed_mps)
        blind = speed * (reaction_s + self.dead_time_s)
        ramp = self.brake_ramp_s
        after = speed - 0.5 * self.brake_mps2 * ramp
        if after <= 0.0:  # it stands before the brake is fully on
            until = math.sqrt(2.0 * speed * ramp / self.brake_mps2)
            return blind + speed * until * 2.0 / 3.0
        return blind + speed * ramp - self.brake_mps2 * ramp**2 / 6.0 + after**2 / (2.0 * self.brake_mps2)


def drive_model(machine: Machine, load_kg: float = 0.0) -> DriveModel:
    """Return the model of a machine; what depends on the load is linear up to the payload."""
    size, drive, brakes = machine.dimensions, machine.drive, machine.brakes
    share = min(max(load_kg / drive.payload_kg, 0.0), 1.0)

    def between(empty: float, loaded: float) -> float:
        return empty + share * (loaded - empty)

    return DriveModel(
        front_m=size.joint_to_front_axle_m,
        rear_m=size.joint_to_rear_axle_m,
        max_articulation_rad=math.radians(size.max_articulation_deg),
        max_rate_rps=math.radians(size.max_articulation_rate_dps),
        steering_lag_s=machine.steering.lag_s,
        top_speed_mps=size.max_speed_kmh / 3.6,
        drive_lag_s=between(drive.lag_s, drive.lag_loaded_s),
        acceleration_mps2=between(drive.acceleration_mps2, drive.acceleration_loaded_mps2),
        deceleration_mps2=between(drive.deceleration_mps2, drive.deceleration_loaded_mps2),
        brake_mps2=between(brakes.deceleration_mps2, brakes.deceleration_loaded_mps2),
        brake_ramp_s=brakes.ramp_s,
        dead_time_s=drive.dead_time_s,
    )
