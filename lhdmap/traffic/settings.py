"""Settings of traffic: what throughput is told with."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.settings import setting
from lhdmap.traffic.sections import Times
from lhdmap.traffic.simulation import Chance

_FINDINGS = "haulage findings, section 5"


@dataclass(frozen=True, slots=True)
class TrafficSettings:
    """Several machines on one map: sections, speeds and working times with which check-map tells the throughput."""

    section_m: float = setting(
        60.0,
        unit="m",
        minimum=20.0,
        maximum=1000.0,
        doc="Longest section of a tunnel: so near another machine may follow.",
    )
    machine_m: float = setting(
        10.0,
        unit="m",
        minimum=1.0,
        maximum=50.0,
        doc="Length of a machine: a section is free once so much is beyond it.",
    )
    empty_kmh: float = setting(12.0, unit="km/h", minimum=0.5, source=_FINDINGS, doc="Speed with an empty bucket.")
    loaded_kmh: float = setting(10.0, unit="km/h", minimum=0.5, source=_FINDINGS, doc="The same loaded.")
    load_s: float = setting(25.0, unit="s", minimum=0.0, source=_FINDINGS, doc="Mean time to load a bucket.")
    dump_s: float = setting(18.0, unit="s", minimum=0.0, source=_FINDINGS, doc="Mean time to dump it.")
    load_cv: float = setting(
        0.2, minimum=0.0, maximum=2.0, doc="Deviation of the time to load (lognormal), as a share of its mean."
    )
    dump_cv: float = setting(0.1, minimum=0.0, maximum=2.0, doc="The same of the time to dump (logistic).")
    hours: float = setting(2.0, unit="h", minimum=0.1, maximum=24.0, doc="How long is simulated.")
    pays: float = setting(
        0.15, minimum=0.0, maximum=5.0, doc="How much more, in buckets of one machine, a new bay must bring to be told."
    )

    @property
    def times(self) -> Times:
        """Speeds and mean working times."""
        return Times(self.empty_kmh, self.loaded_kmh, self.load_s, self.dump_s)

    @property
    def chance(self) -> Chance:
        """How they vary."""
        return Chance(0, self.load_cv, self.dump_cv)
