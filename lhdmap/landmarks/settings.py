"""Settings of the LIDAR-landmarks."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

_PAPER = "topological_navigation, section 3.2"


@dataclass(frozen=True, slots=True)
class LandmarkSettings:
    """Landmarks of the nodes: clouds, similarity matrix and keys as in the paper; fused walls and profile for localization."""

    method: str = setting(
        "surface",
        doc="What tells where a tunnel is not distinctive: 'surface': the profile of its walls against all other places of it; "
        "'paper': what lies beyond the radius of each key.",
        choices=("surface", "paper"),
        source="measured: prototypes",
    )
    spacing_m: float = setting(
        2.0, unit="m", doc="From one landmark of a tunnel to the next.", minimum=0.2, source=_PAPER
    )
    range_m: float = setting(
        10.0,
        unit="m",
        doc="Points farther than this from the machine's centre are left out.",
        minimum=2.0,
        source=_PAPER,
    )
    centre_m: float = setting(
        -1.7,
        unit="m",
        doc="The machine's centre along x of base_link: the joint.",
        source="machine file: joint_to_front_axle_m",
    )
    voxel_m: float = setting(
        0.1, unit="m", doc="Density of a landmark: one point in each cell of this size.", minimum=0.01
    )
    fitness: str = setting(
        "line",
        doc="Distance that is matched and judged: 'line': of a point to the wall's line; 'point': of two points, as in the paper.",
        choices=("line", "point"),
        source="measured: prototypes",
    )
    limit_m: float = setting(
        0.15,
        unit="m",
        doc="Distances are truncated here; the square of it is the fitness of a pair that does not match at all.",
        minimum=0.01,
        source="measured: prototypes",
    )
    min_share: float = setting(
        0.6,
        doc="Least share of a cloud that must lie where the other one could see; on each side half as much.",
        minimum=0.0,
        maximum=1.0,
        source="measured: prototypes",
    )
    shift_m: float = setting(
        8.0, unit="m", doc="Landmarks that are no neighbours are started as far apart as this.", minimum=0.0
    )
    shift_step_m: float = setting(1.0, unit="m", doc="... in steps of this.", minimum=0.1)
    window_m: float = setting(
        1000.0,
        unit="m",
        doc="Landmarks farther apart along a tunnel are not compared: bounds the time of very long ones.",
        minimum=20.0,
    )
    neighbours: int = setting(
        5, unit="landmarks", doc="A landmark's local neighbours: so many to each side.", minimum=1, source=_PAPER
    )
    ends: int = setting(
        10, unit="landmarks", doc="The best of so many at each end of a tunnel is a key.", minimum=1, source=_PAPER
    )
    min_radius: int = setting(
        0,
        unit="landmarks",
        doc="Other keys have a larger radius than this. The paper has 2: clouds 6 m apart must match, which those of scanners 7 m "
        "apart, cut at 10 m, cannot.",
        minimum=0,
        source="measured (docs/landmarks.md)",
    )
    key_spacing: int = setting(
        5, unit="landmarks", doc="... and are farther than this from each other.", minimum=0, source=_PAPER
    )
    cell_m: float = setting(
        0.05, unit="m", doc="Cells of the fused walls, in which hits are averaged.", minimum=0.02, maximum=0.5
    )
    surface_range_m: float = setting(
        15.0,
        unit="m",
        doc="Hits farther than this are left out of the fused walls: near ones suffice, far ones carry the map's bend.",
        minimum=3.0,
        source="measured: prototypes",
    )
    profile_m: float = setting(
        0.1, unit="m", doc="Step of the walls' profile along the axis.", minimum=0.02, maximum=1.0
    )
    smooth_m: float = setting(
        6.0, unit="m", doc="Length over which the mid line of the profile is smoothed.", minimum=0.5
    )
    distinct_m: float = setting(
        15.0, unit="m", doc="Length of wall that must be found in no other place of its tunnel.", minimum=2.0
    )
    distinct_gap: float = setting(
        30.0,
        unit="nats",
        doc="... with this much less likelihood there.",
        minimum=1.0,
        source="measured: 0 of 540 wrong (prototypes)",
    )
