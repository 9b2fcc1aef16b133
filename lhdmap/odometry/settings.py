"""Settings of the planar odometry."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting


@dataclass(frozen=True, slots=True)
class OdometrySettings:
    """Planar odometry: method, adaptive frame rate, motion model, flags."""

    method: str = setting(
        "anchored",
        doc="'anchored': scans against the local wall map; 'range_flow': scan pairs alone (the paper's method).",
        choices=("anchored", "range_flow"),
        source="measured: prototypes",
    )
    range_noise_m: float = setting(
        0.012,
        unit="m",
        doc="Range noise of the scanner, one sigma.",
        source="SICK LMS511 data sheet",
        minimum=0.001,
        maximum=1.0,
    )
    step_m: float = setting(
        0.08,
        unit="m",
        doc="Adaptive rate: a scan is processed once the machine has moved this far.",
        minimum=0.0,
        source="measured: no loss against every scan (docs/odometry.md)",
    )
    max_beams: int = setting(
        400,
        unit="beams",
        minimum=50,
        source="measured: 381 and 761 beams give the same error (docs/odometry.md)",
        doc="A scan with more beams is thinned, each time from another beam on.",
    )
    max_rear_beams: int = setting(
        130,
        unit="beams",
        minimum=20,
        source="measured: twice as many gain nothing (docs/odometry.md)",
        doc="The same for the rear scanner, which helps a tilted front one.",
    )
    step_deg: float = setting(1.0, unit="deg", doc="... or has turned this far.", minimum=0.0, source="measured")
    step_s: float = setting(0.2, unit="s", doc="... or this time has passed.", minimum=0.0, source="lhdmap")
    forward_acceleration: float = setting(
        0.7,
        unit="m/s^2/sqrt(Hz)",
        doc="Spectral density of forward acceleration that the motion model allows.",
        minimum=0.0,
        source="1 m/s^2 over 0.5 s: an LHD's braking",
    )
    lateral_acceleration: float = setting(
        0.1, unit="m/s^2/sqrt(Hz)", doc="The same sideways.", minimum=0.0, source="front axle: side slip only"
    )
    turning_acceleration: float = setting(
        1.0, unit="rad/s^2/sqrt(Hz)", doc="The same in turning.", minimum=0.0, source="1.5 rad/s^2 over 0.5 s"
    )
    weak_sigma_m: float = setting(
        0.0035,
        unit="m",
        doc="A scan that fixes a direction worse than this is flagged degenerate.",
        minimum=0.0,
        source="rough walls give 0.0013 m, smooth ones 0.004-0.007 m (docs/odometry.md)",
    )
    weak_ratio: float = setting(
        5.0,
        doc="... if it is also this much worse than the better direction (all directions alike are a coarse scanner, no drift).",
        minimum=1.0,
        source="rough walls give 2, moderate ones 4, smooth ones 10 (docs/odometry.md)",
    )
    blind_sigma_m: float = setting(
        0.03, unit="m", doc="Worse than this is flagged whatever the other direction is.", minimum=0.0
    )
    weak_inflation: float = setting(
        3.0,
        doc="The covariance of a weak direction times this: scan after scan is matched with the same cells of the map, so what is "
        "wrong with these does not average out.",
        minimum=1.0,
        source="measured in smooth walls (docs/odometry.md)",
    )
    weak_sigma_deg: float = setting(0.2, unit="deg", doc="The same for the heading.", minimum=0.0, source="lhdmap")
    wheel_noise_mps: float = setting(
        0.03, unit="m/s", doc="Noise of the wheels' speed.", minimum=0.001, source="lhdmap"
    )
    wheel_turn_noise_rps: float = setting(
        0.05, unit="rad/s", doc="Noise of the wheels' turning rate.", minimum=0.001, source="lhdmap"
    )
    wheel_scale_std: float = setting(
        0.05,
        minimum=0.0,
        doc="How far the scale of the wheels' turn may be off, standard deviation; learned as the machine drives. 0: right.",
        source="lhdmap: 0.93 to 1.03 in logs",
    )
    wheel_curvature_std: float = setting(
        0.05,
        unit="rad/m",
        minimum=0.0,
        doc="How far wheels may turn while the machine drives straight, standard deviation; learned. 0: not at all.",
        source="lhdmap: 0.001 to 0.063 in logs",
    )
    min_height_m: float = setting(
        0.35,
        unit="m",
        doc="Hits lower than this above the floor are not walls (scanner mounted above it).",
        source="lhdmap",
    )
    height_lever: float = setting(
        0.5,
        unit="of the wheelbase",
        minimum=0.0,
        maximum=1.0,
        source="geometry: docs/integration.md",
        doc="How far base_link is ahead of the point whose path slopes as the inclinometer says: half the wheelbase where the "
        "joint lets both bodies pitch only together, 0 where the front body follows the floor under its own axle.",
    )


@dataclass(frozen=True, slots=True)
class AnchorSettings:
    """Local wall map that the default method matches scans against."""

    cell_m: float = setting(
        0.025,
        unit="m",
        doc="Finest cell in which hits are averaged; walls are lines fitted over three cells around a point.",
        source="measured over roughness 5-120 mm and noise 12-25 mm (docs/odometry.md)",
        minimum=0.005,
        maximum=0.5,
    )
    insert_m: float = setting(
        0.06, unit="m", doc="Travel between scans that enter the map.", minimum=0.0, source="measured: prototypes"
    )
    insert_deg: float = setting(
        2.0, unit="deg", doc="Turn between scans that enter the map.", minimum=0.0, source="lhdmap"
    )
    cutoff_sigmas: float = setting(
        3.0,
        unit="sigma",
        doc="Distance to the wall beyond which a hit has no weight (redescending).",
        minimum=1.0,
        source="prototypes: 2; measured: 3 loses less in rough walls",
    )
    min_cells: float = setting(
        4.0,
        unit="cells",
        doc="Effective cells that a line needs: chords between sparse hits pull towards standing still.",
        minimum=2.0,
        source="measured in smooth walls (docs/odometry.md)",
    )
    coarse_noise: float = setting(
        0.05,
        unit="m/m",
        doc="Extra noise of a line from a coarser level, per metre of cell; of a tilted scanner, whose coarse cells mix heights.",
        minimum=0.0,
        source="measured; a level scanner has none: smooth walls need its far hits",
    )
    hit_limit: float = setting(
        50.0, unit="hits", doc="Hits after which a cell's mean forgets.", minimum=1.0, source="lhdmap"
    )
    memory_m: float = setting(
        1.0,
        unit="m",
        doc="Travel over which the pose's uncertainty against the map is renewed with the map.",
        minimum=0.05,
        source="measured in smooth walls",
    )
    lean: float = setting(
        0.2,
        unit="m/m",
        doc="Lean of the walls, standard deviation: a tilted scanner sees a wall higher up each time (0: walls are upright).",
        minimum=0.0,
        maximum=2.0,
        source="measured in rough 3D drifts (docs/odometry.md)",
    )
    lean_patch_m: float = setting(
        2.0, unit="m", doc="Length of wall that leans alike.", minimum=0.2, maximum=20.0, source="measured, as lean"
    )
    rounds: int = setting(8, doc="Times that lines are fitted anew in one match at most.", minimum=1, maximum=20)
    young_m: float = setting(
        0.6,
        unit="m",
        doc="Travel after a start within which scans are placed by range flow against the first: one scan is no map.",
        source="measured: heading after the start 0.007 deg, not 0.03",
        minimum=0.0,
    )
    min_support: float = setting(
        0.25,
        doc="Share of hits that must agree with the map; below it the surroundings are searched.",
        minimum=0.0,
        maximum=1.0,
    )


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """Wide, cheap search for the pose when the prediction fails: starts, jumps, after a blackout."""

    reach_m: float = setting(
        1.0, unit="m", doc="Half width of the search.", minimum=0.1, source="prototypes: 0.75 m wanted"
    )
    turn_deg: float = setting(
        70.0, unit="deg", doc="Largest turn searched.", minimum=1.0, source="prototypes: jumps up to 61 deg"
    )
    cell_m: float = setting(0.1, unit="m", doc="Cell of the likelihood field.", minimum=0.02)
    step_deg: float = setting(2.0, unit="deg", doc="Step of the heading.", minimum=0.1)
    beams: int = setting(120, doc="Hits used.", minimum=20)


@dataclass(frozen=True, slots=True)
class RangeFlowSettings:
    """Range flow between pairs of scans with an adaptive frame rate."""

    spacing_m: float = setting(
        0.7,
        unit="m",
        doc="Travel between reference scans.",
        minimum=0.05,
        source="measured: 0.75-1 m (docs/odometry.md)",
    )
    spacing_deg: float = setting(15.0, unit="deg", doc="Turn between reference scans.", minimum=1.0, source="measured")
    references: int = setting(
        2,
        doc="Earlier reference scans that a scan is compared with (1: pairs alone).",
        minimum=1,
        maximum=5,
        source="measured",
    )
    min_support: float = setting(
        0.25, doc="Share of beams that must agree; below it a new chain begins.", minimum=0.0, maximum=1.0
    )
    width_m: float = setting(
        0.08,
        unit="m",
        doc="Half width of the least squares lines that give ranges and gradients.",
        minimum=0.01,
        source="measured: 0.03-0.12 m alike (docs/odometry.md)",
    )
    levels: int = setting(
        5,
        doc="Levels of the pyramid, each with half the beams of the one before.",
        minimum=1,
        maximum=6,
        source="RF2O, ICRA 2016",
    )
    iterations: int = setting(6, doc="Least squares steps on a level.", minimum=1, maximum=50)
