"""Settings of charging and excavation: where a value is the paper's, its table or section is the source."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

DETECTORS = ("paper", "fused")
METHODS = ("paper", "paper-tuned", "adaptive")
_TABLE_1 = "autonomous_loading, Table 1"
_PAPER = "autonomous_loading, section 3.3"
_FINDINGS = "loading findings, sections 3 and 6"
_SEARCHED = "searched for on a model: evaluation/loading.md"
_NOT_PRINTED = "the paper prints none; loading findings, section 1"


@dataclass(frozen=True, slots=True)
class ChargingSettings:
    """Driving into the pile until the machine is felt to touch it: docs/loading_control.md."""

    detector: str = setting(
        "fused",
        choices=DETECTORS,
        doc="paper: 300 bar of the transmission or a skid factor of 0.5; fused: force, slip and the range to the toe.",
    )
    pedal: float = setting(
        0.5, minimum=0.05, maximum=1.0, source="autonomous_loading, 4.1", doc="Pedal while charging."
    )
    pressure_bar: float = setting(
        300.0, unit="bar", minimum=10.0, maximum=1000.0, source=_PAPER, doc="paper: transmission above it is a touch."
    )
    skid: float = setting(
        0.5, minimum=0.01, maximum=2.0, source=_PAPER, doc="paper: skid above it is a touch, Eq. (7)."
    )
    window_s: float = setting(
        1.0, unit="s", minimum=0.02, maximum=10.0, source=_NOT_PRINTED, doc="Window of v_Mm in Eq. (7)."
    )
    floor_mps: float = setting(
        0.2, unit="m/s", minimum=0.001, maximum=2.0, source=_NOT_PRINTED, doc="v_Mm of Eq. (7) is not less."
    )
    lag_matched: bool = setting(
        False, source="finding E3", doc="Eq. (7) compares the wheels of the moment of the scan, not of now."
    )
    launch_s: float = setting(
        1.5,
        unit="s",
        minimum=0.0,
        maximum=10.0,
        source="finding E2: without it 99 % of the charges trigger at once",
        doc="Nothing counts as a touch so long after the start.",
    )
    force_kn_per_bar: float = setting(
        0.4,
        unit="kN/bar",
        minimum=0.01,
        maximum=10.0,
        source="assumed: 3 litres per radian, tyres of 0.8 m",
        doc="Force at the tyres for a bar of the transmission.",
    )
    mass_t: float = setting(
        34.0, unit="t", minimum=1.0, maximum=300.0, source="class figure, wheels included", doc="Mass that is driven."
    )
    rolling_kn: float = setting(
        10.3, unit="kN", minimum=0.0, maximum=200.0, source="3.5 % of the weight", doc="Force of rolling freely."
    )
    slope_s: float = setting(
        0.3, unit="s", minimum=0.06, maximum=2.0, doc="Window of the acceleration, which is a line through the speed."
    )
    force_kn: float = setting(
        20.0, unit="kN", minimum=1.0, maximum=500.0, source=_FINDINGS, doc="fused: a larger force is summed up."
    )
    force_sum_kns: float = setting(
        4.0, unit="kN s", minimum=0.01, maximum=500.0, source=_FINDINGS, doc="fused: ... and is a touch at this sum."
    )
    slip_m: float = setting(
        0.08, unit="m", minimum=0.005, maximum=2.0, source=_FINDINGS, doc="fused: slip that is a touch."
    )
    slip_free_mps: float = setting(
        0.06, unit="m/s", minimum=0.0, maximum=1.0, doc="fused: slower slip is taken for noise of the odometry."
    )
    gate_std: float = setting(
        2.0, minimum=0.0, maximum=10.0, doc="fused: a touch counts from so many deviations before the perceived toe on."
    )
    gate_m: float = setting(
        0.1, unit="m", minimum=0.0, maximum=5.0, doc="fused: ... and so much before that, for what rolls down."
    )
    inside_m: float = setting(
        2.0,
        unit="m",
        minimum=0.0,
        maximum=5.0,
        doc="fused: so far behind the toe, and the deviations, is a touch without any force.",
    )
    relief_s: float = setting(
        0.12,
        unit="s",
        minimum=0.0,
        maximum=2.0,
        source=_FINDINGS,
        doc="fused: tilt pulse that eases a bucket pressed too hard, where a force is felt before the gate; 0: none.",
    )


@dataclass(frozen=True, slots=True)
class PaperDigSettings:
    """Eq. (8) and Fig. 19 with the numbers of Table 1, and a switch for each step that is wrong or open as printed."""

    pedal: float = setting(0.5, minimum=0.0, maximum=1.0, source=_TABLE_1, doc="P_0.")
    ramp_per_s: float = setting(
        1.2, unit="1/s", minimum=0.05, maximum=50.0, source=_TABLE_1, doc="R_0: slope of the tilt command."
    )
    skid_max: float = setting(0.2, minimum=0.0, maximum=5.0, source=_TABLE_1, doc="The boom is lifted above it.")
    boom_max_rad: float = setting(0.5, unit="rad", minimum=-1.0, maximum=2.0, source=_TABLE_1, doc="Stop: β_max.")
    advance_max_m: float = setting(2.0, unit="m", minimum=0.1, maximum=10.0, source=_TABLE_1, doc="Stop: d_max.")
    phase_max_s: float = setting(1.0, unit="s", minimum=0.02, maximum=10.0, source=_TABLE_1, doc="Δt_max of a state.")
    phase_min_s: float = setting(0.5, unit="s", minimum=0.0, maximum=10.0, source=_TABLE_1, doc="Δt_min of a state.")
    pressure_max_bar: float = setting(
        300.0, unit="bar", minimum=10.0, maximum=1000.0, source=_TABLE_1, doc="EP_max: S_push ends above it."
    )
    time_read_again: bool = setting(
        True,
        source="finding E1",
        doc="Δt is read again after S_tilt has ended; false: Fig. 19 as printed, S_push ends in the tick that it begins.",
    )
    lag_matched: bool = setting(
        False, source="finding E3", doc="Eq. (7) compares the wheels of the moment of the scan, not of now."
    )
    hysteresis: float = setting(
        0.0,
        minimum=0.0,
        maximum=2.0,
        source="finding E4",
        doc="Skid falls by so much below skid_max before the lift ends.",
    )
    lift_least_s: float = setting(
        0.0, unit="s", minimum=0.0, maximum=5.0, source="finding E4", doc="A lift once begun lasts so long at least."
    )
    tilt_ends_early: bool = setting(
        False,
        source="finding E8: the text has a lower bound of S_tilt, Fig. 19 none",
        doc="S_tilt ends after Δt_min too, once the pressure is below EP_max.",
    )
    pressure_needed: bool = setting(
        False,
        source="finding E9: `a and b or c` without brackets",
        doc="S_push ends by pressure alone (after Δt_min or Δt_max); false: by pressure after Δt_min, or by Δt_max.",
    )


@dataclass(frozen=True, slots=True)
class TunedDigSettings(PaperDigSettings):
    """The same law with numbers that were searched for with the same budget as those of `adaptive`: evaluation/loading.md."""

    pedal: float = setting(0.698, minimum=0.0, maximum=1.0, source=_SEARCHED, doc="P_0.")
    ramp_per_s: float = setting(
        3.73, unit="1/s", minimum=0.05, maximum=50.0, source=_SEARCHED, doc="R_0: slope of the tilt command."
    )
    skid_max: float = setting(0.082, minimum=0.0, maximum=5.0, source=_SEARCHED, doc="The boom is lifted above it.")
    boom_max_rad: float = setting(0.721, unit="rad", minimum=-1.0, maximum=2.0, source=_SEARCHED, doc="Stop: β_max.")
    advance_max_m: float = setting(3.2, unit="m", minimum=0.1, maximum=10.0, source=_SEARCHED, doc="Stop: d_max.")
    phase_max_s: float = setting(
        0.566, unit="s", minimum=0.02, maximum=10.0, source=_SEARCHED, doc="Δt_max of a state."
    )
    phase_min_s: float = setting(0.585, unit="s", minimum=0.0, maximum=10.0, source=_SEARCHED, doc="Δt_min of a state.")
    pressure_max_bar: float = setting(
        401.0, unit="bar", minimum=10.0, maximum=1000.0, source=_SEARCHED, doc="EP_max: S_push ends above it."
    )
    hysteresis: float = setting(
        0.015,
        minimum=0.0,
        maximum=2.0,
        source=_SEARCHED,
        doc="Skid falls by so much below skid_max before the lift ends.",
    )
    lift_least_s: float = setting(
        0.389, unit="s", minimum=0.0, maximum=5.0, source=_SEARCHED, doc="A lift once begun lasts so long at least."
    )


@dataclass(frozen=True, slots=True)
class ExcavationSettings:
    """Which method digs, where α is zero, and the numbers of `adaptive`: docs/loading_control.md."""

    method: str = setting(
        "adaptive", choices=METHODS, doc="Fig. 19 with Table 1; the same with other numbers; our own force law."
    )
    racked_rad: float = setting(
        0.0,
        unit="rad",
        minimum=-2.0,
        maximum=2.0,
        source="finding E5: α = 0 is the racked bucket, α ≈ -0.83 a level floor",
        doc="`bucket_tilt` of the racked bucket, which is the zero of α.",
    )
    alpha_max_rad: float = setting(0.0, unit="rad", minimum=-2.0, maximum=1.0, source=_TABLE_1, doc="Stop: α_max.")
    alpha_tolerance_rad: float = setting(
        0.03,
        unit="rad",
        minimum=0.0,
        maximum=0.5,
        source="finding E6: a stop read as -0.02 never ends a dig",
        doc="α_max counts as reached so much before it.",
    )
    window_s: float = setting(
        1.0, unit="s", minimum=0.02, maximum=10.0, source=_NOT_PRINTED, doc="Window of v_Mm in Eq. (7)."
    )
    floor_mps: float = setting(
        0.2, unit="m/s", minimum=0.001, maximum=2.0, source=_NOT_PRINTED, doc="v_Mm of Eq. (7) is not less."
    )
    force_kn_per_bar: float = setting(
        0.4,
        unit="kN/bar",
        minimum=0.01,
        maximum=10.0,
        source="assumed: 3 litres per radian, tyres of 0.8 m",
        doc="adaptive: force at the tyres for a bar of the transmission.",
    )
    mass_t: float = setting(
        34.0, unit="t", minimum=1.0, maximum=300.0, source="class figure, wheels included", doc="adaptive: mass driven."
    )
    slope_s: float = setting(
        0.2, unit="s", minimum=0.06, maximum=2.0, doc="adaptive: window of the acceleration, a line through the speed."
    )
    pedal: float = setting(0.891, minimum=0.05, maximum=1.0, source=_SEARCHED, doc="adaptive: pedal.")
    pedal_slipping: float = setting(
        0.785, minimum=0.0, maximum=1.0, source=_SEARCHED, doc="adaptive: share of the pedal while the wheels slip."
    )
    force_kn: float = setting(
        146.0, unit="kN", minimum=0.0, maximum=1000.0, source=_SEARCHED, doc="adaptive: tilt begins at this force."
    )
    force_range_kn: float = setting(
        92.2, unit="kN", minimum=1.0, maximum=2000.0, source=_SEARCHED, doc="adaptive: ... full so much above it."
    )
    advance_mps: float = setting(
        0.153, unit="m/s", minimum=-1.0, maximum=2.0, source=_SEARCHED, doc="adaptive: tilt begins below this advance."
    )
    advance_range_mps: float = setting(
        0.928, unit="m/s", minimum=0.001, maximum=5.0, source=_SEARCHED, doc="adaptive: ... full so much below it."
    )
    skid_max: float = setting(
        0.082, minimum=0.0, maximum=5.0, source=_SEARCHED, doc="adaptive: the boom is lifted above this skid."
    )
    lag_matched: bool = setting(
        True, source="finding E3", doc="adaptive: Eq. (7) with the wheels of the scan's moment."
    )
    skid_smooth_s: float = setting(
        0.365,
        unit="s",
        minimum=0.0,
        maximum=5.0,
        doc="adaptive: time constant of the skid, whose noise is that of the scans.",
    )
    hysteresis: float = setting(
        0.016, minimum=0.0, maximum=2.0, doc="adaptive: skid falls by so much before the lift ends."
    )
    lift_least_s: float = setting(0.389, unit="s", minimum=0.0, maximum=5.0, doc="adaptive: least time of a lift.")
    boom_max_rad: float = setting(
        0.728, unit="rad", minimum=-1.0, maximum=2.0, source=_SEARCHED, doc="adaptive: stop β_max."
    )
    lift_most_rad: float = setting(
        0.5,
        unit="rad",
        minimum=0.0,
        maximum=2.0,
        source="autonomous_loading, Table 1: β_max",
        doc="All methods: the boom is lifted no higher; scanners that look ahead do not see the roof.",
    )
    advance_max_m: float = setting(
        2.71, unit="m", minimum=0.1, maximum=10.0, source=_SEARCHED, doc="adaptive: stop d_max."
    )
    resists_kn: float = setting(
        100.0,
        unit="kN",
        minimum=0.0,
        maximum=1000.0,
        doc="adaptive: the way of d_max begins at this force, or after 2 m.",
    )
    stuck_s: float = setting(
        0.647,
        unit="s",
        minimum=0.1,
        maximum=30.0,
        doc="adaptive: no tilt, no lift, no advance for so long is being stuck.",
    )
    stuck_mps: float = setting(0.03, unit="m/s", minimum=0.0, maximum=1.0, doc="adaptive: slower is no advance.")
    stuck_rps: float = setting(
        0.02, unit="rad/s", minimum=0.0, maximum=1.0, doc="adaptive: slower is no tilt, no lift."
    )
    back_off_s: float = setting(
        1.18,
        unit="s",
        minimum=0.0,
        maximum=10.0,
        source=_SEARCHED,
        doc="adaptive: reverse pulse of a stuck machine; 0: none.",
    )
    back_off_pedal: float = setting(
        0.5, minimum=0.0, maximum=1.0, doc="adaptive: pedal of that pulse, in reverse gear."
    )
