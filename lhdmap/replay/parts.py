"""What a replay is put together from: world, machine, sensors, operator. `assemble` makes them; tests make simpler ones."""

# ruff: noqa: D102  # the names of a state say what they are
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from lhdmap.config import Settings
from lhdmap.console.attendant import Attendant
from lhdmap.guidance.directive import Directive
from lhdmap.machine import Machine
from lhdmap.messages import Command, FloatArray
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.replay.faults import Position
from lhdmap.replay.processes.navigator import Errand
from lhdmap.replay.processes.told import ModeNow
from lhdmap.replay.site_drive import SiteGround
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.sensing.sensor import Sensor
from lhdmap.simulation.surroundings import SurroundingsView
from lhdmap.simulation.vehicle.shaking import Shaking


class State(Protocol):
    """The true state of a machine at a moment (`VehicleState`), SI units."""

    @property
    def time_ns(self) -> int: ...
    @property
    def x_m(self) -> float: ...
    @property
    def y_m(self) -> float: ...
    @property
    def z_m(self) -> float: ...
    @property
    def roll_rad(self) -> float: ...
    @property
    def pitch_rad(self) -> float: ...
    @property
    def yaw_rad(self) -> float: ...
    @property
    def articulation_rad(self) -> float: ...
    @property
    def speed_mps(self) -> float: ...

    def row(self) -> FloatArray:
        """Return it as a row of a history, shape (20,)."""
        ...


class Vehicle(Protocol):
    """A machine that is stepped."""

    def step(self, state: Any, command: Command, dt_s: float) -> Any:
        """Return the state a moment later."""
        ...


class Touch(NamedTuple):
    """A body that touches something: its name, where (x, y, z) in `map`, and how deep it is in."""

    body: str
    point_m: Position
    depth_m: float


class Nearness(NamedTuple):
    """What the machine touches now, and how near its bodies come to walls (None: not looked at)."""

    touches: tuple[Touch, ...]
    clearance_m: float | None = None


class Bumper(Protocol):
    """Tells what a machine touches."""

    def touching(self, state: Any) -> Sequence[Touch]:
        """Return the bodies that are in a wall."""
        ...

    def clearance_m(self, state: Any) -> float:
        """Return the least distance of any body from a wall, metres."""
        ...


class Operator(Protocol):
    """A scripted driver who sees the truth."""

    @property
    def done(self) -> bool:
        """Whether the route has been driven."""
        ...

    def command(self, state: Any, now_ns: int) -> Command | None:
        """Return what is done at this moment; None: nothing new."""
        ...


class Changing(Protocol):
    """A world in which things come and go."""

    def appear(self, name: str, mesh: Mesh) -> None:
        """Put something into it."""
        ...

    def vanish(self, name: str) -> None:
        """Take it away again."""
        ...


class Loading(NamedTuple):
    """The way to the pile in `odom`, as it was taught, and the mode that the log tells."""

    way: Directive | None
    mode: ModeNow


class Autonomous(NamedTuple):
    """The map, about where on it the machine stands at first (4,: x, y, yaw, z), its errand, and the mode that the log tells."""

    known: KnownMap
    start: FloatArray | None
    errand: Errand
    mode: ModeNow


class Haulage(NamedTuple):
    """A surface site: what is known of it, where the machine is parked, half the width of a lane."""

    ground: SiteGround
    park: str
    half_lane_m: float


@dataclass(frozen=True, slots=True)
class Parts:
    """All that is simulated, and what is known of it beforehand.

    Attributes:
        machine: what the log says of it.
        world: what sensors see.
        vehicle: steps the state.
        start: its state at the start of the clock.
        sensors: without faults; where readings are due at the same time, those of the first come first.
        operator: who drives by hand; None: nobody does.
        bumper: what is touched.
        changing: the world again, where obstacles and persons can appear in it.
        places: points (x, y, z) by name, for faults that begin at one.
        goal_m: where the drive must end.
        lines_m: walls or centre lines (N, 3) to draw.
        expected_s: about how long it will take.
        shaking: vibration that the sensors feel.
        settings: of perception and control.
        loading: what a machine that loads is given; None: it does not.
        autonomous: what a machine that drives itself is given; None: nobody does, or the operator.
        haulage: what a machine on a surface site is given; None: it is in a mine.
        attendant: who attends the machine, at a console or a terminal; None: the script does.
        park: of a machine of a crew: where it stands at first, and goes when nothing is left.
        T_mine_map: where the map's frame began in the mine's grid (4,: x, y, z, yaw), for those who judge by the truth.
        crew: the parts of all machines by name, this one first; empty: there is one.
    """

    machine: Machine
    world: SurroundingsView
    vehicle: Vehicle
    start: State
    sensors: Sequence[Sensor]
    operator: Operator | None
    bumper: Bumper | None = None
    changing: Changing | None = None
    places: Mapping[str, Position] = field(default_factory=dict)
    goal_m: Position | None = None
    lines_m: Sequence[FloatArray] = ()
    expected_s: float | None = None
    shaking: Shaking | None = None
    settings: Settings = field(default_factory=Settings)
    loading: Loading | None = None
    autonomous: Autonomous | None = None
    haulage: Haulage | None = None
    attendant: Attendant | None = None
    crew: Mapping[str, Parts] = field(default_factory=dict)
    park: str = ""
    T_mine_map: FloatArray | None = None
