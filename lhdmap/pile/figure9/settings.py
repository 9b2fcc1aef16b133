"""Constants of the paper's algorithm (autonomous loading, Fig. 9) as printed, and those with which it works."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.pile.bounds import BOUNDS, StatusBounds
from lhdmap.settings import setting

FIG_9 = "autonomous loading, Fig. 9"
RULE = "measured on simulated scenes; the paper names no figures"
REPAIR = "measured on simulated scenes: docs/pile_figure9.md"


@dataclass(frozen=True, slots=True)
class Figure9Constants:
    """The pile by the paper's algorithm to the letter: docs/pile_figure9.md says what it does and does not do."""

    voxel_size_m: tuple[float, float, float] = setting(
        (0.2, 0.2, 0.1), unit="m", source=FIG_9, minimum=0.01, maximum=5.0, doc="Voxel grid in x, y, z."
    )
    normal_radius_m: float = setting(
        0.75, unit="m", source=FIG_9, minimum=0.02, maximum=10.0, doc="Radius for normals, curvature and counts."
    )
    view_height_m: float = setting(
        2.0, unit="m", minimum=0.0, maximum=5.0, doc="Normals point to this height above base_link."
    )
    axes: str = setting(
        "map",
        choices=("map", "drift"),
        source=FIG_9,
        doc="Whose y is meant by n_y, min_y and max_y: the map's, or that across the drift's last metres.",
    )
    ny_max: float = setting(
        0.3, source=FIG_9, minimum=0.0, maximum=1.0, doc="Points with a larger |n_y| are walls and are removed."
    )
    roughness: str = setting(
        "curvature",
        choices=("curvature", "steepness"),
        source=FIG_9,
        doc="What tells the pile from the floor: curvature within its bounds, or |n_z| below nz_max.",
    )
    curvature_min: float = setting(
        0.05, source=FIG_9, minimum=0.0, maximum=1.0, doc="Least surface variation l0 / (l0 + l1 + l2)."
    )
    curvature_max: float = setting(
        0.4, source=FIG_9, minimum=0.0, maximum=1.0, doc="Largest surface variation; it never exceeds 1/3."
    )
    nz_max: float = setting(
        0.92, source=REPAIR, minimum=0.0, maximum=1.0, doc="Largest |n_z|, with roughness = steepness (23 deg)."
    )
    neighbours_min: int = setting(
        80, unit="points", source=FIG_9, minimum=0, doc="Points with fewer neighbours are removed."
    )
    neighbours_in: str = setting(
        "remaining",
        choices=("remaining", "cloud"),
        source=FIG_9,
        doc="Whether neighbours are counted among what is left, or in the whole cloud.",
    )
    cluster_gap_m: float = setting(
        0.0,
        unit="m",
        source=FIG_9,
        minimum=0.0,
        doc="The largest cluster is the pile, split at such gaps; 0: all that is left.",
    )
    bound_share: float = setting(
        0.0,
        source=FIG_9 + " and erratum to section 3.2",
        minimum=0.0,
        maximum=0.2,
        doc="Share of points that may lie beyond each bound; 0: min_y and max_y, which one stray point moves.",
    )
    points_min: int = setting(100, unit="points", source=FIG_9, minimum=3, doc="A pile has at least so many points.")
    waits: bool = setting(
        False, source=FIG_9, doc="Go on until deadline_m; as printed, the loop ends at the first points_min points."
    )
    deadline_m: float = setting(
        15.0, unit="m", source=FIG_9, minimum=1.0, doc="Distance to the gravity centre at which the loop ends."
    )
    slope_from: str = setting(
        "normals",
        choices=("normals", "plane"),
        source=FIG_9,
        doc="Inclination from the average of normals of the pile's points, or from a robust plane x on (y, z).",
    )
    slope_radius_m: float = setting(
        3.0, unit="m", source=FIG_9, minimum=0.05, maximum=20.0, doc="Radius of the final normals."
    )
    shallow_deg: float = setting(BOUNDS.shallow_deg, unit="deg", source=RULE, doc="Below this the pile is too shallow.")
    steep_deg: float = setting(BOUNDS.steep_deg, unit="deg", source=RULE, doc="Above this it hangs up.")
    wall_deg: float = setting(BOUNDS.upright_deg, unit="deg", source=RULE, doc="Above this it is a wall,")
    overhang_deg: float = setting(
        BOUNDS.overhang_deg, unit="deg", source=RULE, doc="up to this; beyond, it hangs over."
    )

    @property
    def bounds(self) -> StatusBounds:
        """The four bounds of the status."""
        return StatusBounds(self.shallow_deg, self.steep_deg, self.wall_deg, self.overhang_deg)


@dataclass(frozen=True, slots=True)
class RepairedConstants(Figure9Constants):
    """The same algorithm with the constants and the fit that make it find piles."""

    axes: str = setting("drift", choices=("map", "drift"), source=REPAIR, doc="Whose y is meant by n_y and the bounds.")
    ny_max: float = setting(0.5, source=REPAIR, minimum=0.0, maximum=1.0, doc="Points with a larger |n_y| are walls.")
    roughness: str = setting(
        "steepness", choices=("curvature", "steepness"), source=REPAIR, doc="What tells the pile from the floor."
    )
    neighbours_min: int = setting(40, unit="points", source=REPAIR, minimum=0, doc="Points with fewer are removed.")
    neighbours_in: str = setting("cloud", choices=("remaining", "cloud"), source=REPAIR, doc="Where they are counted.")
    cluster_gap_m: float = setting(0.5, unit="m", source=REPAIR, minimum=0.0, doc="Gap that separates clusters.")
    bound_share: float = setting(
        0.01,
        source="erratum to section 3.2: a robust bound",
        minimum=0.0,
        maximum=0.2,
        doc="Share of points that may lie beyond each bound.",
    )
    waits: bool = setting(True, source=REPAIR, doc="Go on until deadline_m: 100 points are a minimum.")
    slope_from: str = setting("plane", choices=("normals", "plane"), source=REPAIR, doc="What the inclination is from.")
