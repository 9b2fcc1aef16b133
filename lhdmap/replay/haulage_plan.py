"""`[haulage]` of a scenario: how a machine works on a surface site."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

_NOISE = "haulage findings: noise of the prototype"


@dataclass(frozen=True, slots=True)
class HaulagePlan:
    """How a machine works on a surface site, and what it is other than its model."""

    keeps: str = setting("", choices=("", "left", "right"), doc="Side that traffic keeps to; empty: as the site says.")
    load_s: float = setting(
        25.0,
        unit="s",
        minimum=1.0,
        maximum=3600.0,
        source="haulage findings, section 5",
        doc="Time until the body is full.",
    )
    dump_s: float = setting(
        18.0,
        unit="s",
        minimum=1.0,
        maximum=3600.0,
        source="haulage findings, section 5",
        doc="Time until it is empty.",
    )
    pose_m: float = setting(
        0.05, unit="m", minimum=0.0, maximum=5.0, source=_NOISE, doc="Noise of the front axle's place."
    )
    heading_deg: float = setting(
        0.3, unit="deg", minimum=0.0, maximum=10.0, source=_NOISE, doc="The same of its heading."
    )
    joint_deg: float = setting(0.3, unit="deg", minimum=0.0, maximum=10.0, source=_NOISE, doc="The same of the joint.")
    joint_offset_deg: float = setting(
        0.5, unit="deg", minimum=-10.0, maximum=10.0, source=_NOISE, doc="Offset of the joint's sensor."
    )
    slip_rad_per_g: float = setting(
        0.12,
        unit="rad/g",
        minimum=0.0,
        maximum=1.0,
        source="haulage findings, section 2",
        doc="Drift of both axles to the outside of bends, by lateral acceleration.",
    )
