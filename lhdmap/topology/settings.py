"""Settings of the topology: one set for all logs, beside the machine's width."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting


@dataclass(frozen=True, slots=True)
class TopologySettings:
    """From free space to tunnels and intersections."""

    method: str = setting(
        "free_space",
        choices=("free_space", "off"),
        doc="Where nodes come from: the free space near the drive, or nowhere.",
    )
    arms: str = setting(
        "auto",
        choices=("auto", "seen", "driven"),
        doc="Which openings count: all that were seen, those driven, or all in tunnels that the machine fills (mines).",
    )
    reach_m: float = setting(
        25.0,
        unit="m",
        minimum=5.0,
        maximum=60.0,
        doc="How far from the machine the free space is looked at.",
        source="measured",
    )
    opening_m: float = setting(
        4.0,
        unit="m",
        minimum=0.5,
        maximum=15.0,
        source="measured: niches of 2 to 4 m stay out, draw points come in",
        doc="Depth beyond the wall from which an opening is a branch and not a niche.",
    )
    opening_machine: float = setting(
        2.5,
        minimum=0.2,
        maximum=10.0,
        source="measured: doors of offices",
        doc="... of a small machine so many times its width, where that is less.",
    )
    radius_machine: float = setting(
        0.4,
        minimum=0.1,
        maximum=1.0,
        source="measured",
        doc="Radius of the free space's core, share of the machine's width.",
    )
    radius_tunnel: float = setting(
        0.3, minimum=0.05, maximum=0.49, source="measured", doc="... at most this share of the tunnels' median width."
    )
    merge: float = setting(
        0.7,
        minimum=0.0,
        maximum=2.0,
        source="measured",
        doc="Junctions nearer than this share of the sum of their free radii are one.",
    )
    obstacle_m: float = setting(
        6.5,
        unit="m",
        minimum=0.0,
        source="measured: a parked car is filled, a pillar of 6 x 6 m is not",
        doc="Diagonal of an island in the free space up to which it is an obstacle and not a pillar, in mines; in buildings "
        "1 m.",
    )
    throat_margin_m: float = setting(
        0.3,
        unit="m",
        minimum=0.0,
        source="assumed",
        doc="Room on either side that an opening must leave to the machine.",
    )
    level_gap_m: float = setting(
        3.0,
        unit="m",
        minimum=0.5,
        source="contract: drifts that cross higher than this do not join",
        doc="Difference of height from which two places above each other are two levels.",
    )
    speed_limit_kmh: float = setting(
        12.0,
        unit="km/h",
        minimum=1.0,
        maximum=60.0,
        source="topological_navigation: 12 to 24 km/h in mines",
        doc="Speed limit of tunnels and points that the edits do not say.",
    )
