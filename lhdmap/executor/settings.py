"""Settings of the command executor, the watchdog and the guard."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lhdmap.settings import setting

_FAULTS = "guidance findings, Q6: faults that were injected"


@dataclass(frozen=True, slots=True)
class ExecutorSettings:
    """Limits of what the machine is told, ages at which it is stopped, and the margin of the guard."""

    steering_dead_zone_dps: float = setting(
        0.3,
        unit="deg/s",
        minimum=0.0,
        maximum=5.0,
        source="guidance findings, section 2; topological_navigation, Eq. (21)",
        doc="Steering commands below this are not given.",
    )
    jerk_mps3: float = setting(
        4.0,
        unit="m/s3",
        minimum=0.2,
        maximum=50.0,
        doc="Largest change of acceleration that is commanded, but to brake.",
    )
    steering_jerk_dps2: float = setting(
        180.0, unit="deg/s2", minimum=5.0, maximum=5000.0, doc="Largest change of the steering command per time."
    )
    hold_s: float = setting(
        3.5,
        unit="s",
        minimum=0.2,
        maximum=10.0,
        source="Eq. (20): top speed on a full brake, loaded",
        doc="How long an operator's speed is queued; the watchdog stops it earlier where he falls silent.",
    )
    age_s: float = setting(
        0.3, unit="s", minimum=0.05, maximum=5.0, source=_FAULTS, doc="An input older than this stops the machine ..."
    )
    age_periods: float = setting(
        3.0, minimum=1.0, maximum=20.0, doc="... or, where its period is long, one older than so many periods."
    )
    link_lost_s: float = setting(
        2.0,
        unit="s",
        minimum=0.1,
        maximum=20.0,
        source="topological_navigation, section 5: a few seconds",
        doc="A link that is silent for so long is lost; one that is silent for `age_s` is degraded.",
    )
    jump_m: float = setting(
        0.2,
        unit="m",
        minimum=0.01,
        maximum=5.0,
        source=_FAULTS,
        doc="Pose and scan that disagree by more stop the machine.",
    )
    jump_deg: float = setting(
        1.0, unit="deg", minimum=0.05, maximum=45.0, source=_FAULTS, doc="The same of the heading."
    )
    joint_deg: float = setting(
        4.0,
        unit="deg",
        minimum=0.5,
        maximum=45.0,
        source="steering 15 % off at 15 deg/s misses 1.8 deg in 0.8 s",
        doc="A joint that misses its commands by more within 0.8 s stops the machine.",
    )
    valid_reports: int = setting(
        3,
        minimum=1,
        maximum=100,
        doc="Reports in a row in which pose and scan agree, before the machine is armed again.",
    )
    margin_m: float = setting(
        0.02,
        unit="m",
        minimum=0.0,
        maximum=1.0,
        source="measured: 0.05 stops a machine at 0.10 m from a wall by the noise of 2 cm alone",
        doc="So near to a body a point on the braking path is a contact.",
    )
    margin_growth: float = setting(
        0.02,
        unit="m/m",
        minimum=0.0,
        maximum=0.2,
        source="measured",
        doc="How the margin grows with the way to the point.",
    )
    own_body_m: float = setting(
        0.1,
        unit="m",
        minimum=0.01,
        maximum=1.0,
        doc="Points deeper than this in a body where it stands are returns of the machine itself.",
    )

    def jumps(self, apart_m: float, apart_rad: float) -> bool:
        """Return whether pose and scan are too far apart to go together."""
        return apart_m > self.jump_m or apart_rad > math.radians(self.jump_deg)
