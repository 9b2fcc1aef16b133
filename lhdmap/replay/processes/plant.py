"""The simulator as a process: steps the machine, reads its sensors as they become due, looks at what it touches."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from lhdmap.errors import ConfigError
from lhdmap.messages import Command
from lhdmap.replay.faults import THINGS, Fault, Faults, Position
from lhdmap.replay.journal import Scribe
from lhdmap.replay.link import Link
from lhdmap.replay.parts import Nearness, Parts, Touch
from lhdmap.replay.process import CONTACT, MACHINE, MILLISECOND_NS, STATE, Outgoing, Process, Received
from lhdmap.replay.things import thing_at
from lhdmap.roles import ROLES
from lhdmap.simulation.history import SECOND_NS, START_NS, History
from lhdmap.simulation.sensing.faults import with_faults
from lhdmap.simulation.sensing.sensor import Due

PLANT = "plant"
STEP_NS = 10 * MILLISECOND_NS
COMMAND = ROLES["command"].topic
COMMAND_LIMIT_NS = 500 * MILLISECOND_NS
"""Without a command for so long the machine's own controller brakes."""
_LOOK_STEPS = 10  # how often the clearance is taken
_AHEAD_M = 12.0  # where a thing appears that has no place


class _Heard:
    """The newest command and when it came; `stuck`: whether the steering does not do what it says."""

    def __init__(self) -> None:
        self.command: Command | None = None
        self.at_ns = START_NS
        self.stuck = False


class Plant(Process):
    """A turn takes the machine from now to 10 ms later; what its sensors have complete by then appears at its own time."""

    name, period_ns, priority, site = PLANT, STEP_NS, 0, MACHINE
    reads = (COMMAND,)

    def __init__(self, parts: Parts, faults: Faults, link: Link | None, scribe: Scribe, seed: int) -> None:
        """Raises ConfigError where a fault asks for what sensors or world do not have."""
        self._parts, self._faults, self._link, self._scribe, self._seed = parts, faults, link, scribe, seed
        self.history = History(SECOND_NS // STEP_NS)
        self._state = parts.start
        _check(faults, parts)
        by_time = [one.settings for one in faults.all if one.settings.of_sensor and one.known_time]
        self._sensors = with_faults(parts.sensors, by_time, seed=seed)
        self._due = Due(self._sensors)
        self._heard = _Heard()
        self._steps = 0
        self._touches: tuple[Touch, ...] = ()
        faults.watchers.append(self._on_fault)

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Take the newest command and step."""
        for received in inbox:
            self._heard.command, self._heard.at_ns = received.message, now_ns
        if self._steps == 0:
            yield from self._seen(now_ns)
        self._steps += 1
        self._state = self._parts.vehicle.step(self._state, self._acted_on(now_ns), STEP_NS / SECOND_NS)
        yield from self._seen(now_ns + STEP_NS)
        if self._faults.waits_for_places:
            self._faults.reached(self._position(), now_ns)

    def _seen(self, at_ns: int) -> Iterator[Outgoing]:
        """Yield what there is to see of the state at a time: the truth, and readings that are complete by then."""
        state = self._state
        row, shaking = state.row(), self._parts.shaking
        self.history.append(row if shaking is None else shaking.onto(row, (at_ns - START_NS) / SECOND_NS))
        yield Outgoing(STATE, state, at_ns)
        for record in self._due.read(self.history, self._parts.world):
            yield Outgoing(record.topic, record.message, record.log_time_ns)
        if self._link is not None:
            self._link.position_m = self._position()
        if self._parts.bumper is not None:
            touches = tuple(self._parts.bumper.touching(state))
            looks = self._steps % _LOOK_STEPS == 0
            if looks or touches != self._touches:
                self._touches = touches
                clearance_m = self._parts.bumper.clearance_m(state) if looks else None
                yield Outgoing(CONTACT, Nearness(touches, clearance_m), at_ns)

    def _acted_on(self, now_ns: int) -> Command:
        """Return what the machine does: the command, less what is broken; without one for long it brakes."""
        command = self._heard.command
        if command is None or now_ns - self._heard.at_ns > COMMAND_LIMIT_NS:
            self._scribe.goes("braking", "no command")
            return Command(now_ns, 0.0, 0.0, 0.0, 0.0, False, True)
        self._scribe.goes("commanded", "command")
        return command._replace(steering_rate_rps=0.0) if self._heard.stuck else command

    def _position(self) -> Position:
        return self._state.x_m, self._state.y_m, self._state.z_m

    def _on_fault(self, fault: Fault, begins: bool) -> None:
        kind = fault.settings.kind
        if kind == "steering_stuck":
            self._heard.stuck = begins
        elif kind in THINGS and self._parts.changing is not None:
            name = f"{kind} {fault.number}"
            if begins:
                place_m = self._ahead() if fault.place_m is None else fault.place_m
                self._parts.changing.appear(name, thing_at(fault.settings, place_m))
            else:
                self._parts.changing.vanish(name)
        elif fault.settings.of_sensor and not fault.known_time and begins and fault.began_ns is not None:
            one = replace(fault.settings, at="", at_s=(fault.began_ns - START_NS) / SECOND_NS)
            self._sensors = with_faults(self._sensors, [one], seed=self._seed + fault.number)
            self._due = Due(self._sensors)

    def _ahead(self) -> Position:
        x, y, z = self._position()
        yaw = self._state.yaw_rad
        return x + _AHEAD_M * math.cos(yaw), y + _AHEAD_M * math.sin(yaw), z


def _check(faults: Faults, parts: Parts) -> None:
    """Refuse what cannot happen here, before anything does."""
    of_sensors = [replace(one.settings, at="") for one in faults.all if one.settings.of_sensor]
    with_faults(parts.sensors, of_sensors, seed=0)
    for one in faults.all:
        if one.settings.kind in THINGS and parts.changing is None:
            raise ConfigError(f"[[fault]] {one.number}: kind = '{one.settings.kind}': nothing can appear in this world")
