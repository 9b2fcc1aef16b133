"""Settings of the odometry for 3D scanners."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting


@dataclass(frozen=True, slots=True)
class CloudOdometrySettings:
    """Odometry for 3D scanners: method, map, motion model, flags."""

    method: str = setting(
        "vgicp",
        doc="'vgicp': clouds against a map of planes; 'kiss_icp': the point-to-point baseline, which slips in tunnels.",
        choices=("vgicp", "kiss_icp"),
        source="compared in simulated drifts: end error 0.04-0.24 % of the way against 0.6-100 %",
    )
    voxel_m: float = setting(
        0.5,
        unit="m",
        doc="Cell of the map in which hits are averaged to a plane.",
        minimum=0.05,
        maximum=5.0,
        source="measured: 0.3 m halves the noise of a step, at twice the time",
    )
    sample_m: float = setting(
        0.25, unit="m", doc="A cloud is thinned to one point per cell of this size.", minimum=0.02, maximum=5.0
    )
    kiss_voxel_m: float = setting(
        0.3,
        unit="m",
        doc="Voxel of kiss-icp's map; its own default of 1 m is too coarse for a drift.",
        minimum=0.05,
        maximum=5.0,
        source="0.2-0.4 m measured alike",
    )
    min_range_m: float = setting(0.5, unit="m", doc="Nearer hits are left out.", minimum=0.0)
    max_range_m: float = setting(60.0, unit="m", doc="Farther hits are left out.", minimum=1.0)
    range_noise_m: float = setting(
        0.015,
        unit="m",
        doc="Range noise of the scanner, one sigma.",
        minimum=0.001,
        maximum=1.0,
        source="data sheets of spinning scanners: 0.01-0.03 m",
    )
    insert_m: float = setting(0.2, unit="m", doc="Travel between clouds that enter the map.", minimum=0.0)
    insert_deg: float = setting(3.0, unit="deg", doc="Turn between clouds that enter the map.", minimum=0.0)
    window_m: float = setting(
        60.0,
        unit="m",
        doc="The map forgets what was not seen again while the machine drove this far: its memory is bounded.",
        minimum=5.0,
    )
    memory_m: float = setting(
        1.0,
        unit="m",
        doc="Travel over which the pose's uncertainty against the map is renewed with the map.",
        minimum=0.05,
        source="as in the planar odometry",
    )
    step_m: float = setting(
        0.03, unit="m", doc="Adaptive rate: a cloud is processed once the machine has moved this far.", minimum=0.0
    )
    step_deg: float = setting(0.5, unit="deg", doc="... or has turned this far.", minimum=0.0)
    step_s: float = setting(0.25, unit="s", doc="... or this time has passed.", minimum=0.0)
    forward_acceleration: float = setting(
        0.7,
        unit="m/s^2/sqrt(Hz)",
        doc="Spectral density of forward acceleration that the motion model allows.",
        minimum=0.001,
        source="1 m/s^2 over 0.5 s: an LHD's braking",
    )
    side_acceleration: float = setting(
        0.2, unit="m/s^2/sqrt(Hz)", doc="The same sideways and up.", minimum=0.001, source="waves of the floor"
    )
    turning_acceleration: float = setting(
        1.0, unit="rad/s^2/sqrt(Hz)", doc="The same in turning.", minimum=0.001, source="1.5 rad/s^2 over 0.5 s"
    )
    tilting_acceleration: float = setting(
        0.4, unit="rad/s^2/sqrt(Hz)", doc="The same in roll and pitch.", minimum=0.001, source="waves of the floor"
    )
    tilt_sigma_deg: float = setting(
        0.5,
        unit="deg",
        doc="Trust in a given roll and pitch: shaking and lag included.",
        minimum=0.01,
        source="inclinometer",
    )
    chance_sigma_m: float = setting(
        0.005,
        unit="m",
        doc="Information along the machine worse than this is discounted: noise of the walls' normals fakes it.",
        minimum=0.0001,
        source="measured, smooth drift with wheels: pulls by 0.4 % of the way, 1 % at 0.01 m, 2 % at 0",
    )
    weak_sigma_m: float = setting(
        0.06,
        unit="m",
        doc="A cloud that fixes a direction worse than this (discounted) is flagged degenerate.",
        minimum=0.0,
        source="straight drifts, 32 rings, reach 12 m: rough 0.009 m, moderate 0.04, smooth 0.1",
    )
    weak_sigma_deg: float = setting(0.2, unit="deg", doc="The same for the heading.", minimum=0.0)
    min_support: float = setting(
        0.4,
        doc="Share of hits that must agree with the map; below it the cloud counts as lost.",
        minimum=0.0,
        maximum=1.0,
    )
    max_speed_mps: float = setting(
        15.0, unit="m/s", doc="A cloud that fits only where the machine cannot have got to counts as lost.", minimum=0.1
    )
    reach_m: float = setting(
        2.0,
        unit="m",
        doc="How far along the machine's axis starts are tried when the prediction is unsure.",
        minimum=0.0,
    )
