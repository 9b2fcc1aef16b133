"""A simulated world: the drift, the machine's motion through it, and what the scanners' rays meet."""

from __future__ import annotations

import math
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lhdmap.machine import Machine, load_machine
from lhdmap.messages import FloatArray
from lhdmap.simulation.centre_line import Start, centre_line
from lhdmap.simulation.drift import Drift, Mesh
from lhdmap.simulation.driving import Motion, Shaking, drive_path, simulate_motion
from lhdmap.simulation.mesh_file import write_ply
from lhdmap.simulation.raycast import TiledScene
from lhdmap.simulation.scanner import Beams, Rig, beams_of, rig_of
from lhdmap.simulation.scenario import DriftScenario, flattened
from lhdmap.simulation.sensors import Clock
from lhdmap.simulation.timetable import timetable

START_NS = 1_700_000_000_123_456_789
_BEHIND_M, _AHEAD_M = 14.0, 20.0  # drift behind the machine's start and ahead of its end


class DriftWorld:
    """The world of a scenario; all in it follows from the scenario and its seed."""

    def __init__(self, scenario: DriftScenario) -> None:
        self.scenario = flattened(scenario)
        self.machine = _levelled(load_machine(Path(scenario.machine) if scenario.machine else None), scenario.planar)
        self.clock = Clock(START_NS)
        self.drift = self._make_drift()
        self.motion = self._make_motion()
        self.beams: Beams = beams_of(self.scenario.scanner)
        reach_m = min(self.scenario.scanner.max_range_m, 85.0) + 15.0
        self.scene = TiledScene(self.mesh_between, reach_m)

    def rng(self, name: str) -> np.random.Generator:
        """Return the source of chance of the part `name`: independent of all others and of the order of use."""
        return np.random.default_rng([self.scenario.seed, zlib.crc32(name.encode())])

    def _make_drift(self) -> Drift:
        settings, rng = self.scenario.drift, self.rng("start")
        x, y, z = rng.uniform((-20.0, -20.0, -2.0), (20.0, 20.0, 2.0))
        start = Start(x, y, 0.0 if self.scenario.planar else z, rng.uniform(-math.pi, math.pi))
        length = self.scenario.drive.distance_m + _BEHIND_M + _AHEAD_M
        line = centre_line(settings.pieces, length, settings.transition_m, start)
        return Drift(settings, line, self.rng("drift"), planar=self.scenario.planar)

    def _make_motion(self) -> Motion:
        settings = self.scenario.drive
        path = drive_path(self.drift, settings, self.rng("path"))
        times = timetable(settings, _BEHIND_M, self.rng("speed"))
        shaking = Shaking(math.radians(settings.vibration_deg), self.rng("shaking"))
        return simulate_motion(self.drift, path, times, self.machine, shaking)

    def rig(self, mount: str) -> Rig:
        """Return the rig of the scanner with that mount."""
        return rig_of(self.machine, self.machine.mounts[mount], occlusion=self.scenario.scanner.occlusion)

    def place_m(self, time_s: float) -> float:
        """Return the place of the machine along the drift at a time, metres."""
        index = min(max(round(time_s * 1000.0), 0), len(self.motion.s_m) - 1)
        return float(self.motion.s_m[index])

    def dust(self, stamps_ns: npt.NDArray[np.int64]) -> FloatArray:
        """Return the share of beams that dust returns in the sweeps at `stamps_ns`: clouds come and go in seconds."""
        time_s = self.clock.seconds(stamps_ns)
        phase = self.rng("dust").uniform(0.0, 2 * np.pi, 2)
        wave = (
            1.0 + 0.6 * np.sin(2 * np.pi * time_s / 7.0 + phase[0]) + 0.4 * np.sin(2 * np.pi * time_s / 2.3 + phase[1])
        )
        return np.clip(self.scenario.scanner.dust_share * wave, 0.0, 1.0)

    def mesh_between(self, start_m: float, end_m: float) -> Mesh:
        """Return the mesh between two arc lengths; the drift's own ends are closed."""
        spacing, count = self.scenario.drift.mesh_m, self.drift.ring_count()
        first, last = math.floor(start_m / spacing), math.ceil(end_m / spacing) + 1
        return self.drift.mesh(first, last, closed=(first <= 0, last >= count))

    def write_mesh(self, path: Path) -> None:
        """Write the whole mesh as PLY, in `map`."""
        write_ply(path, self.mesh_between(0.0, self.drift.line.length_m))


def _levelled(machine: Machine, planar: bool) -> Machine:
    """Return the machine with level scanners where the world is planar."""
    if not planar:
        return machine
    mounts = {name: replace(mount, roll_deg=0.0, pitch_deg=0.0) for name, mount in machine.mounts.items()}
    return replace(machine, mounts=mounts)
