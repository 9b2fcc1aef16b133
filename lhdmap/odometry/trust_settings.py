"""Settings of what the planar odometry says of its own error."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

# Of all of them: fitted together.
_SOURCE = "measured: simulated drives of all wall classes (docs/odometry.md)"


@dataclass(frozen=True, slots=True)
class TrustSettings:
    """How the error of the planar odometry grows: random walk, pull, and what does not add up."""

    walk_per_m: float = setting(
        1.8,
        unit="1/m",
        doc="Share of a scan's covariance against the local map that each metre makes lasting, times the share of noise in what "
        "the scan tells along, and the square of that in all it tells.",
        minimum=0.0,
        source=_SOURCE,
    )
    start_deg: float = setting(
        0.022,
        unit="deg",
        doc="Error of the heading that the first scan of a drive leaves, standard deviation: one scan is no map.",
        minimum=0.0,
        source=_SOURCE,
    )
    pull: float = setting(
        0.0016,
        unit="m/m",
        doc="How much too long or short the way is read where all that a scan tells is noise, standard deviation.",
        minimum=0.0,
        source=_SOURCE,
    )
    jitter: float = setting(
        0.65,
        doc="Variance of a scan's error against the local map, as a share of what the motion filter believes.",
        minimum=0.0,
        source=_SOURCE,
    )
    noisy_jitter: float = setting(
        0.6,
        doc="... and what is added to that share where all that a scan tells is noise.",
        minimum=0.0,
        source=_SOURCE,
    )
    tilted_walk: float = setting(
        2.0,
        unit="1/m",
        doc="... and what is added to it of a tilted scanner, which sees other rock in each scan, with a rear scanner.",
        minimum=0.0,
        source=_SOURCE,
    )
    tilted_alone_walk: float = setting(
        10.0, unit="1/m", doc="... and without one: no scanner sees the same rock again.", minimum=0.0, source=_SOURCE
    )
    tilted_unlevelled_walk: float = setting(
        100.0, unit="1/m", doc="... and without an inclinometer.", minimum=0.0, source=_SOURCE
    )
    tilted_alone_pull: float = setting(
        0.002,
        unit="m/m",
        doc="How much too short a tilted front scanner alone reads the way, standard deviation.",
        minimum=0.0,
        source="measured: 0.1 to 0.4 % (docs/odometry.md)",
    )
    tilted_jitter: float = setting(
        5.0, doc="Times that the jitter's variance is larger of a tilted scanner.", minimum=1.0, source=_SOURCE
    )
