"""The sections of a pile scenario: the pile's shape and what stands about it, and how the scanner really hangs."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

ISSUE = "issue of the ore pile, point 1"
VARIANTS = (
    "normal",
    "stope",
    "skewed",
    "bulging",
    "asymmetric",
    "concave",
    "too_shallow",
    "wall",
    "hang_up",
    "boulder",
    "spill",
    "dust",
    "low_wall",
    "empty_stope",
    "side_opening",
    "machine",
    "post",
)
STATUSES = ("loadable", "too_shallow", "wall", "hang_up", "none")


@dataclass(frozen=True, slots=True)
class SimulatedPileSettings:
    """What the drift ends in: a face of rubble or rock, oversized and spilled rocks, things that stand in the way."""

    variant: str = setting("normal", choices=VARIANTS, source=ISSUE, doc="Name of the kind of scene.")
    status: str = setting("loadable", choices=STATUSES, doc="What a perfect judge says of it.")
    face: bool = setting(True, doc="Whether there is a face before the drift's own end.")
    toe_m: float = setting(
        47.0, unit="m", minimum=10.0, maximum=5000.0, doc="Driven distance from the start to the face's foot."
    )
    back_m: float = setting(8.0, unit="m", minimum=1.0, maximum=60.0, doc="From the foot to the end of the drift.")
    mouth_m: float = setting(
        0.0, unit="m", minimum=0.0, maximum=20.0, doc="Where a stope's mouth lies before the foot; 0: no stope."
    )
    slope_deg: float = setting(
        45.0, unit="deg", minimum=2.0, maximum=130.0, doc="Slope of the lower face; 90 is upright, more overhangs."
    )
    upper_slope_deg: float = setting(
        45.0, unit="deg", minimum=2.0, maximum=130.0, doc="Slope of the face above `bend_m`."
    )
    bend_m: float = setting(1.0, unit="m", minimum=0.0, maximum=10.0, doc="Height at which the slope changes.")
    crest_m: float = setting(
        20.0, unit="m", minimum=0.1, maximum=20.0, doc="Height above which the pile is nearly flat; 20: to the roof."
    )
    d50_m: float = setting(
        0.25, unit="m", minimum=0.0, maximum=1.0, source=ISSUE, doc="Median size of the rubble; 0: none."
    )
    roughness_m: float = setting(
        0.05, unit="m", minimum=0.0, maximum=0.5, doc="Waves of the face over decimetres to metres, standard deviation."
    )
    skew_deg: float = setting(
        0.0, unit="deg", minimum=-45.0, maximum=45.0, doc="Turn of the face in plan; positive: its left side is nearer."
    )
    bulge_m: float = setting(
        0.0, unit="m", minimum=-5.0, maximum=5.0, doc="How far the middle stands before the sides; negative: behind."
    )
    lobe_m: float = setting(
        0.0, unit="m", minimum=0.0, maximum=5.0, doc="How far a heap on one side stands before the rest."
    )
    lobe_lateral_m: float = setting(
        0.0, unit="m", minimum=-20.0, maximum=20.0, doc="Where that heap is; positive: left."
    )
    slope_change: float = setting(
        0.0,
        minimum=-0.9,
        maximum=0.9,
        doc="By what share the face is flatter at the left wall (and steeper at the right).",
    )
    boulders: tuple[tuple[float, float, float, float], ...] = setting(
        (),
        unit="m, m, m, -",
        doc="Oversized rocks as (lateral place, height of the middle, size, share of it that stands out).",
    )
    spill: int = setting(0, minimum=0, maximum=200, doc="Number of rocks on the floor before the foot.")
    spill_reach_m: float = setting(3.0, unit="m", minimum=0.1, maximum=15.0, doc="How far before the foot they lie.")
    spill_size_m: float = setting(0.35, unit="m", minimum=0.05, maximum=1.0, doc="Their median size.")
    obstacle: str = setting("none", choices=("none", "machine", "post"), doc="What stands on the floor at the foot.")
    obstacle_lateral_m: float = setting(
        0.0, unit="m", minimum=-10.0, maximum=10.0, doc="Where it stands; positive: left."
    )
    obstacle_turn_deg: float = setting(
        0.0, unit="deg", minimum=-180.0, maximum=180.0, doc="Heading of it to that of the drift; 180 faces the machine."
    )
    mesh_m: float = setting(0.04, unit="m", minimum=0.01, maximum=0.2, doc="Edge length of the face's mesh.")


@dataclass(frozen=True, slots=True)
class MountingSettings:
    """How the front scanner is mounted, and by how much the mount in the log is wrong."""

    height_m: float = setting(1.8, unit="m", source=ISSUE, minimum=0.5, maximum=4.0, doc="Height over the floor.")
    tilt_deg: float = setting(2.5, unit="deg", source=ISSUE, minimum=-10.0, maximum=20.0, doc="Tilt that the log says.")
    tilt_error_deg: float = setting(
        0.0, unit="deg", source=ISSUE, minimum=-5.0, maximum=5.0, doc="True tilt less the tilt that the log says."
    )
