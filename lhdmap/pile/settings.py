"""Settings of the pile's identification."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

PAPER = "autonomous loading, section 3.2"


@dataclass(frozen=True, slots=True)
class PileSettings:
    """How the pile is found and when it is decided."""

    method: str = setting(
        "surface",
        choices=("surface", "figure9", "figure9_repaired", "off"),
        doc="surface: lhdmap's own; figure9: the paper's algorithm to the letter; figure9_repaired: with constants that work.",
    )
    update_m: float = setting(0.5, unit="m", minimum=0.05, doc="Travel between estimates.")
    reach_m: float = setting(
        45.0, unit="m", minimum=10.0, doc="How far ahead hits are kept.", source="50 m in " + PAPER
    )
    deadline_m: float = setting(
        15.0, unit="m", minimum=3.0, doc="Distance to the toe by which it is decided.", source=PAPER
    )
    sure: float = setting(
        0.97, minimum=0.5, maximum=1.0, doc="Probability of a status at which it is decided earlier than that."
    )
    likely: float = setting(
        0.5, minimum=0.0, maximum=1.0, doc="Probability that is enough at the deadline; below it: not identified."
    )
    closest_m: float = setting(
        4.0,
        unit="m",
        minimum=0.0,
        doc="Nearer to the toe than this the last estimate stands: the bucket hides the face.",
    )
    scale_std: float = setting(
        0.003,
        unit="m/m",
        minimum=0.0,
        doc="Scale error of the odometry, standard deviation.",
        source="drives over flat floors in simulated scenes",
    )
    pitch_std_deg: float = setting(
        0.15,
        unit="deg",
        minimum=0.001,
        doc="Constant error of pitch and mounting tilt, standard deviation, before the floor has told.",
        source="inclinometer filtered; prototypes",
    )
