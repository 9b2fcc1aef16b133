"""Settings of localization."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting


@dataclass(frozen=True, slots=True)
class LocalizationSettings:
    """Tracking against the map's walls, loss, and the search over the whole map."""

    method: str = setting(
        "surface",
        doc="'surface': scans against the map's fused walls, carried on by the odometry; 'paper': distance along the tunnel by "
        "wheels and landmarks (topological_navigation, Section 3.3).",
        choices=("surface", "paper"),
        source="measured: prototypes",
    )
    range_m: float = setting(
        12.0,
        unit="m",
        minimum=3.0,
        maximum=40.0,
        source="measured: near hits suffice, far ones carry the map's bend",
        doc="Hits farther than this from the machine are not matched.",
    )
    hits: int = setting(
        400, minimum=50, maximum=2000, source="measured", doc="Hits of a scan that are matched at most."
    )
    support_drop: float = setting(
        0.2,
        minimum=0.02,
        maximum=0.9,
        source="measured",
        doc="The machine is lost where its support stays this much below the least of the node's own scans.",
    )
    support_scans: int = setting(5, minimum=1, maximum=50, doc="... over so many scans.")
    search_m: float = setting(
        5.0,
        unit="m",
        minimum=2.0,
        maximum=60.0,
        source="measured: with less, places are taken for others",
        doc="Way that a search over the whole map needs at least.",
    )
    search_every_m: float = setting(
        1.0, unit="m", minimum=0.2, maximum=20.0, doc="Travel between two searches, where the place is not known."
    )
    check_every_m: float = setting(
        5.0, unit="m", minimum=1.0, maximum=100.0, doc="Travel between two searches, where it is tracked."
    )
    window_m: float = setting(40.0, unit="m", minimum=5.0, maximum=100.0, doc="Way whose walls a search uses at most.")
    gap: float = setting(
        30.0,
        unit="nats",
        minimum=5.0,
        maximum=1000.0,
        source="measured",
        doc="How much less likely the next best place must be, over the reduced chi-square, for a search to be believed.",
    )
    confirm_m: float = setting(
        3.0,
        unit="m",
        minimum=0.5,
        maximum=20.0,
        source="measured: a wrong place loses its support within 1.7 m",
        doc="Travel over which the place that a search found must keep its support before it counts.",
    )
    start_std_m: float = setting(
        0.5, unit="m", minimum=0.01, maximum=10.0, doc="Deviation of a start that is given, in x and y."
    )
    start_std_deg: float = setting(3.0, unit="deg", minimum=0.1, maximum=45.0, doc="... and of its heading.")
