"""Where machines and pages meet: what each machine said last, who has the seat, what is commanded. No sockets here."""

from __future__ import annotations

import itertools
import json
import secrets
from collections import deque
from typing import Any, NamedTuple

from lhdmap.console.alarms import ASKS, STOPPED, WARNING, Alarms
from lhdmap.console.audit import Audit
from lhdmap.console.codec import encode, plain
from lhdmap.console.messages import ANSWER, COMMANDS, STOP, Asked, Beat, Command, Event, Message, Outcome, Status, Tick
from lhdmap.console.outbox import Outbox
from lhdmap.console.sessions import Seat
from lhdmap.console.settings import ConsoleSettings
from lhdmap.loading.assistance import ANSWERS

_EVENTS = 200


class Refused(Exception):  # said to a page, not raised to a user
    """A wish that nobody follows, and why."""


class Wish(NamedTuple):
    """What a page asks for."""

    page: str
    machine: str
    kind: str
    number: int = 0
    answer: str = ""


class ConsoleMachine:
    """A machine as the console knows it: `outbox` to it, None: not connected; the newest message of each kind."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.outbox: Outbox | None = None
        self.newest: dict[str, Message] = {}


class Room:
    """Belongs to one event loop. Times are seconds since 1970, told by who calls."""

    def __init__(self, settings: ConsoleSettings, audit: Audit) -> None:
        self.audit, self.seat, self.alarms = audit, Seat(), Alarms(settings)
        self.machines: dict[str, ConsoleMachine] = {}
        self._pages: dict[str, Outbox] = {}
        self._events: deque[str] = deque(maxlen=_EVENTS)
        self._numbers = itertools.count(1)
        self._run = secrets.token_hex(3)

    def page_comes(self, by: str, now_s: float) -> tuple[str, Outbox]:
        """Take a page in: its number, and where its messages wait, with all that is known."""
        page, outbox = secrets.token_hex(8), Outbox()
        self._pages[page] = outbox
        outbox.put(_text("you", page=page, name=by))
        for machine in self.machines.values():
            outbox.put(_text("machine", name=machine.name, connected=machine.outbox is not None))
            for message in machine.newest.values():
                outbox.put(_of(machine.name, message))
        for event in self._events:
            outbox.put(event)
        outbox.put(self._seat_text())
        outbox.put(self._alarms_text(now_s))
        return page, outbox

    def page_goes(self, page: str, now_s: float) -> None:
        """Forget a page; its seat is free."""
        self._pages.pop(page, None)
        self.leaves(page, now_s)

    def machine_comes(self, name: str, now_s: float) -> Outbox:
        """Take a machine in; one of the same name is replaced."""
        machine = self.machines.setdefault(name, ConsoleMachine(name))
        machine.outbox, machine.newest = Outbox(), {}
        self.alarms.clear("lost", name)
        self.audit.write(now_s, name, "connected")
        self._tell(_text("machine", name=name, connected=True))
        self._tell_alarms(now_s)
        return machine.outbox

    def machine_goes(self, name: str, outbox: Outbox, now_s: float) -> None:
        """Note that a machine is not connected any more."""
        machine = self.machines[name]
        if machine.outbox is not outbox:
            return  # it is here again already
        machine.outbox = None
        self.audit.write(now_s, name, "disconnected")
        self.alarms.raises("lost", STOPPED, name, "not connected any more", now_s)
        self._tell(_text("machine", name=name, connected=False))
        self._tell_alarms(now_s)

    def heard(self, name: str, message: Message, now_s: float) -> None:
        """Take what a machine says, and show it."""
        if isinstance(message, Event):
            self._events.append(_of(name, message))
        elif not isinstance(message, (Tick, Outcome)):
            self.machines[name].newest[type(message).__name__] = message
        if isinstance(message, Outcome):
            self.audit.write(now_s, name, "outcome", command=message.command, taken=message.taken, why=message.why)
        key = "" if isinstance(message, (Event, Outcome)) else f"{name}/{type(message).__name__}"
        self._tell(_of(name, message), key)
        if self._alarmed(name, message, now_s):
            self._tell_alarms(now_s)

    def beat(self, by: str, page: str, machine: str, number: int, now_s: float) -> bool:
        """Pass a sign of life on to its machine; False where the page has not the seat."""
        there = self.machines.get(machine)
        if not self.seat.holds(by, page) or there is None or there.outbox is None:
            return False
        self.seat.heard_s = now_s
        there.outbox.put(encode(Beat(number, by)), "beat")
        return True

    def takes(self, by: str, page: str, now_s: float) -> None:
        """Give a page the seat; raises Refused where another one has it."""
        if page not in self._pages:
            raise Refused("no such page")
        if not self.seat.take(by, page, now_s):
            raise Refused(f"{self.seat.by} operates")
        self.audit.write(now_s, by, "takes the seat")
        self._tell(self._seat_text())

    def leaves(self, page: str, now_s: float) -> None:
        """Free the seat, where this page has it."""
        by = self.seat.by
        if self.seat.leave(page):
            self.audit.write(now_s, by, "leaves the seat")
            self._tell(self._seat_text())

    def command(self, by: str, wish: Wish, now_s: float) -> Command:
        """Write a command into the audit, then send it; raises Refused where it is none that this page may give."""
        why = self._unfit(by, wish)
        if why:
            self.audit.write(now_s, by, "refused", **wish._asdict(), why=why)
            raise Refused(why)
        cause = f"stopped by {by}" if wish.kind == STOP else ""
        command = Command(f"{self._run}-{next(self._numbers)}", wish.kind, wish.number, wish.answer, by, cause)
        told = {key: value for key, value in command._asdict().items() if key not in ("by", "audit", "cause")}
        head = self.audit.write(now_s, by, "command", machine=wish.machine, **told)
        command = command._replace(audit=head)
        outbox = self.machines[wish.machine].outbox
        assert outbox is not None  # noqa: S101  # else the wish is unfit
        outbox.put(encode(command))
        return command

    def _unfit(self, by: str, wish: Wish) -> str:
        if not self.seat.holds(by, wish.page):
            return f"{self.seat.by or 'nobody'} operates"
        machine = self.machines.get(wish.machine)
        if machine is None or machine.outbox is None:
            return "no such machine is connected"
        if wish.kind not in COMMANDS:
            return f"kind: one of {', '.join(COMMANDS)} was wanted"
        if wish.kind != ANSWER:
            return "number and answer: none was wanted" if wish.number or wish.answer else ""
        asked = machine.newest.get(Asked.__name__)
        request = asked.request if isinstance(asked, Asked) else None
        if request is None or request.number != wish.number:
            return f"request {wish.number} is not open"
        return "" if wish.answer in ANSWERS else f"answer: one of {', '.join(ANSWERS)} was wanted"

    def _alarmed(self, name: str, message: Message, now_s: float) -> bool:
        """Raise and clear alarms; return whether there was something to."""
        if isinstance(message, Status):
            before = self.alarms.shown(now_s)
            if message.armed:
                self.alarms.clear("stopped", name)
            else:
                self.alarms.raises("stopped", STOPPED, name, f"stopped: {'; '.join(message.causes)}", now_s)
            return before != self.alarms.shown(now_s)
        if isinstance(message, Asked):
            self.alarms.clear("asks", name)
            if message.request is not None:
                self.alarms.raises("asks", ASKS, name, f"asks for help: {message.request.why}", now_s)
            return True
        if isinstance(message, Event) and message.grave:
            self.alarms.raises(f"{message.process}: {message.text}", WARNING, name, message.text, now_s)
            return True
        return False

    def _tell(self, text: str, key: str = "") -> None:
        for outbox in self._pages.values():
            outbox.put(text, key)

    def _tell_alarms(self, now_s: float) -> None:
        self._tell(self._alarms_text(now_s), "alarms")

    def _alarms_text(self, now_s: float) -> str:
        shown = [alarm._asdict() for alarm in self.alarms.shown(now_s)]
        return _text("alarms", alarms=shown, held_back=self.alarms.held_back)

    def _seat_text(self) -> str:
        return _text("seat", by=self.seat.by, page=self.seat.page)


def _of(machine: str, message: Message) -> str:
    return json.dumps({**plain(message), "machine": machine}, allow_nan=False, separators=(",", ":"))


def _text(kind: str, **more: Any) -> str:
    return json.dumps({"type": kind, **more}, allow_nan=False, separators=(",", ":"))
