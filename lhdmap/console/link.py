"""The machine's end of the link to a console: an attendant whose commands come over a WebSocket, and who may fall silent."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence

from lhdmap.console.client import Address, Client
from lhdmap.console.crossing import Crossing, Radio
from lhdmap.console.messages import REARM, STOP, Ask, Asked, Beat, Command, Event, Message, Outcome, Plan, Status, Tick
from lhdmap.console.settings import ConsoleSettings
from lhdmap.console.watch import Watch
from lhdmap.errors import InputError

_STATUS_NS = 100_000_000
_LAG_NS = 200_000_000  # a replay that is later than this goes on from now: it does not race to catch up
_KEPT = 200
_FRESH_NS = 1_000_000_000  # what was wanted before that may not be wanted any more
Clock = Callable[[], int]
WATCH = "watch"
"""Who stops a machine whose operator is gone."""


class MachineLink:
    """Ticks and answers run in a thread of their own; what is asked of the machine is taken in its own turns.

    The stop is decided here, on the machine: an armed machine whose operator's page is silent gets a command to stop, once. Arming
    is refused while the page is silent. `speed`: how much faster than real time a replay runs; 0: nobody waits (a live machine).
    """

    def __init__(self, machine: str, url: str, key: str, settings: ConsoleSettings, speed: float = 1.0,
                 clock: Clock = time.monotonic_ns, sleep: Callable[[float], None] = time.sleep) -> None:  # fmt: skip
        self._speed, self._clock, self._sleep = speed, clock, sleep
        self._watch = Watch(settings)
        self._lock = threading.Lock()
        self._commands: deque[tuple[Command, int]] = deque(maxlen=_KEPT)
        self._begun: tuple[int, int] | None = None
        self._stopped, self._shown_ns = False, 0
        self._asked: Ask | None = None
        self._crossing: Crossing | None = None
        self._client = Client(Address(url, machine, key), self._heard, self._tick, settings.tick_s)

    def connect(self, patience_s: float = 10.0) -> None:
        """Begin; raises InputError where no console answers."""
        self._client.start()
        if not self._client.connected.wait(patience_s):
            self.close()
            why = self._client.why or "nobody answers"
            raise InputError(f"console at {self._client.address.url}: {why}; `lhdmap console` starts one")

    def wait_for_operator(self) -> str:
        """Wait until an operator's page answers; return who he is."""
        while self.fault():
            self._sleep(0.05)
        return self._watch.by

    def fault(self) -> str:
        """Return why the machine must not be driven under this operator now; empty: it may."""
        with self._lock:
            now_ns = self._clock()
            if self._crossing is not None:
                for message, at_ns in self._crossing.arrived(now_ns):
                    self._take(message, at_ns)
            return self._watch.fault(now_ns)

    def crosses(self, radio: Radio) -> None:
        """Have all that is said and heard cross a link that is simulated besides the real one."""
        with self._lock:
            self._crossing = Crossing(radio, self._speed)

    def shows(self, plan: Plan) -> None:
        """Take what the machine is drawn on."""
        self._say(plan, "plan")

    def notes(self, event: Event) -> None:
        """Take something that happened."""
        self._say(event)

    def told(self, outcome: Outcome) -> None:
        """Take what became of a command."""
        self._say(outcome)

    def attend(self, now_ns: int, status: Status, request: Ask | None) -> Sequence[Command]:
        """Return what has been commanded, and a stop where the operator of an armed machine is silent."""
        self._pace(now_ns)
        if self._crossing is not None:
            self._crossing.machine_ns = now_ns
        self._show(status, request)
        fault = self.fault()
        commands = [command for command, told_ns in self._taken() if self._counts(command, told_ns, fault)]
        if not status.armed:
            self._stopped = False
        elif fault and not self._stopped:
            self._stopped = True
            commands.append(Command(f"{WATCH}-{now_ns}", STOP, by=WATCH, cause=fault))
        return commands

    def close(self) -> None:
        """End the thread."""
        self._client.close()

    def _taken(self) -> list[tuple[Command, int]]:
        with self._lock:
            found, self._commands = list(self._commands), deque(maxlen=_KEPT)
        return found

    def _counts(self, command: Command, told_ns: int, fault: str) -> bool:
        """Return whether a command counts: a stop always, others while they are fresh; nothing is armed for who is silent."""
        late = self._clock() - told_ns > _FRESH_NS
        why = "" if command.kind == STOP else "too late: the machine was not ready" if late else ""
        why = why or (fault if command.kind == REARM else "")
        if why:
            self.told(Outcome(command.id, False, why))
        return not why

    def _show(self, status: Status, request: Ask | None) -> None:
        if request is not self._asked:
            self._asked = request
            self._say(Asked(request), "asked")
        now_ns = self._clock()
        if now_ns - self._shown_ns >= _STATUS_NS:
            self._shown_ns = now_ns
            self._say(status, "status")
        if self._crossing is not None:
            for message, key in self._crossing.sent():
                self._client.send(message, key)

    def _say(self, message: Message, key: str = "") -> None:
        if self._crossing is None:
            self._client.send(message, key)
        else:
            self._crossing.says(message, key)

    def _pace(self, now_ns: int) -> None:
        """Wait until the machine's time is the clock's."""
        if not self._speed:
            return
        clock_ns = self._clock()
        if self._begun is None:
            self._begun = now_ns, clock_ns
        due_ns = self._begun[1] + round((now_ns - self._begun[0]) / self._speed)
        if due_ns > clock_ns:
            self._sleep((due_ns - clock_ns) * 1e-9)
        elif clock_ns - due_ns > _LAG_NS:
            self._begun = now_ns, clock_ns

    def _tick(self) -> Tick:
        with self._lock:
            number = self._watch.tick(self._clock())
            return Tick(number, self._watch.round_trip_s, self._watch.latency_limit_s)

    def _heard(self, message: Message) -> None:
        """Take a message of the console; called in the link's thread."""
        with self._lock:
            if self._crossing is None:
                self._take(message, self._clock())
            else:
                self._crossing.heard(message, self._clock())

    def _take(self, message: Message, at_ns: int) -> None:
        if isinstance(message, Beat):
            self._watch.answered(message.number, message.by, at_ns)
        elif isinstance(message, Command):
            self._commands.append((message, at_ns))
