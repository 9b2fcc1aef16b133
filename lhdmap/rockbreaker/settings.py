"""Settings of the rockbreaker's planner."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

PAPER = "rockbreaker_trajectories"


@dataclass(frozen=True, slots=True)
class RockbreakerSettings:
    """Planner of the rockbreaker: shape of the profile, blends, margins, and where the work plane lies."""

    min_ramp_s: float = setting(
        1.0,
        unit="s",
        source=f"{PAPER}, erratum 9: its Table 3 pins it to 0.975-1.000 s",
        minimum=0.01,
        maximum=60.0,
        doc="t_r,min: shortest time from rest to cruising speed.",
    )
    margin_deg: float = setting(
        0.1,
        unit="deg",
        source=f"{PAPER}, erratum 13",
        minimum=0.0,
        maximum=10.0,
        doc="How far inside the region of feasible orientations a shifted point is put.",
    )
    blend: float = setting(
        0.025,
        source=f"{PAPER}, section 3.4",
        minimum=0.001,
        maximum=0.25,
        doc="Width in sigma of the polynomial blend at a corner of the orientation.",
    )
    clearance_m: float = setting(
        0.3,
        unit="m",
        source="assumed",
        minimum=0.0,
        maximum=5.0,
        doc="Height of the work plane above the highest rock on the grizzly.",
    )
    table_hz: float = setting(
        50.0, unit="Hz", source="lhdmap", minimum=1.0, maximum=10000.0, doc="Rows a second of the table of a plan."
    )
