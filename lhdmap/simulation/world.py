"""A simulated world: the drift, the machine's motion through it, and what the scanners' rays meet."""

from __future__ import annotations

import itertools
import math
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lhdmap.errors import ConfigError
from lhdmap.kinematics import articulation_along_path
from lhdmap.machine import Machine, load_machine
from lhdmap.messages import FloatArray
from lhdmap.mine.centre_line import STEP_M, CentreLine, Start, centre_line
from lhdmap.simulation.crossing import Crossing, side_drift
from lhdmap.simulation.drift import Drift, Mesh
from lhdmap.simulation.driving import Motion, Plan, Shaking, drive_path, simulate_motion
from lhdmap.simulation.mesh_file import write_ply
from lhdmap.simulation.pile import Pile, make_pile
from lhdmap.simulation.pile_sections import MountingSettings
from lhdmap.simulation.raycast import TiledSurface
from lhdmap.simulation.scanner import Beams, Rig, beams_of, rig_of
from lhdmap.simulation.scenario import DriftScenario, flattened
from lhdmap.simulation.sensors import Clock
from lhdmap.simulation.timetable import timetable

_PIECE_M = 30.0
FRONT = "lidar_front"
_VIEW_M = 0.25  # how far a scanner's height is above the bucket: it is mounted where its view is free
START_NS = 1_700_000_000_123_456_789
BEHIND_M, _AHEAD_M = 14.0, 20.0  # drift behind the machine's start and ahead of its end


class DriftWorld:
    """The world of a scenario; all in it follows from the scenario and its seed."""

    def __init__(self, scenario: DriftScenario) -> None:
        self.scenario = flattened(scenario)
        machine = load_machine(Path(scenario.machine) if scenario.machine else None)
        self.machine = _mounted(_levelled(machine, scenario.planar), scenario.mounting)
        self.clock = Clock(START_NS)
        self.drift = self._make_drift()
        self.crossing = self._make_crossing()
        self.pile = self._make_pile()
        self.motion = self._make_motion()
        self.beams: Beams = beams_of(self.scenario.scanner)
        reach_m = min(self.scenario.scanner.max_range_m, 85.0) + 15.0
        self.surface = TiledSurface(self.mesh_between, reach_m, tile_m=40.0 if self.pile is None else 1e6)

    def rng(self, name: str) -> np.random.Generator:
        """Return the source of chance of the part `name`: independent of all others and of the order of use."""
        pile = self.scenario.pile
        kind = [] if pile is None else [zlib.crc32(pile.variant.encode())]
        return np.random.default_rng([self.scenario.seed, zlib.crc32(name.encode()), *kind])

    def _make_drift(self) -> Drift:
        settings, rng = self.scenario.drift, self.rng("start")
        x, y, z = rng.uniform((-20.0, -20.0, -2.0), (20.0, 20.0, 2.0))
        start = Start(x, y, 0.0 if self.scenario.planar else z, rng.uniform(-math.pi, math.pi))
        pile = self.scenario.pile
        length = BEHIND_M + (self.scenario.drive.distance_m + _AHEAD_M if pile is None else pile.toe_m + pile.back_m)
        if settings.widenings:
            shifted = tuple((at + BEHIND_M, left, right, roof) for at, left, right, roof in settings.widenings)
            settings = replace(settings, widenings=shifted)
        line = centre_line(settings.pieces, length, settings.transition_m, start)
        return Drift(settings, line, self.rng("drift"), planar=self.scenario.planar)

    def _make_crossing(self) -> Crossing:
        planar, sides = self.scenario.planar, []
        for index, (at_m, angle_deg, length_m) in enumerate(self.scenario.drift.cross_drifts):
            place = (at_m + BEHIND_M, angle_deg, length_m)
            sides.append(side_drift(self.drift, place, self.rng(f"cross drift {index}"), planar=planar))
        return Crossing(self.drift, sides, planar=planar)

    def _make_pile(self) -> Pile | None:
        settings = self.scenario.pile
        if settings is None:
            return None
        return make_pile(settings, self.drift, BEHIND_M + settings.toe_m, self.machine, self.rng("pile"))

    def _make_motion(self) -> Motion:
        settings = self.scenario.drive
        path = drive_path(self.drift, settings, self.rng("path"))
        plan = Plan(path, BEHIND_M, timetable(settings, self.rng("speed")))
        self._check_bends(path)
        shaking = Shaking(math.radians(settings.vibration_deg), self.rng("shaking"))
        return simulate_motion(self.drift, plan, self.machine, shaking)

    def _check_bends(self, path: CentreLine) -> None:
        size = self.machine.dimensions
        front_m, rear_m = size.joint_to_front_axle_m, size.joint_to_rear_axle_m
        bend_rad = articulation_along_path(path.curvature_pm, STEP_M, front_m, rear_m)
        largest_deg = math.degrees(float(np.abs(bend_rad).max()))
        if not largest_deg <= size.max_articulation_deg:
            raise ConfigError(
                f"the bends of drift.pieces ask for an articulation of {largest_deg:.0f}°, but the machine bends to "
                f"{size.max_articulation_deg:g}° only: use larger radii"
            )

    def rig(self, mount: str) -> Rig:
        """Return the rig of the scanner with that mount.

        Raises:
            ConfigError: the machine has no such mount.
        """
        if mount not in self.machine.mounts:
            raise ConfigError(f"machine '{self.machine.name}' has no [mount.{mount}]: the simulator needs one")
        true_mount = self.machine.mounts[mount]
        if mount == FRONT and self.scenario.mounting is not None:
            error_deg = self.scenario.mounting.tilt_error_deg
            true_mount = replace(true_mount, pitch_deg=true_mount.pitch_deg + error_deg)
        return rig_of(self.machine, true_mount, occlusion=self.scenario.scanner.occlusion)

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
        spacing = self.scenario.drift.mesh_m
        mesh = self.crossing.mesh(math.floor(start_m / spacing), math.ceil(end_m / spacing) + 1)
        return mesh if self.pile is None else self.pile.joined_to(mesh)

    def write_mesh(self, path: Path) -> None:
        """Write the whole mesh as PLY, in `map`.

        Raises:
            OSError: the file exists or cannot be written.
        """
        pieces = self.crossing.pieces(max(round(_PIECE_M / self.scenario.drift.mesh_m), 1))
        write_ply(path, pieces if self.pile is None else itertools.chain(pieces, self.pile.meshes()))


def _levelled(machine: Machine, planar: bool) -> Machine:
    """Return the machine with level scanners where the world is planar."""
    if not planar:
        return machine
    mounts = {name: replace(mount, roll_deg=0.0, pitch_deg=0.0) for name, mount in machine.mounts.items()}
    return replace(machine, mounts=mounts)


def _mounted(machine: Machine, mounting: MountingSettings | None) -> Machine:
    """Return the machine with its front scanner as the log says that it is mounted, and nothing in its view."""
    if mounting is None or FRONT not in machine.mounts:
        return machine
    mount = machine.mounts[FRONT]
    x, y, _ = mount.position_m
    mounts = {
        **machine.mounts,
        FRONT: replace(mount, position_m=(x, y, mounting.height_m), pitch_deg=mounting.tilt_deg),
    }
    top, bodies = mounting.height_m - _VIEW_M, dict(machine.bodies)
    for name, body in machine.bodies.items():
        if body.frame == "base_link" and body.max_m[0] > x and body.max_m[2] > top:
            bodies[name] = replace(body, max_m=(*body.max_m[:2], max(top, body.min_m[2] + 0.1)))
    return replace(machine, mounts=mounts, bodies=bodies)
