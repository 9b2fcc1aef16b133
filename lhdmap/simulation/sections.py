"""The sections of a scenario: what there is to set, with unit and source."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

FINDINGS = "simulated drift of the findings, section 3"
LMS511 = "data sheet of the SICK LMS511"
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


@dataclass(frozen=True, slots=True)
class ScannerSettings:
    """The 2D scanners, like SICK LMS511; rear and front alike."""

    beams: int = setting(381, source=LMS511, minimum=5, maximum=4000, doc="Beams over the field of view: 381 or 761.")
    field_of_view_deg: float = setting(
        190.0, unit="deg", source=LMS511, minimum=10.0, maximum=359.0, doc="Field of view."
    )
    rate_hz: float = setting(25.0, unit="Hz", source=LMS511, minimum=0.5, maximum=100.0, doc="Sweeps in a second.")
    noise_m: float = setting(
        0.012, unit="m", source=FINDINGS, minimum=0.0, maximum=0.5, doc="Range noise, standard deviation."
    )
    min_range_m: float = setting(0.2, unit="m", minimum=0.0, maximum=5.0, doc="Shortest range that is measured.")
    max_range_m: float = setting(
        80.0, unit="m", source=LMS511, minimum=1.0, maximum=200.0, doc="Longest range that is measured."
    )
    sweep: bool = setting(
        False, doc="Measure each beam at its own time (sweep distortion) instead of all at the stamp."
    )
    dust_share: float = setting(0.0, minimum=0.0, maximum=0.9, doc="Mean share of beams that a dust cloud returns.")
    mixed_pixel_share: float = setting(
        0.0, minimum=0.0, maximum=1.0, doc="Share of beams at depth edges that return a range between the two surfaces."
    )
    drop_out_share: float = setting(0.0, minimum=0.0, maximum=0.9, doc="Share of beams without a return.")
    blackouts: tuple[tuple[float, float], ...] = setting(
        (), unit="s, s", doc="Times without any return as (time in the log, duration)."
    )
    person: tuple[tuple[float, float, float], ...] = setting(
        (),
        unit="s, s, -",
        doc="Someone before the scanners as (time, duration, share of the beams hidden, from the right).",
    )
    rear: bool = setting(True, doc="Whether the machine has a rear scanner.")
    occlusion: bool = setting(True, doc="Whether the machine's own bodies hide what is behind them.")


@dataclass(frozen=True, slots=True)
class InclinometerSettings:
    """The inclinometer of the front body."""

    enabled: bool = setting(True, doc="Whether there is one.")
    rate_hz: float = setting(100.0, unit="Hz", minimum=1.0, maximum=1000.0, doc="Readings in a second.")
    noise_deg: float = setting(0.1, unit="deg", source="issue figures", minimum=0.0, maximum=5.0, doc="White noise.")
    lag_s: float = setting(0.1, unit="s", source="issue figures", minimum=0.0, maximum=2.0, doc="Lag of the reading.")
    lag_kind: str = setting(
        "first_order", choices=("first_order", "delay"), doc="Low pass of that time constant, or pure delay."
    )
    bias_roll_deg: float = setting(0.0, unit="deg", minimum=-10.0, maximum=10.0, doc="Constant error of the roll.")
    bias_pitch_deg: float = setting(0.0, unit="deg", minimum=-10.0, maximum=10.0, doc="Constant error of the pitch.")


@dataclass(frozen=True, slots=True)
class WheelSettings:
    """Tachometer, joint encoders and transmission pressure."""

    enabled: bool = setting(True, doc="Whether they are in the log.")
    rate_hz: float = setting(50.0, unit="Hz", minimum=1.0, maximum=1000.0, doc="Readings in a second.")
    scale_error: float = setting(
        0.01,
        source="issue figures",
        minimum=0.0,
        maximum=0.5,
        doc="Size of the tachometer's scale error; the seed gives its sign.",
    )
    noise_mps: float = setting(0.02, unit="m/s", minimum=0.0, maximum=1.0, doc="White noise of the tachometer.")
    slip: bool = setting(False, doc="Whether the wheels slip in bursts.")
    slip_burst_s: float = setting(
        2.0, unit="s", source="issue figures", minimum=0.1, maximum=60.0, doc="Length of a burst."
    )
    slip_every_s: float = setting(15.0, unit="s", minimum=1.0, maximum=600.0, doc="Mean time from burst to burst.")
    slip_size: float = setting(0.5, minimum=0.0, maximum=5.0, doc="Wheel speed over ground speed in a burst, less one.")
    articulation_noise_deg: float = setting(
        0.05, unit="deg", minimum=0.0, maximum=5.0, doc="White noise of the joint encoder."
    )
