"""Settings of the loading task: time limits of its states, positioning, pull back, and what counts as heard."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

_PAPER = "autonomous_loading"
_FINDINGS = "loading findings"


@dataclass(frozen=True, slots=True)
class LoadingSettings:
    """Limits of the state machine (Fig. 6), and how the machine is brought before the pile and back."""

    identify_m: float = setting(
        15.0,
        unit="m",
        minimum=1.0,
        maximum=60.0,
        source=f"{_PAPER}, section 3.2",
        doc="A pile that is not identified this far before it is one for positioning assistance.",
    )
    facing_m: float = setting(
        5.0,
        unit="m",
        minimum=0.0,
        maximum=60.0,
        doc="It must have driven so far towards the pile before that counts: round a bend there is nothing to be seen.",
    )
    look_s: float = setting(
        10.0, unit="s", minimum=0.1, maximum=120.0, doc="How long it looks where it begins nearer than that."
    )
    identify_s: float = setting(
        120.0, unit="s", minimum=1.0, maximum=1200.0, doc="Time limit of the identification from afar."
    )
    position_s: float = setting(
        30.0, unit="s", minimum=1.0, maximum=600.0, source=f"{_PAPER}, section 3.3", doc="Time limit of positioning."
    )
    charge_s: float = setting(
        15.0,
        unit="s",
        minimum=1.0,
        maximum=600.0,
        source=f"{_FINDINGS}, E10: the paper's 10 s end a run-up of 7 m",
        doc="Time limit of charging.",
    )
    dig_s: float = setting(
        30.0, unit="s", minimum=1.0, maximum=600.0, source=f"{_PAPER}, section 3.4", doc="Time limit of excavation."
    )
    pull_back_s: float = setting(
        60.0,
        unit="s",
        minimum=1.0,
        maximum=600.0,
        source=f"{_PAPER}, section 3.5",
        doc="Time limit of the pull back, shaking included.",
    )
    weigh_s: float = setting(20.0, unit="s", minimum=1.0, maximum=600.0, doc="Time limit of weighing.")
    hold_s: float = setting(
        60.0, unit="s", minimum=1.0, maximum=3600.0, doc="How long it waits to be valid again before it asks for help."
    )
    assist_s: float = setting(
        900.0, unit="s", minimum=1.0, maximum=36000.0, doc="A request that nobody answers for so long ends the mission."
    )
    assists: int = setting(6, minimum=1, maximum=100, doc="Requests of a mission at most.")
    holds: int = setting(10, minimum=1, maximum=1000, doc="Stops of a mission at most; then it asks for help.")
    age_s: float = setting(
        0.3, unit="s", minimum=0.05, maximum=5.0, doc="Signals, motion or calls farther apart than this stop it."
    )
    scan_age_s: float = setting(
        0.5, unit="s", minimum=0.05, maximum=5.0, doc="The same for the scan odometry while it charges and digs."
    )
    frozen_s: float = setting(
        2.0,
        unit="s",
        minimum=0.1,
        maximum=60.0,
        doc="A pressure, or a wheel speed above 0, that is the same to the bit for so long is none.",
    )
    follows_s: float = setting(
        1.0,
        unit="s",
        minimum=0.1,
        maximum=60.0,
        doc="A boom or bucket that is commanded for so long, at full pedal, and reads the same to the bit is frozen.",
    )
    valid_s: float = setting(1.0, unit="s", minimum=0.0, maximum=60.0, doc="How long all must hold before it goes on.")
    standing_mps: float = setting(0.03, unit="m/s", minimum=0.001, maximum=0.5, doc="Slower than this is standing.")
    pile_moved_m: float = setting(
        1.0, unit="m", minimum=0.05, maximum=10.0, doc="Estimates whose centres are nearer than this are of one pile."
    )
    pile_hits: int = setting(
        3, minimum=0, maximum=1000, doc="Scan points at the pile that show that it is still there, before another try."
    )
    toe_std_m: float = setting(
        0.15,
        unit="m",
        minimum=0.0,
        maximum=5.0,
        source=f"{_FINDINGS}, section 6",
        doc="Deviation of the toe's place, as the detector of the charge is told.",
    )
    reach_m: float = setting(
        11.0,
        unit="m",
        minimum=2.0,
        maximum=40.0,
        source=f"{_PAPER}, section 3.3; the value is not printed",
        doc="Distance of the joint to the pile's centre at which guidance hands over.",
    )
    square_deg: float = setting(
        5.0,
        unit="deg",
        minimum=0.5,
        maximum=45.0,
        doc="Heading and joint must be this straight before the pile, or the machine is guided on to run_up_m before it.",
    )
    approach_kmh: float = setting(5.0, unit="km/h", minimum=0.5, maximum=20.0, doc="Speed up to there.")
    stuck_s: float = setting(
        8.0,
        unit="s",
        minimum=1.0,
        maximum=600.0,
        doc="Standing so long in the approach is being stuck: help is asked for.",
    )
    landing_m: float = setting(
        0.15, unit="m", minimum=0.0, maximum=1.0, doc="How far inside the pile's limits both sides have to land."
    )
    dig_m: float = setting(
        2.0,
        unit="m",
        minimum=0.0,
        maximum=6.0,
        doc="... and so far behind the toe, too: the bucket digs on as it landed.",
    )
    wall_m: float = setting(
        0.05, unit="m", minimum=0.0, maximum=1.0, doc="Margin of the boxes of Eq. (6) around both bodies."
    )
    align_dps: float = setting(5.0, unit="deg/s", minimum=0.1, maximum=20.0, doc="Rate of the steering corrections.")
    align_deg: float = setting(20.0, unit="deg", minimum=1.0, maximum=45.0, doc="Largest correction to either side.")
    creep: float = setting(0.1, minimum=0.0, maximum=0.5, doc="Pedal while the steering is corrected.")
    run_up_m: float = setting(
        2.5, unit="m", minimum=0.0, maximum=20.0, doc="Nearer to the pile than this it stands while it corrects."
    )
    charge_from_m: float = setting(
        1.0, unit="m", minimum=0.0, maximum=20.0, doc="Nearer to the pile than this no charge begins."
    )
    lower: float = setting(0.6, minimum=0.05, maximum=1.0, doc="Share with which bucket and boom are lowered.")
    press_bar: float = setting(
        23.0,
        unit="bar",
        minimum=1.0,
        maximum=300.0,
        source=f"{_PAPER}, section 3.3, Fig. 14",
        doc="Pressure of the tilt cylinder at which the bucket is pressed to the ground.",
    )
    press_most_bar: float = setting(
        35.0,
        unit="bar",
        minimum=1.0,
        maximum=300.0,
        source=f"{_FINDINGS}, E11: 60 bar trigger early in 30 %",
        doc="Pressed harder than this it is relieved.",
    )
    pull_back_m: float = setting(
        8.0,
        unit="m",
        minimum=1.0,
        maximum=40.0,
        source=f"{_PAPER}, section 3.5; the value is not printed",
        doc="How far it is driven back from the pile.",
    )
    back_kmh: float = setting(5.0, unit="km/h", minimum=0.5, maximum=20.0, doc="Speed of the pull back.")
    rack_s: float = setting(
        6.0,
        unit="s",
        minimum=0.1,
        maximum=60.0,
        doc="How long the bucket is retracted before it is pulled out as it is.",
    )
    racked_rad: float = setting(
        0.05,
        unit="rad",
        minimum=0.0,
        maximum=0.5,
        source=f"{_FINDINGS}, E6",
        doc="So near to its stop it is retracted.",
    )
    off_trail_m: float = setting(
        1.5, unit="m", minimum=0.1, maximum=20.0, doc="Farther from the way it came by it does not drive back alone."
    )
