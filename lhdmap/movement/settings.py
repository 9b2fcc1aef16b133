"""Settings of routes and of the check of a map."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

_PAPER = "topological_navigation, section 3.1: 12 to 24 km/h"
_SOFT = "assumed: half of what the drive can do"


@dataclass(frozen=True, slots=True)
class MovementSettings:
    """Routes over the topological map: what a movement costs in time, and what check-map wants."""

    limit_empty_kmh: float = setting(
        24.0,
        unit="km/h",
        source=_PAPER,
        minimum=0.5,
        doc="Highest speed with an empty bucket; a tunnel may allow less.",
    )
    limit_loaded_kmh: float = setting(
        18.0, unit="km/h", source="assumed, within the paper's 12 to 24 km/h", minimum=0.5, doc="The same loaded."
    )
    limit_reverse_kmh: float = setting(
        12.0, unit="km/h", source="assumed: the paper's lower speed", minimum=0.5, doc="The same in reverse gear."
    )
    acceleration_mps2: float = setting(
        0.5, unit="m/s2", source=_SOFT, minimum=0.01, doc="Acceleration when the machine leaves a stop."
    )
    deceleration_mps2: float = setting(
        0.6, unit="m/s2", source=_SOFT, minimum=0.01, doc="Deceleration when the machine comes to a stop."
    )
    inversion_s: float = setting(
        4.0, unit="s", source="assumed", minimum=0.0, doc="Time that a change of gear takes at a stop."
    )
    turn_s: float = setting(
        60.0, unit="s", source="assumed", minimum=0.0, doc="Time that the machine takes to turn round in a turning bay."
    )
    room_m: float = setting(
        0.3,
        unit="m",
        source="topology findings: width + 2 x 0.3 m",
        minimum=0.0,
        doc="check-map: room wanted beside the machine on either side; a tunnel with less is narrow.",
    )
    twin_m: float = setting(
        0.5, unit="m", minimum=0.0, doc="check-map: how far two access points that join may lie apart."
    )
    twin_deg: float = setting(
        10.0, unit="deg", minimum=0.0, doc="check-map: how far their headings may be off from opposite ones."
    )
