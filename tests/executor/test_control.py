"""All together: faults in any order never move the machine on stale data, nor without being armed again."""

from __future__ import annotations

import math

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from lhdmap.driving.model import drive_model
from lhdmap.executor.modes import MODES
from lhdmap.machine import Machine

from tests.executor.rig import INPUTS, MS, PERIOD_MS, Rig, ahead


def started(mode: str = "autonomous", seconds: float = 4.0) -> Rig:
    rig = Rig()
    rig.run(0.5)
    assert rig.control.rearm(rig.now_ns, mode) == ()
    assert rig.control.mode(mode, rig.now_ns)
    rig.run(seconds)
    return rig


@pytest.mark.parametrize("mode", ["autonomous", "assisted", "teleoperated", "manual"])
def test_each_mode_drives_with_its_own_source(mode: str) -> None:
    rig = started(mode)
    assert rig.speed == pytest.approx(2.0, abs=0.2)
    if MODES[mode].source == "guidance":
        rig.plans = False
    else:
        rig.operates = False
    rig.run(5.0)
    assert rig.speed == 0.0


def test_nothing_moves_before_it_is_armed_and_a_mode_is_chosen() -> None:
    rig = Rig()
    rig.run(1.0)
    assert not rig.control.mode("autonomous", rig.now_ns)
    rig.run(1.0)
    assert rig.control.rearm(rig.now_ns) == ()
    rig.run(1.0)
    assert rig.x_m == 0.0
    assert rig.control.mode("autonomous", rig.now_ns)
    rig.run(1.0)
    assert rig.x_m > 0.0


@pytest.mark.parametrize("name", ["motion", "scan_front", "pose"])
def test_braking_begins_within_a_period_of_the_limit(name: str) -> None:
    rig = started()
    rig.failed.add(name)
    last_ms = rig.seen[name]
    while not rig.command.brake:
        rig.tick()
    assert rig.now_ms - last_ms in (300, 300 + PERIOD_MS)
    rig.failed.clear()
    rig.run(5.0)
    assert rig.speed == 0.0  # recovered, and still it stands
    where_m = rig.x_m
    assert rig.control.rearm(rig.now_ns) == ()
    rig.run(2.0)
    assert rig.x_m > where_m + 0.5


def test_a_mode_change_empties_the_queue_and_waits_for_its_own_plans() -> None:
    rig = started()
    rig.operates = False
    assert rig.control.mode("teleoperated", rig.now_ns)
    rig.tick()
    assert rig.command.brake
    rig.run(4.0)
    assert rig.speed == 0.0
    rig.operates = True
    rig.run(2.0)
    assert rig.speed > 0.5
    assert rig.control.mode("idle", rig.now_ns)
    rig.run(4.0)
    assert rig.speed == 0.0
    changes = [note for who, note in rig.control.take_notes() if who == "modes"]
    assert [(one.before, one.after) for one in changes] == [
        ("idle", "autonomous"),
        ("autonomous", "teleoperated"),
        ("teleoperated", "idle"),
    ]


def test_plans_made_before_the_change_or_of_old_data_do_not_count() -> None:
    rig = started()
    rig.plans = rig.operates = False
    rig.control.mode("idle", rig.now_ns)
    rig.run(4.0)
    rig.control.mode("autonomous", rig.now_ns)
    now = rig.now_ns
    assert not rig.control.plan("guidance", ahead(1.0, now), now - 20 * MS, now)
    assert not rig.control.plan("operator", ahead(1.0, now), now, now)
    rig.run(0.5)
    now = rig.now_ns
    assert not rig.control.plan("guidance", ahead(1.0, now), now - 310 * MS, now)
    assert rig.control.plan("guidance", ahead(1.0, now), now - 20 * MS, now)


def test_a_mode_whose_inputs_are_not_there_is_refused() -> None:
    rig = started("manual")
    rig.failed.add("pose")
    rig.run(1.0)
    assert not rig.control.mode("autonomous", rig.now_ns)
    assert rig.control.modes.name == "manual"
    assert not rig.control.mode("sideways", rig.now_ns)
    causes = [note.cause for who, note in rig.control.take_notes() if who == "modes"]
    assert any("pose" in cause for cause in causes)
    assert any("unknown" in cause for cause in causes)


def test_an_emergency_stop_needs_release_and_arming() -> None:
    rig = started()
    rig.control.emergency("button")
    rig.tick()
    assert rig.command.brake
    assert not rig.control.release("too early")
    rig.run(3.0)
    assert rig.control.rearm(rig.now_ns) == ("emergency stop: button",)
    assert rig.control.release("operator")
    rig.run(1.0)
    assert rig.speed == 0.0
    assert rig.control.rearm(rig.now_ns) == ()
    rig.run(2.0)
    assert rig.speed > 0.5


def test_the_guard_stops_before_a_thing_that_appears_and_lets_it_back_away() -> None:
    rig = started()
    rig.thing_m = rig.x_m + 3.2 + 3.5
    rig.run(5.0)
    assert rig.x_m + 3.2 < rig.thing_m
    assert abs(rig.speed) < 0.5
    where_m = rig.x_m
    rig.speed_wanted = -1.0
    rig.run(4.0)
    assert rig.x_m < where_m - 1.0
    assert any(who == "guard" and note.after == "blocked" for who, note in rig.control.take_notes())


def test_an_operator_does_not_pass_the_guard_either() -> None:
    rig = started("teleoperated")
    rig.thing_m = rig.x_m + 3.2 + 3.5
    rig.run(6.0)
    assert rig.x_m + 3.2 < rig.thing_m


def test_a_loaded_machine_is_braked_for_earlier() -> None:
    """The model of the load is that of bound and guard alike."""
    rig = started()
    rig.control.loaded(drive_model(Machine(), 11_000.0))
    rig.run(0.1)
    loaded = rig.control.watch.swept
    rig.control.loaded(drive_model(Machine()))
    rig.run(0.1)
    empty = rig.control.watch.swept
    assert loaded is not None
    assert empty is not None
    assert loaded.stop_m > 1.1 * empty.stop_m


class Faults(RuleBasedStateMachine):
    """Any faults in any order; what must hold is looked at in each period."""

    def __init__(self) -> None:
        super().__init__()
        self.rig = Rig()
        self.allowed = False  # to move: armed by hand since the last trip

    @initialize(arm=st.booleans(), mode=st.sampled_from(sorted(MODES)))
    def start(self, arm: bool, mode: str) -> None:
        self.go(0.3)
        if arm:
            self.arm()
        self.rig.control.mode(mode, self.rig.now_ns)
        self.go(2.0)

    @rule(name=st.sampled_from([*INPUTS, "guidance"]), seconds=st.sampled_from([0.05, 0.2, 0.5, 1.5, 3.0]))
    def fails_for_a_while(self, name: str, seconds: float) -> None:
        self.rig.failed.add(name)
        self.go(seconds)
        self.rig.failed.discard(name)
        self.go(0.1)

    @rule(name=st.sampled_from([*INPUTS, "guidance"]))
    def fails(self, name: str) -> None:
        self.rig.failed.add(name)

    @rule()
    def all_recover(self) -> None:
        self.rig.failed.clear()

    @rule(apart=st.sampled_from([0.0, 0.1, 0.3, 2.0]))
    def pose_jumps(self, apart: float) -> None:
        self.rig.apart_m = apart
        self.go(0.1)

    @rule(name=st.sampled_from(sorted(INPUTS)), late_ms=st.integers(-2000, 2000), broken=st.booleans())
    def nonsense_arrives(self, name: str, late_ms: int, broken: bool) -> None:
        rig = self.rig
        stamp = rig.now_ns - late_ms * MS
        if rig.control.saw(name, stamp, rig.now_ns, (math.nan,) if broken else ()):
            rig.seen[name] = stamp // MS

    @rule(speed=st.sampled_from([-3.0, 0.0, 2.0, 5.0]))
    def another_speed(self, speed: float) -> None:
        self.rig.speed_wanted = speed

    @rule(seconds=st.sampled_from([0.1, 1.0, 3.0]))
    def time_passes(self, seconds: float) -> None:
        self.go(seconds)

    @rule(mode=st.sampled_from(sorted(MODES)))
    def mode_changes(self, mode: str) -> None:
        self.rig.control.mode(mode, self.rig.now_ns)

    @rule()
    def emergency(self) -> None:
        self.rig.control.emergency("button")
        self.allowed = False
        self.go(0.02)

    @rule()
    def release(self) -> None:
        self.rig.control.release("operator")

    @rule()
    def arm(self) -> None:
        if self.rig.control.rearm(self.rig.now_ns) == ():
            self.allowed = True

    @invariant()
    def nothing_is_pending(self) -> None:
        assert abs(self.rig.speed) < 5.1

    def go(self, seconds: float) -> None:
        for _ in range(round(seconds * 1e3 / PERIOD_MS)):
            self.rig.tick()
            self.look()

    def look(self) -> None:
        rig, control = self.rig, self.rig.control
        if not control.watchdog.armed:
            self.allowed = False
        command, needs = rig.command, MODES[control.modes.name].needs
        moves = command.propel != 0.0 or not command.brake
        if moves:
            assert self.allowed
            assert not control.executor.emergency
            assert control.modes.name != "idle"
            for name in set(needs) & set(INPUTS) - {"link"}:
                assert rig.now_ms - rig.seen[name] <= 300 + PERIOD_MS, name
            if "link" in needs:
                assert rig.now_ms - rig.seen["link"] <= 2000 + PERIOD_MS


Faults.TestCase.settings = settings(max_examples=100, stateful_step_count=12, deadline=None)
TestFaults = Faults.TestCase
