"""What the loading controllers hear at a moment, and what they ask of the pedals: plain values, of a log or of a machine."""

from __future__ import annotations

from typing import NamedTuple, Protocol


class Signals(NamedTuple):
    """All that is known of the machine at `now_ns`; SI units, pressures in bar (the field's unit, and the paper's).

    Attributes:
        now_ns: time of this moment; the only clock there is.
        tacho_mps: drive-line speed, signed; slips with the wheels.
        scan_mps: speed along x by scan odometry; NaN where there is none yet.
        scan_ns: stamp of the scan that `scan_mps` is of: it lags behind `now_ns`.
        travel_m: way along x by scan odometry since its start, signed.
        boom_rad: β, `boom_lift`; grows as the boom is lifted.
        bucket_rad: α, `bucket_tilt`; 0 where fully racked, about -0.83 with the floor level (findings, E5).
        articulation_rad: joint angle γ.
        transmission_bar: hydrostatic transmission.
        lift_bar: boom cylinders.
        tilt_bar: tilt cylinder.
        toe_m: way of the bucket's lip to the toe of the pile as perceived, metres; NaN where no pile is known.
        toe_std_m: its standard deviation.
    """

    now_ns: int
    tacho_mps: float
    scan_mps: float
    scan_ns: int
    travel_m: float
    boom_rad: float
    bucket_rad: float
    articulation_rad: float
    transmission_bar: float
    lift_bar: float
    tilt_bar: float
    toe_m: float = float("nan")
    toe_std_m: float = float("nan")


class Pedals(NamedTuple):
    """What a controller asks for; the shares are those of `lhd_msgs/MachineCommand`.

    `steering_rate_rps`: 0, the joint is held where it is; positioning alone turns it.
    """

    propel: float = 0.0
    tilt: float = 0.0
    lift: float = 0.0
    full_rpm: bool = False
    brake: bool = False
    steering_rate_rps: float = 0.0


class Turn(NamedTuple):
    """What a controller says at a step: pedals, and where it has ended the cause (empty: it goes on).

    `values`: what decided, for the journal.
    """

    pedals: Pedals
    ended: str = ""
    values: tuple[tuple[str, float], ...] = ()


class Controller(Protocol):
    """Charging, excavation, shaking, weighing: begun once, then stepped each 20 ms. Time limits are the state machine's."""

    def begin(self, signals: Signals) -> None:
        """Begin at this moment; what was before is forgotten."""
        ...

    def step(self, signals: Signals) -> Turn:
        """Return what is to be done now."""
        ...
