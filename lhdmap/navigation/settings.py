"""Settings of navigation control."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

_PAPER = "topological_navigation, section 3.4.1; the value is not printed"


@dataclass(frozen=True, slots=True)
class NavigationSettings:
    """When a target counts as reached or missed, how the path is laid, and what is tried where a pass is too tight."""

    speed_limit_kmh: float = setting(
        20.0, unit="km/h", minimum=0.5, maximum=40.0, source="guidance findings, Q4", doc="Highest speed anywhere."
    )
    reverse_limit_kmh: float = setting(12.0, unit="km/h", minimum=0.5, maximum=40.0, doc="The same in reverse gear.")
    loaded_limit_kmh: float = setting(18.0, unit="km/h", minimum=0.5, maximum=40.0, doc="The same with a load.")
    reached_likelihood_pm2: float = setting(
        0.05,
        unit="1/m2",
        minimum=1e-6,
        maximum=10.0,
        source=_PAPER,
        doc="Eq. (2): least density of being at the target.",
    )
    reached_std_m: float = setting(
        0.8,
        unit="m",
        minimum=0.05,
        maximum=5.0,
        doc="Deviation of a position for Eq. (2) at least: by so much targets are anticipated.",
    )
    approach_mps: float = setting(
        0.05, unit="m/s", minimum=-1.0, maximum=5.0, source=_PAPER, doc="Eq. (3): least speed towards the target."
    )
    heading_deg: float = setting(25.0, unit="deg", minimum=1.0, maximum=180.0, source=_PAPER, doc="Eq. (4).")
    overrun_m: float = setting(5.0, unit="m", minimum=0.5, maximum=100.0, source=_PAPER, doc="Eq. (5).")
    overrun_share: float = setting(1.1, minimum=1.0, maximum=3.0, source=_PAPER, doc="Eq. (6).")
    arrived_m: float = setting(
        0.3, unit="m", minimum=0.02, maximum=3.0, doc="A stop counts within so much of its place."
    )
    standing_mps: float = setting(0.03, unit="m/s", minimum=0.001, maximum=0.5, doc="Slower than this is standing.")
    inversion_s: float = setting(1.5, unit="s", minimum=0.0, maximum=60.0, doc="Rest before a change of gear.")
    room_m: float = setting(
        0.7,
        unit="m",
        minimum=0.0,
        maximum=20.0,
        doc="Room left before the end of a short drift in which the gear changes.",
    )
    crossing_weight: float = setting(
        30.0,
        minimum=1.0,
        maximum=1000.0,
        source="guidance findings, trap 2: openings attract",
        doc="How much more the route counts in intersections.",
    )
    crossing_margin_m: float = setting(
        4.0, unit="m", minimum=0.0, maximum=20.0, doc="... and so far before and after them."
    )
    beside_wall_m: float = setting(
        0.6, unit="m", minimum=0.1, maximum=5.0, doc="Room left at the wall that a node prefers, beside the machine."
    )
    stuck_s: float = setting(
        6.0, unit="s", minimum=1.0, maximum=120.0, doc="Standing so long short of a stop is being stuck."
    )
    blocked_m: float = setting(
        4.0, unit="m", minimum=0.0, maximum=30.0, doc="Something stands in the way where less of the path is seen free."
    )
    wait_s: float = setting(
        15.0, unit="s", minimum=1.0, maximum=600.0, doc="... and it may leave: so long is waited before backing up."
    )
    back_up_m: float = setting(6.0, unit="m", minimum=1.0, maximum=30.0, doc="How far it backs up before another try.")
    back_ups: int = setting(
        2, minimum=0, maximum=10, source="at most two, then another way", doc="How often it backs up at one place."
    )
    believe_m: float = setting(
        1.0,
        unit="m",
        minimum=0.05,
        maximum=20.0,
        doc="A deviation along the drift above this stops the machine: it does not know where it is.",
    )
