"""What drives, steers, brakes and lifts: sections of a machine file beside its dimensions; docs/machine.md has the model."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lhdmap.errors import ConfigError
from lhdmap.settings import setting

_CLASS = "assumed, typical of 10 to 11-t loaders"
_GUIDANCE = "assumed, as in the guidance prototype"
_LOADING = "assumed, as in the loading prototype"


@dataclass(frozen=True, slots=True)
class Drive:
    """Mass, engine and hydrostatic drive; what has a value for the loaded machine is linear in the load between."""

    mass_kg: float = setting(30_000.0, unit="kg", source=_CLASS, minimum=100.0, doc="Mass of the empty machine.")
    payload_kg: float = setting(
        11_000.0, unit="kg", source="the papers' 11-t machine", minimum=1.0, doc="Load of a full bucket."
    )
    engine_power_kw: float = setting(
        150.0, unit="kW", source=_LOADING, minimum=1.0, doc="Power that reaches the wheels."
    )
    max_force_kn: float = setting(
        157.0,
        unit="kN",
        source="assumed: 3 litres per radian at the wheel, relief at 420 bar, tyres of 0.8 m",
        minimum=1.0,
        doc="Largest force of the drive at the tyres, driving or holding back.",
    )
    rolling_resistance: float = setting(
        0.035,
        source="mine-road handbooks give 3 to 5 %",
        minimum=0.0,
        maximum=0.3,
        doc="Rolling resistance per weight.",
    )
    slip_stiffness: float = setting(
        8.0, source=_LOADING, minimum=0.5, doc="k of the tyres' curve: force / weight = friction (1 - exp(-k slip))."
    )
    lag_s: float = setting(0.5, unit="s", source=_GUIDANCE, minimum=0.01, doc="Time constant of the wheels' speed.")
    lag_loaded_s: float = setting(0.7, unit="s", source=_GUIDANCE, minimum=0.01, doc="The same with a full bucket.")
    acceleration_mps2: float = setting(
        1.0, unit="m/s2", source=_GUIDANCE, minimum=0.01, doc="Largest acceleration of the wheels by the drive."
    )
    acceleration_loaded_mps2: float = setting(
        0.6, unit="m/s2", source=_GUIDANCE, minimum=0.01, doc="The same with a full bucket."
    )
    deceleration_mps2: float = setting(
        1.5, unit="m/s2", source=_GUIDANCE, minimum=0.01, doc="Largest deceleration of the wheels by the drive."
    )
    deceleration_loaded_mps2: float = setting(
        1.2, unit="m/s2", source=_GUIDANCE, minimum=0.01, doc="The same with a full bucket."
    )
    dead_time_s: float = setting(
        0.25, unit="s", source=_GUIDANCE, minimum=0.0, maximum=5.0, doc="From a command given to its effect."
    )


@dataclass(frozen=True, slots=True)
class Steering:
    """The steering valve; the largest rate and angle of the joint are in [dimensions]."""

    lag_s: float = setting(0.2, unit="s", source=_GUIDANCE, minimum=0.001, doc="Time constant of the joint's rate.")
    gain: float = setting(
        1.0, source="ideal; 0.95 to 1.05 in the guidance prototype", minimum=0.1, maximum=3.0, doc="Rate over command."
    )
    dead_zone_dps: float = setting(
        0.0, unit="deg/s", source="ideal", minimum=0.0, maximum=10.0, doc="Commands up to this move nothing."
    )


@dataclass(frozen=True, slots=True)
class Brakes:
    """The service brakes at full: on or off, the drive in neutral meanwhile."""

    deceleration_mps2: float = setting(
        2.5, unit="m/s2", source=_GUIDANCE, minimum=0.1, doc="What the brakes alone do to the empty machine."
    )
    deceleration_loaded_mps2: float = setting(
        2.0, unit="m/s2", source=_GUIDANCE, minimum=0.1, doc="The same with a full bucket."
    )
    ramp_s: float = setting(0.3, unit="s", source=_GUIDANCE, minimum=0.001, doc="From no to full force, linear.")


@dataclass(frozen=True, slots=True)
class Linkage:
    """Boom and bucket in the plane x-z of `base_link`; tramming: boom at its lower stop, bucket rolled back to its upper one."""

    pivot_m: tuple[float, float] = setting((-0.3, 1.45), unit="m", source=_LOADING, doc="The boom's pivot (x, z).")
    boom_m: float = setting(2.2, unit="m", source=_LOADING, minimum=0.1, doc="From the pivot to the bucket's pin.")
    boom_angle_rad: float = setting(
        -0.472, unit="rad", source=_LOADING, doc="Angle of the line from pivot to pin, boom at its lower stop."
    )
    lip_m: tuple[float, float] = setting(
        (1.55, -0.45), unit="m", source=_LOADING, doc="From the pin to the lip (x, z), bucket level."
    )
    heel_m: tuple[float, float] = setting((-0.18, -0.45), unit="m", source=_CLASS, doc="The same of the bucket's heel.")
    top_m: tuple[float, float] = setting((0.1, 0.9), unit="m", source=_CLASS, doc="The same of its upper edge.")
    bucket_angle_rad: float = setting(
        0.8, unit="rad", source=_LOADING, doc="Angle of the bucket's floor when tramming; positive: lip up."
    )
    boom_to_bucket: float = setting(
        0.5,
        source=_LOADING,
        minimum=-1.0,
        maximum=1.0,
        doc="How far the bucket turns with the boom (1: as if fixed to it).",
    )
    boom_min_rad: float = setting(0.0, unit="rad", source=_CLASS, doc="Lower stop of `boom_lift`.")
    boom_max_rad: float = setting(1.2, unit="rad", source=_CLASS, doc="Upper stop of `boom_lift`.")
    bucket_min_rad: float = setting(-2.2, unit="rad", source=_CLASS, doc="Lower stop of `bucket_tilt`: dumped.")
    bucket_max_rad: float = setting(0.0, unit="rad", source=_CLASS, doc="Upper stop of `bucket_tilt`: rolled back.")
    lift_rate_rps: float = setting(0.16, unit="rad/s", source=_LOADING, minimum=0.01, doc="Boom at full engine speed.")
    tilt_rate_rps: float = setting(
        0.24,
        unit="rad/s",
        source="fitted to the loading paper's Table 5",
        minimum=0.01,
        doc="Bucket at full engine speed.",
    )
    lag_s: float = setting(0.2, unit="s", source=_LOADING, minimum=0.001, doc="Time constant of both rates.")
    shared: float = setting(
        0.6,
        source="autonomous_loading, section 3.4",
        minimum=0.1,
        maximum=1.0,
        doc="Share of the rates when both move.",
    )
    idle_share: float = setting(
        0.6, source=_CLASS, minimum=0.05, maximum=1.0, doc="Share of the rates without `full_rpm`."
    )

    def __post_init__(self) -> None:
        """Raise ConfigError where the stops are not in order."""
        for name, low, high in (
            ("boom", self.boom_min_rad, self.boom_max_rad),
            ("bucket", self.bucket_min_rad, self.bucket_max_rad),
        ):
            if not (math.isfinite(low) and math.isfinite(high) and low < high):
                raise ConfigError(f"{name}_min_rad = {low:g} must be below {name}_max_rad = {high:g}")


@dataclass(frozen=True, slots=True)
class Spread:
    """How far a machine of a simulation is from what its file says: another one for each seed; the control knows the file."""

    steering_gain: float = setting(
        0.0,
        source="0.05 in the guidance prototype",
        minimum=0.0,
        maximum=0.5,
        doc="Largest relative error of the gain.",
    )
    lags: float = setting(
        0.0, source="0.1 in the guidance prototype", minimum=0.0, maximum=0.5, doc="Largest relative error of the lags."
    )


@dataclass(frozen=True, slots=True)
class Digging:
    """What counts in the pile: first gear of the hydrostatic transmission, cylinders' forces, the bucket, its weighing."""

    gravity_centre_m: float = setting(
        1.8, unit="m", source=_LOADING, minimum=0.1, doc="Centre of gravity of the empty machine behind the front axle."
    )
    first_gear_mps: float = setting(
        2.6, unit="m/s", source=_LOADING, minimum=0.1, doc="Speed in first gear at full pedal and engine speed."
    )
    displacement_l: float = setting(
        3.0, unit="l/rad", source=_LOADING, minimum=0.01, doc="Oil for a turn of the wheels: 300 bar are 112 kN."
    )
    relief_bar: float = setting(
        420.0, unit="bar", source=_CLASS, minimum=50.0, doc="Most that the transmission has at full engine speed."
    )
    loss_bar: float = setting(
        18.5, unit="bar", source="46 bar of free rolling, loading prototype", minimum=0.0, doc="Lost in the drive line."
    )
    leakage: float = setting(
        0.1,
        source="launch peaks of the loading prototype",
        minimum=0.0,
        maximum=0.5,
        doc="Speed lost by leakage at 300 bar, of first gear's.",
    )
    stiffness_gpa_m3: float = setting(
        100.0, unit="GPa/m3", source=_LOADING, minimum=1.0, doc="Bulk modulus of the oil over the volume of its lines."
    )
    wheel_inertia_kgm2: float = setting(
        2500.0, unit="kg m2", source=_LOADING, minimum=10.0, doc="Wheels and what turns with them."
    )
    idle: float = setting(
        0.4,
        source="0.87 m/s at pedal 0.5",
        minimum=0.05,
        maximum=1.0,
        doc="Engine speed without pedal, of its largest.",
    )
    engine_lag_s: float = setting(0.5, unit="s", source=_LOADING, minimum=0.01, doc="Lag of the engine's speed.")
    pump_lag_s: float = setting(0.25, unit="s", source=_LOADING, minimum=0.01, doc="Lag of the pump's stroke.")
    lift_force_kn: float = setting(230.0, unit="kN", source=_LOADING, minimum=1.0, doc="Lift breakout at the lip.")
    tilt_force_kn: float = setting(190.0, unit="kN", source=_LOADING, minimum=1.0, doc="Tilt breakout at the lip.")
    tilt_free_bar: float = setting(
        12.0,
        unit="bar",
        source="below the contact threshold of 23 bar",
        minimum=0.0,
        doc="Tilt cylinder against nothing.",
    )
    tilt_relief_bar: float = setting(250.0, unit="bar", source=_CLASS, minimum=10.0, doc="Tilt cylinder at its most.")
    lift_empty_bar: float = setting(
        52.0,
        unit="bar",
        source="autonomous_loading, Table 2",
        minimum=0.0,
        doc="Lift cylinder at boom 0.2, bucket empty.",
    )
    lift_full_bar: float = setting(
        100.4, unit="bar", source="autonomous_loading, Table 2", minimum=0.0, doc="The same with a full bucket."
    )
    floor_stiffness_kn_m: float = setting(
        400.0, unit="kN/m", source=_CLASS, minimum=1.0, doc="Force of a pressed lip for each metre that it is too low."
    )
    bucket_width_m: float = setting(2.4, unit="m", source=_LOADING, minimum=0.5, doc="Width of the bucket inside.")
    bucket_volume_m3: float = setting(
        5.0, unit="m3", source=_LOADING, minimum=0.1, doc="Nominal volume: the payload, loose."
    )
