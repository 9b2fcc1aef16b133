"""Logs of loadings with known digs and fills: the small loader of the controllers' tests, recorded on the contract's topics."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from lhdmap.loading.charge import Charge
from lhdmap.loading.digging_settings import ChargingSettings
from lhdmap.loading.excavation import DigSettings, excavation_of
from lhdmap.loading.signals import Controller, Pedals, Signals
from lhdmap.loading.weighing import Weighing
from lhdmap.loading.weighing_settings import WeighingSettings
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import Command, Joints, Pressure, Tachometer, Text

from tests.loading.digging.rig import Loader, World

TOPICS = "cjtlsm"  # commands, joints, transmission, lift, speed, mode
_PA = 1e5


@dataclass
class Recorded:
    """A log in the making, and what is true of it: lengths of digs and fills, attempt by attempt."""

    writer: LogWriter
    topics: str = TOPICS
    durations_s: list[float] = field(default_factory=list)
    now_ns: int = 50_000_000_000

    def tick(self, loader: Loader, pedals: Pedals) -> Signals:
        """Move on and record."""
        loader.tick(pedals)
        one = loader.signals()
        ns, write = one.now_ns, self.writer.write
        command = Command(ns, pedals.propel, 0.0, pedals.tilt, pedals.lift, pedals.full_rpm, pedals.brake)
        joints = {"articulation": 0.001 * (ns % 7), "boom_lift": one.boom_rad, "bucket_tilt": one.bucket_rad}
        for letter, topic, message in (
            ("c", "/machine/command", command),
            ("j", "/machine/joints", Joints(ns, joints, {})),
            ("t", "/machine/pressure/transmission", Pressure(ns, one.transmission_bar * _PA)),
            ("l", "/machine/pressure/lift", Pressure(ns, one.lift_bar * _PA)),
            ("s", "/machine/tachometer", Tachometer(ns, one.tacho_mps)),
        ):
            if letter in self.topics:
                write(topic, message)
        return one

    def step(self, controller: Controller, loader: Loader) -> float:
        """Step a controller to its end; return its time."""
        signals = loader.signals()
        controller.begin(signals)
        begun_ns = signals.now_ns
        while True:
            turn = controller.step(signals)
            if turn.ended:
                return (signals.now_ns - begun_ns) * 1e-9
            signals = self.tick(loader, turn.pedals)

    def hold(self, loader: Loader, pedals: Pedals, seconds: float) -> None:
        """Ask for the same for a while."""
        for _ in range(round(seconds / 0.02)):
            self.tick(loader, pedals)

    def attempt(self, fill: float, method: str = "paper") -> None:
        """Record an attempt that leaves this fill."""
        loader = Loader(World(toe_m=2.5, hardness_kn=90.0, fill=fill, noise=0.5), now_ns=self.now_ns)
        self.step(Charge(ChargingSettings(), "paper"), loader)
        self.durations_s.append(self.step(excavation_of(DigSettings(), method), loader))
        self.hold(loader, Pedals(tilt=1.0, full_rpm=True, brake=True), 1.5)
        self.hold(loader, Pedals(propel=-0.5), 4.0)
        loader.world = replace(loader.world, hardness_kn=0.0)
        self.step(Weighing(WeighingSettings()), loader)
        self.hold(loader, Pedals(brake=True), 0.5)
        self.now_ns = loader.now_ns

    def haul(self) -> None:
        """Record that the machine goes to dump its bucket, and comes back."""
        loader = Loader(World(toe_m=1e3, noise=0.5), now_ns=self.now_ns)
        self.hold(loader, Pedals(propel=1.0), 40.0)
        self.now_ns = loader.now_ns


def write_loading(path: Path, loads: list[list[float]], topics: str = TOPICS, method: str = "paper") -> list[float]:
    """Write a log of loads, of each the fills after its attempts; return the lengths of all digs."""
    with LogWriter(path) as writer:
        record = Recorded(writer, topics)
        if "m" in topics:
            writer.write("/operation/mode", Text(record.now_ns, "autonomous"))
        for fills in loads:
            for fill in fills:
                record.attempt(fill, method)
            record.haul()
    return record.durations_s
