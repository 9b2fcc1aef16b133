"""A world, a machine and an operator that are as simple as they can be: a flat floor between two walls, a unicycle."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from lhdmap.machine import Machine
from lhdmap.messages import Command, FloatArray, Text
from lhdmap.replay.faults import Position
from lhdmap.replay.journal import Scribe
from lhdmap.replay.parts import Parts, Touch
from lhdmap.replay.process import Outgoing, Process, Received
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.history import START_NS, Column
from lhdmap.simulation.raycast import Surface
from lhdmap.simulation.sensing.sections import ScannerSettings, SensorSettings
from lhdmap.simulation.sensing.suite import sensors_of

TOP_MPS = 24.0 / 3.6
SECOND_NS = 1_000_000_000


class Unicycle(NamedTuple):
    """A state that moves along its heading."""

    time_ns: int = START_NS
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0
    articulation_rad: float = 0.0
    speed_mps: float = 0.0

    def row(self) -> FloatArray:
        row = np.zeros(len(Column))
        row[Column.X], row[Column.Y], row[Column.YAW] = self.x_m, self.y_m, self.yaw_rad
        row[Column.SPEED] = row[Column.WHEEL_SPEED] = self.speed_mps
        return row


class UnicycleVehicle:
    """Has the commanded speed within 1 m/s², and turns as the steering rate says."""

    def step(self, state: Any, command: Command, dt_s: float) -> Unicycle:
        wanted = 0.0 if command.brake else command.propel * TOP_MPS
        limit = 3.0 * dt_s if command.brake else dt_s
        speed = state.speed_mps + min(max(wanted - state.speed_mps, -limit), limit)
        yaw = state.yaw_rad + command.steering_rate_rps * dt_s
        x, y = state.x_m + speed * dt_s * math.cos(yaw), state.y_m + speed * dt_s * math.sin(yaw)
        at_ns = state.time_ns + round(dt_s * SECOND_NS)
        return state._replace(time_ns=at_ns, x_m=x, y_m=y, yaw_rad=yaw, speed_mps=speed)


class Corridor:
    """Upright walls at ± `half_m`, with boxes on them so that scans tell the way along, and an end wall."""

    def __init__(self, half_m: float = 3.0, length_m: float = 80.0) -> None:
        self.half_m = half_m
        parts = [_box((-20.0, half_m, -1.0), (length_m, half_m + 0.3, 5.0))]
        parts += [_box((-20.0, -half_m - 0.3, -1.0), (length_m, -half_m, 5.0))]
        parts += [_box((length_m, -half_m, -1.0), (length_m + 0.3, half_m, 5.0))]
        for k in range(-4, int(length_m / 4.0)):
            at, side = 4.0 * k + 0.7 * (k % 3), half_m if k % 2 else -half_m
            parts.append(_box((at, side - 0.3, -1.0), (at + 0.8, side + 0.3, 5.0)))
        self._base, self.appeared = parts, {}  # type: list[Mesh], dict[str, Mesh]
        self._surface: Surface | None = None

    def dust(self, position_m: FloatArray) -> float:
        """Return that none hangs anywhere."""
        return 0.0

    def near(self, position_m: FloatArray) -> Surface:
        if self._surface is None:
            self._surface = Surface(_together([*self._base, *self.appeared.values()]))
        return self._surface

    def appear(self, name: str, mesh: Mesh) -> None:
        self.appeared[name], self._surface = mesh, None

    def vanish(self, name: str) -> None:
        del self.appeared[name]
        self._surface = None


@dataclass
class SideBumper:
    """Touches where the machine's middle is nearer to a wall than half its width."""

    half_m: float = 3.0
    width_m: float = 2.45

    def clearance_m(self, state: Any) -> float:
        return max(self.half_m - abs(state.y_m) - 0.5 * self.width_m, 0.0)

    def touching(self, state: Any) -> Sequence[Touch]:
        depth_m = abs(state.y_m) + 0.5 * self.width_m - self.half_m
        side = math.copysign(self.half_m, state.y_m)
        return [Touch("front_frame", (state.x_m, side, 1.0), depth_m)] if depth_m > 0.0 else []


@dataclass
class Straight:
    """Drives `way_m` straight on at `speed_mps`, and stops; `stops` are rests of 2 s on the way."""

    way_m: float = 20.0
    speed_mps: float = 2.0
    steering_rps: float = 0.0
    rests_m: list[float] = field(default_factory=list)
    done: bool = False
    _rest_until_ns: int = 0

    def command(self, state: Any, now_ns: int) -> Command:
        if self.rests_m and state.x_m > self.rests_m[0]:
            self.rests_m.pop(0)
            self._rest_until_ns = now_ns + 4 * SECOND_NS
        self.done = self.done or state.x_m >= self.way_m - state.speed_mps**2 / 6.0
        halts = self.done or now_ns < self._rest_until_ns
        propel = 0.0 if halts else self.speed_mps / TOP_MPS
        return Command(now_ns, propel, 0.0 if halts else self.steering_rps, 0.0, 0.0, False, halts)


def parts(
    operator: Any = None,
    *,
    world: Corridor | None = None,
    scans: bool = True,
    places: dict[str, Position] | None = None,
) -> Parts:
    """Return a machine in the corridor; without `scans` there are no scanners, which is quick."""
    world, machine = world or Corridor(), Machine()
    settings = SensorSettings(scanner=ScannerSettings(rear=False))
    sensors = sensors_of(machine, settings, seed=5)
    kept = [one for one in sensors if scans or not one.topic.startswith("/lidar")]
    return Parts(
        machine, world, UnicycleVehicle(), Unicycle(), kept, operator or Straight(), SideBumper(world.half_m), world,
        places or {},
    )  # fmt: skip


class Ticker(Process):
    """Says a number at each turn, and notes when it had turns and what came."""

    def __init__(self, name: str, period_ms: float = 20.0, topic: str = "", **more: Any) -> None:
        self.name, self.period_ns, self._topic = name, round(period_ms * 1e6), topic
        for key, value in more.items():
            setattr(self, key, value)
        self.turns: list[int] = []
        self.got: list[tuple[int, Received]] = []
        self.on_turn: Callable[[int], None] = lambda now_ns: None

    def step(self, now_ns: int, inbox: Sequence[Received]) -> list[Outgoing]:
        self.turns.append(now_ns)
        self.got += [(now_ns, one) for one in inbox]
        self.on_turn(now_ns)
        return [Outgoing(self._topic, Text(now_ns, str(len(self.turns))))] if self._topic else []


def texts(ticker: Ticker) -> list[str]:
    """Return what a ticker has got."""
    return [one.message.text for _, one in ticker.got]


def _box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    faces = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    triangles = [half for a, b, c, d in faces for half in ((a, b, c), (a, c, d))]
    return Mesh(corners, np.array(triangles, dtype=np.uint32))


def _together(meshes: Sequence[Mesh]) -> Mesh:
    offsets = np.cumsum([0, *(len(one.vertices_m) for one in meshes[:-1])])
    triangles = [one.triangles + np.uint32(offset) for one, offset in zip(meshes, offsets, strict=True)]
    return Mesh(np.concatenate([one.vertices_m for one in meshes]), np.concatenate(triangles))


class Blind(Process):
    """Drives by what it is told about itself alone: the speed falls with the way that perception believes in."""

    name, period_ns, priority, reads = "autonomy", 50_000_000, 30, ("/perception/pose", "/machine/tachometer")

    def __init__(self, scribe: Scribe) -> None:
        self._scribe, self.poses, self._x_m = scribe, 0, 0.0

    def step(self, now_ns: int, inbox: Sequence[Received]) -> list[Outgoing]:
        for topic, _, message in inbox:
            if topic == "/perception/pose":
                self.poses += 1
                self._x_m = float(message.T_odom_base[0, 3])
        self._scribe.goes(f"at {math.floor(self._x_m)} m", "pose", x_m=self._x_m)
        propel = max(2.0 - 0.2 * self._x_m, 0.3) / TOP_MPS
        return [Outgoing("/machine/command", Command(now_ns, propel, 0.0, 0.0, 0.0, False, False))]
