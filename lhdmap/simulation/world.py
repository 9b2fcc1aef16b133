"""A simulated world: the drift, the machine's motion through it, and what the scanners' rays meet."""

from __future__ import annotations

import itertools
import math
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from lhdmap.errors import ConfigError
from lhdmap.kinematics import articulation_along_path
from lhdmap.machine import Machine, SensorMount, load_machine
from lhdmap.messages import FloatArray
from lhdmap.mine.centre_line import STEP_M, CentreLine, Start, centre_line
from lhdmap.simulation.crossing import Crossing, side_drift
from lhdmap.simulation.drift import Drift, Mesh
from lhdmap.simulation.driving import TABLE_RATE_HZ, Plan, Shaking, drive_path, simulate_motion, slip_factors
from lhdmap.simulation.history import START_NS as START_NS  # others know it from here
from lhdmap.simulation.history import Column, History
from lhdmap.simulation.mesh_file import write_ply
from lhdmap.simulation.pile import Pile, make_pile
from lhdmap.simulation.pile_sections import MountingSettings
from lhdmap.simulation.raycast import Surface, TiledSurface
from lhdmap.simulation.scenario import DriftScenario, flattened
from lhdmap.simulation.timetable import timetable

_PIECE_M = 30.0
_TILE_M = 60.0  # a drift that is no longer than what is seen from such a stretch is one tile
_PLACE_STEP = 50  # of the centre line's samples, to find a place on it
FRONT = "lidar_front"
_VIEW_M = 0.25  # how far a scanner's height is above the bucket: it is mounted where its view is free
BEHIND_M, _AHEAD_M = 14.0, 20.0  # drift behind the machine's start and ahead of its end


class DriftWorld:
    """The world of a scenario; all in it follows from the scenario and its seed."""

    def __init__(self, scenario: DriftScenario) -> None:
        self.scenario = flattened(scenario)
        machine = load_machine(Path(scenario.machine) if scenario.machine else None)
        self.machine = _mounted(_levelled(machine, scenario.planar), scenario.mounting)
        self.drift = self._make_drift()
        self.crossing = self._make_crossing()
        self.pile = self._make_pile()
        self.history = self._make_history()
        self._line_points = self._points_on_line()
        reach_m = min(self.scenario.sensors.reach_m, 85.0) + 15.0
        whole = self.pile is not None or self.drift.line.length_m <= 2.0 * reach_m + _TILE_M
        self.surface = TiledSurface(self.mesh_between, reach_m, tile_m=1e6 if whole else _TILE_M)

    def rng(self, name: str) -> np.random.Generator:
        """Return the source of chance of the part `name`: independent of all others and of the order of use."""
        pile = self.scenario.pile
        kind = [] if pile is None else [zlib.crc32(pile.variant.encode())]
        return np.random.default_rng([self.scenario.seed, zlib.crc32(name.encode()), *kind])

    @property
    def sensor_seed(self) -> int:
        """Seed of the sensors: other readings in each variant of a pile."""
        pile = self.scenario.pile
        return self.scenario.seed + (0 if pile is None else zlib.crc32(pile.variant.encode()) << 32)

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

    def _make_history(self) -> History:
        settings = self.scenario.drive
        path = drive_path(self.drift, settings, self.rng("path"))
        plan = Plan(path, BEHIND_M, timetable(settings, self.rng("speed")))
        self._check_bends(path)
        shaking = Shaking(math.radians(settings.vibration_deg), self.rng("shaking"))
        rows = simulate_motion(self.drift, plan, self.machine, shaking)
        time_s = np.arange(len(rows)) / TABLE_RATE_HZ
        rows[:, Column.WHEEL_SPEED] *= slip_factors(self.scenario.wheels, time_s, self.rng("slip"))
        return History(TABLE_RATE_HZ, rows)

    def _points_on_line(self) -> FloatArray:
        line = self.drift.line
        return np.stack([line.x_m, line.y_m, line.z_m], axis=1)[::_PLACE_STEP]

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

    @property
    def true_mounts(self) -> dict[str, SensorMount]:
        """Mounts that are other than the log says."""
        if self.scenario.mounting is None or FRONT not in self.machine.mounts:
            return {}
        told = self.machine.mounts[FRONT]
        return {FRONT: replace(told, pitch_deg=told.pitch_deg + self.scenario.mounting.tilt_error_deg)}

    @property
    def distance_m(self) -> float:
        """Distance driven along the floor, forwards and in reverse, metres."""
        return float(np.abs(self.history.rows[:, Column.SPEED]).sum()) / TABLE_RATE_HZ

    def place_m(self, position_m: FloatArray) -> float:
        """Return the place along the drift that is nearest to a point (3,), metres."""
        offsets = self._line_points - position_m
        nearest = int(np.einsum("ij,ij->i", offsets, offsets).argmin())
        return float(self.drift.line.s_m[_PLACE_STEP * nearest])

    def dust(self, position_m: FloatArray) -> float:  # noqa: ARG002  # it is nowhere
        """Return the share of beams that dust returns at a place: it hangs nowhere, clouds come with time."""
        return 0.0

    def near(self, position_m: FloatArray) -> Surface:
        """Return the surface that rays from a point (3,) near the centre line meet."""
        return self.surface.near(self.place_m(position_m))

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
