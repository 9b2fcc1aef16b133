"""The settings of the sensors, with unit and source."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting
from lhdmap.settings_tree import part
from lhdmap.simulation.sections import FINDINGS

LMS511 = "data sheet of the SICK LMS511"
LOADING = "autonomous_loading, sections 3.4 and 3.5"
ASSUMED = "assumed, typical of 10 to 11-t loaders"


@dataclass(frozen=True, slots=True)
class ScannerSettings:
    """The 2D scanners, like SICK LMS511; rear and front alike."""

    beams: int = setting(381, source=LMS511, minimum=5, maximum=4000, doc="Beams over the field of view: 381 or 761.")
    field_of_view_deg: float = setting(
        190.0, unit="deg", source=LMS511, minimum=10.0, maximum=359.0, doc="Field of view."
    )
    rate_hz: float = setting(25.0, unit="Hz", source=LMS511, minimum=0.5, maximum=100.0, doc="Sweeps in a second.")
    noise_m: float = setting(
        0.012, unit="m", source=FINDINGS, minimum=0.0, maximum=0.5, doc="Range noise, standard deviation."
    )
    min_range_m: float = setting(0.2, unit="m", minimum=0.0, maximum=5.0, doc="Shortest range that is measured.")
    max_range_m: float = setting(
        80.0, unit="m", source=LMS511, minimum=1.0, maximum=200.0, doc="Longest range that is measured."
    )
    sweep: bool = setting(
        False, doc="Measure each beam at its own time (sweep distortion) instead of all at the stamp."
    )
    dust_share: float = setting(0.0, minimum=0.0, maximum=0.9, doc="Mean share of beams that a dust cloud returns.")
    mixed_pixel_share: float = setting(
        0.0, minimum=0.0, maximum=1.0, doc="Share of beams at depth edges that return a range between the two surfaces."
    )
    drop_out_share: float = setting(0.0, minimum=0.0, maximum=0.9, doc="Share of beams without a return.")
    blackouts: tuple[tuple[float, float], ...] = setting(
        (), unit="s, s", doc="Times without any return as (time in the log, duration)."
    )
    person: tuple[tuple[float, float, float], ...] = setting(
        (),
        unit="s, s, -",
        doc="Someone before the scanners as (time, duration, share of the beams hidden, from the right).",
    )
    rear: bool = setting(True, doc="Whether the machine has a rear scanner.")
    occlusion: bool = setting(True, doc="Whether the machine's own bodies hide what is behind them.")


@dataclass(frozen=True, slots=True)
class InclinometerSettings:
    """The inclinometer of the front body."""

    enabled: bool = setting(True, doc="Whether there is one.")
    rate_hz: float = setting(100.0, unit="Hz", minimum=1.0, maximum=1000.0, doc="Readings in a second.")
    noise_deg: float = setting(0.1, unit="deg", source="issue figures", minimum=0.0, maximum=5.0, doc="White noise.")
    lag_s: float = setting(0.1, unit="s", source="issue figures", minimum=0.0, maximum=2.0, doc="Lag of the reading.")
    lag_kind: str = setting(
        "first_order", choices=("first_order", "delay"), doc="Low pass of that time constant, or pure delay."
    )
    bias_roll_deg: float = setting(0.0, unit="deg", minimum=-10.0, maximum=10.0, doc="Constant error of the roll.")
    bias_pitch_deg: float = setting(0.0, unit="deg", minimum=-10.0, maximum=10.0, doc="Constant error of the pitch.")


@dataclass(frozen=True, slots=True)
class WheelSettings:
    """Tachometer and joint encoders."""

    enabled: bool = setting(True, doc="Whether they are in the log.")
    rate_hz: float = setting(50.0, unit="Hz", minimum=1.0, maximum=1000.0, doc="Readings in a second.")
    scale_error: float = setting(
        0.01,
        source="issue figures",
        minimum=0.0,
        maximum=0.5,
        doc="Size of the tachometer's scale error; the seed gives its sign.",
    )
    noise_mps: float = setting(0.02, unit="m/s", minimum=0.0, maximum=1.0, doc="White noise of the tachometer.")
    slip: bool = setting(
        False, doc="Whether the wheels slip in bursts; a machine that is stepped slips as its floor has it."
    )
    slip_burst_s: float = setting(
        2.0, unit="s", source="issue figures", minimum=0.1, maximum=60.0, doc="Length of a burst."
    )
    slip_every_s: float = setting(15.0, unit="s", minimum=1.0, maximum=600.0, doc="Mean time from burst to burst.")
    slip_size: float = setting(0.5, minimum=0.0, maximum=5.0, doc="Wheel speed over ground speed in a burst, less one.")
    articulation_noise_deg: float = setting(
        0.05, unit="deg", minimum=0.0, maximum=5.0, doc="White noise of the joint encoder."
    )


@dataclass(frozen=True, slots=True)
class PressureSettings:
    """Pressures of transmission, lift and tilt cylinder; they are there where the wheels' sensors are."""

    enabled: bool = setting(True, doc="Whether they are in the log.")
    rate_hz: float = setting(20.0, unit="Hz", minimum=1.0, maximum=1000.0, doc="Readings in a second, of each.")
    noise_bar: float = setting(2.0, unit="bar", minimum=0.0, maximum=100.0, doc="White noise.")
    relief_bar: float = setting(420.0, unit="bar", source=ASSUMED, minimum=50.0, doc="Most that the transmission has.")
    idle_bar: float = setting(60.0, unit="bar", source=ASSUMED, minimum=0.0, doc="Transmission without load.")
    drive_bar: float = setting(
        80.0, unit="bar·s²/m", source=ASSUMED, minimum=0.0, doc="Transmission for each m/s² that the wheels give."
    )
    lift_bar: float = setting(
        45.0, unit="bar", source=ASSUMED, minimum=0.0, doc="Lift cylinder with a level boom and an empty bucket."
    )
    load_bar: float = setting(
        9.0, unit="bar/t", source=ASSUMED, minimum=0.0, doc="Lift cylinder with a level boom, for each tonne of load."
    )
    tilt_bar: float = setting(
        12.0,
        unit="bar",
        source="below the contact threshold of 23 bar (autonomous_loading)",
        minimum=0.0,
        doc="Tilt cylinder that works against nothing.",
    )
    tilt_relief_bar: float = setting(
        250.0, unit="bar", source=ASSUMED, minimum=10.0, doc="Tilt cylinder at all that it can."
    )


@dataclass(frozen=True, slots=True)
class ImuSettings:
    """Gyroscope and accelerometer beside the inclinometer, in the same messages."""

    gyro: bool = setting(False, doc="Whether there is a gyroscope.")
    gyro_noise_dps: float = setting(0.1, unit="deg/s", minimum=0.0, maximum=10.0, doc="White noise of a reading.")
    gyro_bias_dps: float = setting(
        0.2, unit="deg/s", minimum=0.0, maximum=10.0, doc="Constant error, standard deviation over seeds."
    )
    gyro_walk_dps: float = setting(
        0.005, unit="deg/s/√s", minimum=0.0, maximum=1.0, doc="Random walk of the error, growth in a second."
    )
    accelerometer: bool = setting(False, doc="Whether there is an accelerometer.")
    acceleration_noise_mps2: float = setting(
        0.03, unit="m/s²", minimum=0.0, maximum=5.0, doc="White noise of a reading."
    )
    acceleration_bias_mps2: float = setting(
        0.05, unit="m/s²", minimum=0.0, maximum=5.0, doc="Constant error, standard deviation over seeds."
    )
    acceleration_walk_mps2: float = setting(
        0.001, unit="m/s²/√s", minimum=0.0, maximum=1.0, doc="Random walk of the error, growth in a second."
    )
    vibration_mps2: float = setting(
        0.3, unit="m/s²", minimum=0.0, maximum=20.0, doc="Shaking by the engine, standard deviation."
    )
    road_mps2: float = setting(
        0.2, unit="m/s² for each m/s", minimum=0.0, maximum=20.0, doc="Shaking by the road, standard deviation."
    )


@dataclass(frozen=True, slots=True)
class CloudSettings:
    """A spinning 3D scanner; its mount is the machine's `lidar_points`."""

    enabled: bool = setting(False, doc="Whether there is one.")
    rings: int = setting(16, minimum=1, maximum=256, doc="Beams above each other.")
    columns: int = setting(900, minimum=8, maximum=8000, doc="Times that the rings are measured in a turn.")
    rate_hz: float = setting(10.0, unit="Hz", minimum=0.5, maximum=50.0, doc="Turns in a second.")
    lowest_deg: float = setting(-15.0, unit="deg", minimum=-90.0, maximum=89.0, doc="Lowest ring.")
    highest_deg: float = setting(15.0, unit="deg", minimum=-89.0, maximum=90.0, doc="Highest ring.")
    noise_m: float = setting(0.02, unit="m", minimum=0.0, maximum=0.5, doc="Range noise, standard deviation.")
    min_range_m: float = setting(0.5, unit="m", minimum=0.0, maximum=20.0, doc="Shortest range that is measured.")
    max_range_m: float = setting(80.0, unit="m", minimum=1.0, maximum=300.0, doc="Longest range that is measured.")
    drop_out_share: float = setting(0.0, minimum=0.0, maximum=0.9, doc="Share of beams without a return.")
    position_m: tuple[float, float, float] = setting(
        (-0.5, 0.0, 2.6), unit="m", doc="Place on the front body where the machine has no mount 'lidar_points'."
    )


@dataclass(frozen=True, slots=True)
class SensorSettings:
    """All sensors of a machine."""

    scanner: ScannerSettings = part(ScannerSettings)
    inclinometer: InclinometerSettings = part(InclinometerSettings)
    imu: ImuSettings = part(ImuSettings)
    wheels: WheelSettings = part(WheelSettings)
    pressures: PressureSettings = part(PressureSettings)
    cloud: CloudSettings = part(CloudSettings)

    @property
    def reach_m(self) -> float:
        """How far the scanners see, metres."""
        return max(self.scanner.max_range_m, self.cloud.max_range_m if self.cloud.enabled else 0.0)
