"""Settings of smoothing and loop closure."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting


@dataclass(frozen=True, slots=True)
class SmoothingSettings:
    """Pose graph of key scans with loop closures; where no place is seen twice the odometry stands."""

    closures: bool = setting(True, doc="Search for places that are seen again.")
    realign: bool = setting(
        True,
        doc="Align tilted front scans and the rear scanner's where both see a wall at the same height.",
    )
    node_m: float = setting(
        0.2, unit="m", doc="Travel between the scans that are aligned.", minimum=0.05, source="measured"
    )
    lag_m: float = setting(
        80.0, unit="m", doc="Travel after which an aligned pose is final.", minimum=1.0, source="measured"
    )
    lag_s: float = setting(30.0, unit="s", doc="... or time, whichever comes first.", minimum=1.0)
    key_m: float = setting(1.0, unit="m", doc="Travel between key scans.", minimum=0.1)
    key_deg: float = setting(30.0, unit="deg", doc="Turn between key scans.", minimum=1.0)
    apart_m: float = setting(15.0, unit="m", doc="Least travel between two visits of a place.", minimum=1.0)
    reach_m: float = setting(1.5, unit="m", doc="Distance within which a place counts as the same.", minimum=0.1)
    drift: float = setting(
        0.02,
        unit="m/m",
        doc="Drift that the search allows for: the reach grows by this share of the travel.",
        minimum=0.0,
    )
    reach_limit_m: float = setting(6.0, unit="m", doc="Largest reach.", minimum=0.5)
    min_support: float = setting(
        0.6,
        doc="Share of hits that must agree with the earlier place.",
        minimum=0.0,
        maximum=1.0,
        source="measured: real logs",
    )
    max_sigma_m: float = setting(
        0.05,
        unit="m",
        doc="A closure that fixes a direction worse than this (a smooth drift) is refused.",
        minimum=0.001,
    )
    agree_m: float = setting(0.3, unit="m", doc="Closures in a row must agree to this.", minimum=0.01)
    agree_deg: float = setting(3.0, unit="deg", doc="... and to this.", minimum=0.01)
    along_sigma: float = setting(
        0.002,
        unit="m/sqrt(m)",
        doc="Random walk of the position that the pose graph allows at least: people, glass and gaps, which the odometry does not "
        "know of.",
        minimum=1e-5,
        source="measured: real logs",
    )
    heading_sigma_deg: float = setting(
        0.01, unit="deg/sqrt(m)", doc="The same of the heading.", minimum=1e-5, source="measured: real logs"
    )
