"""The sections of a scenario: what there is to set of drift and drive, with unit and source."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

FINDINGS = "simulated drift of the findings, section 3"
DEFAULT_PIECES = (
    (22.0, 0.0, 0.0),
    (13.0, 12.0, -4.0),
    (15.0, 0.0, -8.0),
    (10.0, -9.0, -2.0),
    (20.0, 0.0, 3.0),
    (10.0, -12.0, 6.0),
    (16.0, 0.0, 8.0),
    (7.8, 9.0, 0.0),
)


@dataclass(frozen=True, slots=True)
class DriftSettings:
    """The drift: its centre line, profile, roughness, side openings and the fineness of its mesh."""

    pieces: tuple[tuple[float, float, float], ...] = setting(
        DEFAULT_PIECES,
        unit="m, m, %",
        source=FINDINGS,
        doc="Centre line as (length, radius, grade); radius 0 is straight, positive bends left; repeated as needed.",
    )
    transition_m: float = setting(
        3.0, unit="m", minimum=0.0, maximum=20.0, doc="Length over which curvature and grade change between pieces."
    )
    profile: str = setting("arched", choices=("arched", "box"), doc="Shape of the cross-section.")
    half_width_m: float = setting(2.0, unit="m", source=FINDINGS, minimum=1.3, maximum=10.0, doc="Half of the width.")
    height_m: float = setting(3.8, unit="m", minimum=2.5, maximum=15.0, doc="Height at the middle.")
    roughness_m: float = setting(
        0.12, unit="m", source=FINDINGS, minimum=0.0, maximum=0.5, doc="Wall and roof roughness, standard deviation."
    )
    roughness_octaves: int = setting(6, source=FINDINGS, minimum=1, maximum=10, doc="Scales of the wall roughness.")
    roughness_scale_m: float = setting(
        2.0, unit="m", minimum=0.2, maximum=20.0, doc="Knot spacing of the coarsest scale."
    )
    roughness_gain: float = setting(0.7, minimum=0.1, maximum=1.0, doc="Amplitude of each scale over the coarser one.")
    floor_undulation_m: float = setting(
        0.035,
        unit="m",
        minimum=0.0,
        maximum=0.3,
        doc="Long waves of the floor, standard deviation: the machine rolls and pitches.",
    )
    floor_roughness_m: float = setting(
        0.012, unit="m", minimum=0.0, maximum=0.2, doc="Fine roughness of the floor, standard deviation."
    )
    blast_round_m: float = setting(3.5, unit="m", minimum=0.5, maximum=10.0, doc="Length of a blast round.")
    blast_flare_m: float = setting(
        0.0, unit="m", minimum=0.0, maximum=0.5, doc="How far walls and roof flare over a round before they step back."
    )
    bolts_m: float = setting(
        0.0, unit="m", minimum=0.0, maximum=0.3, doc="How far plates of rock bolts and mesh stand out of the rock."
    )
    bolt_spacing_m: float = setting(1.2, unit="m", minimum=0.4, maximum=5.0, doc="Distance from bolt to bolt.")
    cross_drifts: tuple[tuple[float, float, float], ...] = setting(
        (),
        unit="m, deg, m",
        doc="Side openings as (driven distance, angle from the drift, length); positive angles lie left.",
    )
    widenings: tuple[tuple[float, float, float, float], ...] = setting(
        (),
        unit="m, m, m, m",
        doc="How much wider on the left, on the right, and higher, from driven distance to driven distance; linear between.",
    )
    mesh_m: float = setting(0.06, unit="m", minimum=0.01, maximum=0.5, doc="Edge length of the mesh.")


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """How the machine drives along the centre line."""

    distance_m: float = setting(
        100.0, unit="m", minimum=1.0, maximum=5000.0, doc="Distance from start to end of the drive."
    )
    speed_kmh: float = setting(12.0, unit="km/h", source=FINDINGS, minimum=0.1, maximum=40.0, doc="Tramming speed.")
    acceleration_mps2: float = setting(
        0.6, unit="m/s²", minimum=0.05, maximum=5.0, doc="Rate of the start and stop ramps."
    )
    speed_variation: float = setting(0.03, minimum=0.0, maximum=0.3, doc="Slow changes of the speed, share of it.")
    wander_m: float = setting(
        0.1, unit="m", minimum=0.0, maximum=0.5, doc="Slow lateral wandering, standard deviation."
    )
    standstill_s: float = setting(
        1.0, unit="s", minimum=0.0, maximum=60.0, doc="Time at rest before and after the drive."
    )
    stops: tuple[tuple[float, float], ...] = setting((), unit="m, s", doc="Stops as (driven distance, time at rest).")
    reversals: tuple[tuple[float, float], ...] = setting(
        (), unit="m, m", doc="Reversals as (driven distance, distance driven back before going on)."
    )
    vibration_deg: float = setting(
        0.02,
        unit="deg",
        minimum=0.0,
        maximum=1.0,
        doc="Shaking of the front body in roll and pitch, standard deviation.",
    )
