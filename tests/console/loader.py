"""A machine in a thread: the executor's own watchdog behind the machine's end of the link."""

from __future__ import annotations

import threading
import time
from types import TracebackType
from typing import Self

from lhdmap.console.link import MachineLink
from lhdmap.console.messages import ANSWER, REARM, Ask, Command, Event, Outcome, Plan, Status
from lhdmap.console.settings import ConsoleSettings
from lhdmap.executor.settings import ExecutorSettings
from lhdmap.executor.watchdog import Watchdog

PLAN = Plan("map", (((0.0, 0.0), (30.0, 2.0), (60.0, 0.0)),), (("DP1", 60.0, 0.0),))


class Loader:
    """Turns of 20 ms; `request` is what it asks, `commands` what it was told, `stopped_s` when it stopped (monotonic)."""

    def __init__(self, url: str, key: str, settings: ConsoleSettings, name: str = "loader") -> None:
        self.link = MachineLink(name, url, key, settings, speed=0.0)
        self.watchdog = Watchdog({}, ExecutorSettings())
        self.request: Ask | None = None
        self.commands: list[Command] = []
        self.stopped_s = 0.0
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, name="loader", daemon=True)

    def __enter__(self) -> Self:
        self.link.connect()
        self.link.shows(PLAN)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ends.set()
        self._thread.join(5.0)
        self.link.close()

    def wait(self, *, armed: bool, for_s: float = 5.0) -> None:
        until = time.monotonic() + for_s
        while self.watchdog.armed != armed:
            assert time.monotonic() < until, f"armed: {self.watchdog.armed}, {self.watchdog.causes}"
            time.sleep(0.005)

    def _run(self) -> None:
        begun_s = time.monotonic()
        while not self._ends.wait(0.02):
            at_s = time.monotonic() - begun_s
            armed, causes = self.watchdog.armed, self.watchdog.causes
            pose = (10.0 + (2.0 * at_s) % 40.0, 0.5, 0.05)
            status = Status(at_s, armed, "autonomous", True, causes, "driving", "positioning", pose)
            for command in self.link.attend(time.monotonic_ns(), status, self.request):
                self._obey(command, at_s)

    def _obey(self, command: Command, at_s: float) -> None:
        self.commands.append(command)
        self.link.told(Outcome(command.id, True))
        if command.kind == ANSWER:
            self.request = None
        elif command.kind == REARM:
            self.watchdog.rearm(time.monotonic_ns(), ())
        else:
            self.watchdog.trip((command.cause,))
            self.stopped_s = time.monotonic()
            self.link.notes(Event(at_s, "executor", f"disarmed: {command.cause}", grave=True))
