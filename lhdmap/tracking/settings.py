"""Settings of path tracking."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

METHODS = ("both", "circles", "paper")
_MEASURED = "haulage findings, section 1"
_NOISE = "haulage findings: noise of the prototype"


@dataclass(frozen=True, slots=True)
class TrackingSettings:
    """Path tracking of both bodies: the law, its weights, the filter, and what limits the speed."""

    method: str = setting(
        "both",
        choices=METHODS,
        doc="both: reference curve of both bodies; circles: Eq. (10) at local circles; paper: Eqs. (4) to (12) as printed.",
    )
    smoothing_m: float = setting(
        0.8, unit="m", minimum=0.0, maximum=10.0, doc="Waypoints are smoothed over so much of the path."
    )
    look_m: float = setting(
        3.0,
        unit="m",
        minimum=0.5,
        maximum=20.0,
        source=_MEASURED,
        doc="circles: least distance of the three points of a circular look-ahead.",
    )
    clip_m: float = setting(
        0.8,
        unit="m",
        minimum=0.05,
        maximum=10.0,
        source="haulage findings, section 2",
        doc="Larger offsets count as this one: without it, 2 m of offset end in a limit cycle.",
    )
    sum_weight: float = setting(
        100.0, unit="1/m2", minimum=0.0, source=_MEASURED, doc="What z0 + z1 costs: the criterion, Eq. (7)."
    )
    axle_weight: float = setting(25.0, unit="1/m2", minimum=0.1, source=_MEASURED, doc="What z0 and z1 cost, each.")
    heading_weight: float = setting(
        20.0, unit="1/rad2", minimum=0.0, source=_MEASURED, doc="What a heading off the path costs."
    )
    joint_weight: float = setting(
        5.0, unit="1/rad2", minimum=0.0, source=_MEASURED, doc="What the joint's angle costs."
    )
    rate_weight: float = setting(400.0, unit="s2/rad2", minimum=1.0, source=_MEASURED, doc="What its rate costs.")
    rate_share: float = setting(
        0.8,
        minimum=0.1,
        maximum=1.0,
        source=_MEASURED,
        doc="Share of the joint's largest rate that a curve may ask for.",
    )
    slow_mps: float = setting(
        1.2,
        unit="m/s",
        minimum=0.05,
        maximum=2.0,
        source="measured: at 0.3 the noise of the pose bends the joint by 2 deg at a dock",
        doc="Gains are those of this speed below it, and the joint comes to rest with the machine.",
    )
    lateral_mps2: float = setting(
        1.2, unit="m/s2", minimum=0.1, maximum=5.0, source="haulage findings, section 0", doc="Acceleration in bends."
    )
    swerve_share: float = setting(
        2.0,
        minimum=1.0,
        maximum=20.0,
        doc="How much more of it than `lateral_mps2` feedback may ask for: the joint is held within that.",
    )
    aside_mps: float = setting(
        3.0, unit="m/s", minimum=0.2, maximum=20.0, doc="Speed while it is farther from the path than `clip_m`."
    )
    accelerate_mps2: float = setting(0.5, unit="m/s2", minimum=0.05, maximum=3.0, doc="Speeding up.")
    brake_mps2: float = setting(
        0.35, unit="m/s2", minimum=0.05, maximum=3.0, source="haulage findings, section 3", doc="Slowing down."
    )
    pose_std_m: float = setting(0.05, unit="m", minimum=0.001, maximum=1.0, source=_NOISE, doc="Deviation of a pose.")
    pose_std_deg: float = setting(
        0.3, unit="deg", minimum=0.01, maximum=10.0, source=_NOISE, doc="The same of its heading."
    )
    joint_std_deg: float = setting(
        0.3, unit="deg", minimum=0.01, maximum=10.0, source=_NOISE, doc="The same of the joint."
    )
    joint_offset_deg: float = setting(
        0.7, unit="deg", minimum=0.0, maximum=10.0, source=_NOISE, doc="Offset of the joint's sensor that is expected."
    )
    slip_noise: float = setting(
        0.015,
        unit="rad/s1/2",
        minimum=0.0,
        maximum=1.0,
        doc="How quickly the slip angle of the axles changes, from `slip_full_mps` on.",
    )
    slip_full_mps: float = setting(
        5.6,
        unit="m/s",
        minimum=0.1,
        maximum=20.0,
        source="haulage findings, section 2",
        doc="Below it the noise falls with the fourth power of the speed: slow machines do not slip, and noise would.",
    )
    gate: float = setting(
        5.0, minimum=1.0, maximum=100.0, doc="Deviations from which on a pose is not believed; a few in a row are."
    )
    lost_m: float = setting(
        20.0, unit="m", minimum=0.5, maximum=100.0, doc="Farther from the path the machine stops: it is on another one."
    )
    age_s: float = setting(
        0.5, unit="s", minimum=0.05, maximum=5.0, doc="The machine stops where the last motion is older."
    )
