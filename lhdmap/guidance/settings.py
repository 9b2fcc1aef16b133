"""Settings of guidance."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

METHODS = ("gauss_newton", "paper")
_MEASURED = "guidance findings, section 2"


@dataclass(frozen=True, slots=True)
class GuidanceSettings:
    """Model-predictive guidance: horizon, weights, and what limits the speed."""

    method: str = setting(
        "gauss_newton",
        choices=METHODS,
        doc="gauss_newton: signed clearances of both outlines, a route term; paper: Eqs. (12) to (19) as printed, sampled.",
    )
    stages: int = setting(24, minimum=5, maximum=60, source=_MEASURED, doc="Stages of the horizon.")
    stage_s: float = setting(0.15, unit="s", minimum=0.05, maximum=0.5, source=_MEASURED, doc="Time of a stage.")
    reach_m: float = setting(
        8.0,
        unit="m",
        minimum=1.0,
        maximum=40.0,
        doc="Way that the horizon covers at least: stages take longer where the machine is slow.",
    )
    creep_mps: float = setting(
        0.4,
        unit="m/s",
        minimum=0.1,
        maximum=2.0,
        doc="Speed that is predicted with at least, where the way seems blocked too.",
    )
    iterations: int = setting(6, minimum=1, maximum=30, source=_MEASURED, doc="Gauss-Newton steps of a cycle at most.")
    rate_dps: float = setting(
        12.0,
        unit="deg/s",
        minimum=1.0,
        maximum=60.0,
        source=_MEASURED,
        doc="Steering rate that is planned with at most.",
    )
    near_m: float = setting(0.8, unit="m", minimum=0.1, maximum=3.0, source=_MEASURED, doc="Clearance that is wanted.")
    near_weight: float = setting(1.0, unit="1/m2", minimum=0.0, source=_MEASURED, doc="What less of it costs.")
    close_m: float = setting(
        0.22, unit="m", minimum=0.02, maximum=1.0, source=_MEASURED, doc="Clearance that is needed."
    )
    close_weight: float = setting(30.0, unit="1/m2", minimum=0.0, source=_MEASURED, doc="What less of it costs.")
    field_error_m: float = setting(
        0.03,
        unit="m",
        minimum=0.0,
        maximum=0.3,
        source="measured: local map against the walls",
        doc="Taken off each clearance.",
    )
    lateral_weight: float = setting(
        0.2, unit="1/m2", minimum=0.0, source=_MEASURED, doc="What being off the route costs."
    )
    heading_weight: float = setting(
        0.5, unit="1/rad2", minimum=0.0, source=_MEASURED, doc="What a heading off it costs."
    )
    end_share: float = setting(5.0, minimum=1.0, source=_MEASURED, doc="How much more the last stage's place counts.")
    change_weight: float = setting(
        120.0,
        unit="s2/rad2",
        minimum=0.0,
        source="40 to 200 in the guidance findings",
        doc="What changes of the rate cost.",
    )
    rate_weight: float = setting(4.0, unit="s2/rad2", minimum=0.0, source=_MEASURED, doc="What the rate itself costs.")
    narrow_mps: float = setting(
        0.4,
        unit="m/s",
        minimum=0.05,
        maximum=5.0,
        source="guidance findings, Q1: slow in the narrow",
        doc="Speed at 0.05 m of clearance.",
    )
    beside_mps: float = setting(
        1.5, unit="m/s", minimum=0.1, maximum=10.0, doc="Speed at 0.2 m of clearance; free at 0.5 m."
    )
    ahead_m: float = setting(
        0.6,
        unit="m",
        minimum=0.0,
        maximum=3.0,
        doc="Room before the middle of the leading edge in which it does not drive.",
    )
    lateral_mps2: float = setting(
        1.2, unit="m/s2", minimum=0.1, maximum=5.0, source=_MEASURED, doc="Acceleration in bends."
    )
    accelerate_mps2: float = setting(0.6, unit="m/s2", minimum=0.05, maximum=3.0, doc="Speeding up.")
    brake_mps2: float = setting(
        0.8, unit="m/s2", minimum=0.05, maximum=3.0, source=_MEASURED, doc="Slowing down as planned."
    )
    jerk_mps3: float = setting(
        0.8, unit="m/s3", minimum=0.05, maximum=20.0, doc="How quickly the speeding up may begin."
    )
    sight_brake_share: float = setting(
        0.8, minimum=0.1, maximum=1.0, doc="Share of the full brake that has to suffice for a stop within what is seen."
    )
    memory_m: float = setting(
        14.0,
        unit="m",
        minimum=2.0,
        maximum=60.0,
        source="a tilted scanner sees low walls from afar alone",
        doc="Travel whose scans are kept.",
    )
    samples: int = setting(96, minimum=8, maximum=5000, source="guidance findings", doc="paper: rollouts of a round.")
    rounds: int = setting(4, minimum=1, maximum=20, source="guidance findings", doc="paper: rounds of sampling.")
