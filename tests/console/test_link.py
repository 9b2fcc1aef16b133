"""The machine's end of the link, without a socket: what it commands itself when its operator falls silent."""

from __future__ import annotations

from lhdmap.console.link import MachineLink
from lhdmap.console.messages import ANSWER, REARM, STOP, Beat, Command, Outcome, Status, Tick
from lhdmap.console.settings import ConsoleSettings
from lhdmap.replay.faults import Faults
from lhdmap.replay.journal import Journal
from lhdmap.replay.link import ConsoleRadio, Link, LinkSettings
from lhdmap.simulation.sensing.faults import FaultSettings

MS = 1_000_000
ARMED, DISARMED = (Status(0.0, armed, "autonomous", True) for armed in (True, False))


class Rig:
    """A link on a clock of its own, and a page that answers while `alive`."""

    def __init__(self, speed: float = 0.0) -> None:
        self.now_ns, self.alive, self.slept_s = 0, True, 0.0
        self.outcomes: list[Outcome] = []
        self.link = MachineLink(
            "one", "http://127.0.0.1:1", "key", ConsoleSettings(), speed, lambda: self.now_ns, self.sleep
        )
        self.link.told = self.outcomes.append  # type: ignore[method-assign, assignment]

    def sleep(self, for_s: float) -> None:
        self.slept_s += for_s
        self.now_ns += round(for_s * 1e9)

    def go(self, for_ms: int, status: Status) -> list[tuple[int, Command]]:
        """Run turns of 20 ms; return commands with the clock's time, ms."""
        found = []
        for _ in range(for_ms // 20):
            self.now_ns += 20 * MS
            if self.now_ns % (100 * MS) == 0:
                tick: Tick = self.link._tick()
                if self.alive:
                    self.link._heard(Beat(tick.number, "anna"))
            found += [(self.now_ns // MS, command) for command in self.link.attend(self.now_ns, status, None)]
        return found


def test_an_armed_machine_stops_once_when_the_page_falls_silent_and_never_arms_itself() -> None:
    rig = Rig()
    assert rig.go(500, DISARMED) + rig.go(500, ARMED) == []
    rig.alive = False
    ((at_ms, stop),) = rig.go(3000, ARMED)
    assert 1400 <= at_ms <= 1500
    assert (stop.kind, stop.by) == (STOP, "watch")
    rig.alive = True
    assert rig.go(5000, DISARMED) == []


def test_it_stops_again_after_it_was_armed_again() -> None:
    rig = Rig()
    rig.go(1000, DISARMED)
    for _ in range(2):
        rig.alive = False
        assert [command.kind for _, command in rig.go(1000, ARMED)] == [STOP]
        rig.alive = True
        assert rig.go(1000, DISARMED) + rig.go(1000, ARMED) == []


def test_an_armed_machine_without_an_operator_stops_at_once() -> None:
    ((at_ms, stop),) = Rig().go(1000, ARMED)
    assert (at_ms, stop.cause) == (20, "no operator")


def test_a_machine_that_is_not_armed_has_nothing_to_stop_for() -> None:
    rig = Rig()
    rig.go(1000, DISARMED)
    rig.alive = False
    assert rig.go(3000, DISARMED) == []


def test_nothing_is_armed_for_an_operator_who_is_silent() -> None:
    rig = Rig()
    rig.go(1000, DISARMED)
    rig.alive = False
    rig.go(1000, DISARMED)
    rig.link._heard(Command("1", REARM, by="anna"))
    assert rig.go(20, DISARMED) == []
    assert not rig.outcomes[0].taken
    assert "silent" in rig.outcomes[0].why


def test_a_command_that_waited_is_not_followed_but_a_stop_is() -> None:
    rig = Rig()
    rig.go(1000, DISARMED)
    for number, kind in enumerate((REARM, ANSWER, STOP)):
        rig.link._heard(Command(str(number), kind, by="anna"))
    rig.now_ns += 1001 * MS
    assert [command.kind for _, command in rig.go(20, DISARMED)] == [STOP]
    assert [outcome.why for outcome in rig.outcomes] == ["too late: the machine was not ready"] * 2


def test_a_fresh_command_is_given_once() -> None:
    rig = Rig()
    rig.go(1000, DISARMED)
    rig.link._heard(Command("1", REARM, by="anna", audit="ab"))
    assert [command.id for _, command in rig.go(1000, DISARMED)] == ["1"]


def test_the_machines_time_waits_for_the_clock_and_does_not_race_after_it() -> None:
    rig = Rig(speed=2.0)
    for k in range(51):
        rig.link.attend(k * 20 * MS, DISARMED, None)
    assert rig.now_ns == 500 * MS
    rig.now_ns += 3000 * MS  # something took long
    slept_s = rig.slept_s
    for k in range(51, 102):
        rig.link.attend(k * 20 * MS, DISARMED, None)
    assert rig.slept_s - slept_s > 0.45


def rig_on(settings: LinkSettings) -> tuple[Rig, Faults]:
    """Return a rig whose link is that of a scenario."""
    rig, faults = Rig(), Faults((), Journal())
    rig.link.crosses(ConsoleRadio(settings, faults, 1, Link(settings, faults, 1)))
    return rig, faults


def test_the_link_of_a_scenario_delays_the_sign_of_life_both_ways() -> None:
    rig, _ = rig_on(LinkSettings(delay_s=0.05))
    assert rig.go(2000, DISARMED) + rig.go(4000, ARMED) == []
    assert 0.05 < rig.link._watch.round_trip_s < 0.15
    slow, _ = rig_on(LinkSettings(delay_s=0.2))
    slow.go(2000, DISARMED)
    ((_, stop),) = slow.go(1000, ARMED)
    assert stop.cause.startswith(("round trip", "operator's page silent"))


def test_a_link_that_a_scenario_loses_stops_an_armed_machine_within_the_limit() -> None:
    rig, faults = rig_on(LinkSettings(delay_s=0.0))
    assert rig.go(1000, DISARMED) + rig.go(1000, ARMED) == []
    lost = faults.inject(FaultSettings(kind="link_lost", target="link"), rig.now_ns)
    rig.link._heard(Command("1", REARM, by="anna"))
    ((at_ms, stop),) = rig.go(2000, ARMED)
    assert 2300 <= at_ms <= 2500
    assert "silent" in stop.cause
    faults.active.remove(lost)
    assert rig.go(1000, DISARMED) == []
    assert [one.why for one in rig.outcomes] == ["too late: the machine was not ready"]
