"""Settings of the shake, the weighing, and of the rule for another attempt."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting

_TABLE_2 = "autonomous_loading, Table 2"
_MODEL = "adaptive on a model of a mine; `fit_gains` takes a machine's own"


@dataclass(frozen=True, slots=True)
class WeighingSettings:
    """The bucket is shaken, lifted to β_weigh from below, left to settle, and weighed by the boom's pressure, Eq. (9)."""

    shakes: int = setting(2, minimum=0, maximum=20, source="autonomous_loading, 3.5", doc="Movements down and up.")
    shake_s: float = setting(0.3, unit="s", minimum=0.05, maximum=3.0, doc="Time of each way of a shake.")
    racked_s: float = setting(
        1.5, unit="s", minimum=0.0, maximum=10.0, doc="Then it is tilted back for so long at most."
    )
    boom_rad: float = setting(0.2, unit="rad", minimum=-1.0, maximum=2.0, source=_TABLE_2, doc="β_weigh.")
    below_rad: float = setting(
        0.05,
        unit="rad",
        minimum=0.0,
        maximum=0.5,
        doc="The lift begins so much below it: friction always has one sign.",
    )
    lift: float = setting(0.6, minimum=0.05, maximum=1.0, doc="Lift command on the way to β_weigh.")
    fill_per_bar: float = setting(0.0207, unit="1/bar", minimum=1e-5, maximum=1.0, source=_TABLE_2, doc="m of Eq. (9).")
    fill_offset: float = setting(1.0774, minimum=-10.0, maximum=10.0, source=_TABLE_2, doc="n of Eq. (9).")
    tare_bar: float = setting(
        0.0,
        unit="bar",
        minimum=0.0,
        maximum=1000.0,
        doc="Pressure of the empty bucket, weighed the same way: takes out zero and friction; 0: it was not weighed.",
    )
    method: str = setting(
        "sinusoid",
        choices=("mean", "sinusoid"),
        doc="Settled pressure: the mean of the last window, or what a damped sinusoid swings about.",
    )
    window_s: float = setting(1.0, unit="s", minimum=0.1, maximum=10.0, doc="Time that a weighing is of.")
    settled_bar: float = setting(
        2.0,
        unit="bar",
        minimum=0.05,
        maximum=100.0,
        source="loading findings, section 7",
        doc="Deviation when settled.",
    )
    low_pass_s: float = setting(0.1, unit="s", minimum=0.0, maximum=2.0, doc="Time constant before that test.")
    patience_s: float = setting(
        4.0, unit="s", minimum=0.2, maximum=30.0, doc="Weighed after so long in any case, with the deviation there is."
    )
    friction_bar: float = setting(
        1.2,
        unit="bar",
        minimum=0.0,
        maximum=50.0,
        source="loading findings, section 7",
        doc="1 σ of cylinder friction.",
    )
    zero_bar: float = setting(
        0.6,
        unit="bar",
        minimum=0.0,
        maximum=50.0,
        source="loading findings, section 7",
        doc="1 σ of the sensor's zero.",
    )
    centre_share: float = setting(
        0.02, minimum=0.0, maximum=0.5, source="loading findings, section 7", doc="1 σ of the load by where it lies."
    )


@dataclass(frozen=True, slots=True)
class AttemptSettings:
    """Whether another attempt pays: docs/loading_control.md."""

    rule: str = setting(
        "renewal",
        choices=("renewal", "threshold"),
        doc="renewal: while the expected gain per second is above the best tonnes per second; threshold: until `full`.",
    )
    full: float = setting(
        0.9, minimum=0.0, maximum=1.5, source="autonomous_loading, 4.1", doc="threshold: fill that is enough."
    )
    most: int = setting(6, minimum=1, maximum=20, doc="Attempts at most.")
    haul_s: float = setting(
        180.0, unit="s", minimum=0.0, maximum=7200.0, doc="Time from the last attempt to the next load's first."
    )
    attempt_s: float = setting(
        30.0, unit="s", minimum=1.0, maximum=600.0, source=_MODEL, doc="Time of an attempt, charge to weighing."
    )
    first_fill: float = setting(
        0.77, minimum=0.05, maximum=1.5, source=_MODEL, doc="Mean fill after the first attempt, as weighed."
    )
    first_std: float = setting(0.23, minimum=0.0, maximum=1.0, source=_MODEL, doc="Its deviation.")
    gain_empty: float = setting(
        0.70,
        minimum=0.0,
        maximum=1.5,
        source=_MODEL,
        doc="Gain of a further attempt by a line over the fill: at fill 0.",
    )
    gain_full: float = setting(0.0, minimum=-0.5, maximum=1.0, source=_MODEL, doc="... and at fill 1.")
