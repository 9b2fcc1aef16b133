"""Settings of docking."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

_MEASURED = "haulage findings, section 3"


@dataclass(frozen=True, slots=True)
class DockingSettings:
    """How a way to a dock is laid."""

    speed_mps: float = setting(
        1.2, unit="m/s", minimum=0.2, maximum=5.0, source=_MEASURED, doc="Speed that the joint's changes are laid for."
    )
    straight_m: float = setting(
        6.0, unit="m", minimum=0.0, maximum=30.0, source=_MEASURED, doc="Last straight where there is room ..."
    )
    least_straight_m: float = setting(
        4.0, unit="m", minimum=0.0, maximum=30.0, source=_MEASURED, doc="... and where there is not."
    )
    radius_share: float = setting(
        2.0,
        minimum=1.0,
        maximum=5.0,
        source=_MEASURED,
        doc="Radius of turns over the least one, where there is room ...",
    )
    least_radius_share: float = setting(
        1.3, minimum=1.0, maximum=5.0, doc="... and where there is not: the rest is the controller's."
    )
    joint_share: float = setting(
        0.9,
        minimum=0.3,
        maximum=1.0,
        doc="Share of the joint's largest angle and of the tracker's rate that is planned with.",
    )
    margin_m: float = setting(
        0.4, unit="m", minimum=0.0, maximum=5.0, doc="Room between both bodies and what bounds them."
    )
    cusps: int = setting(3, minimum=0, maximum=8, doc="Changes of gear at most.")
    nodes: int = setting(6000, minimum=100, maximum=200_000, doc="States that the search visits at most.")
