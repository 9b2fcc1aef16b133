"""Section control: never two in one section, never stuck, fair; exact against a search that knows nothing of it."""

from __future__ import annotations

import itertools
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.errors import InputError, UsageError
from lhdmap.traffic.claims import Claims, Joint
from lhdmap.traffic.control import TrafficControl
from lhdmap.traffic.explore import explore
from lhdmap.traffic.sections import Cycle, Haul, Leg, named
from lhdmap.traffic.simulation import Chance, simulate

from tests.traffic.mines import MINES, Mine, drift

CPU_S = 5.0
TARGETS = {
    "ring": 2.8,
    "drift with bay": 2.2,
    "pocket and bay": 2.6,
    "loop and stem": 2.2,
    "loop, stem and pocket": 2.6,
}
LONGEST_S = 100.0


def claims_of(mine: Mine) -> Claims:
    sections, hauls = mine
    return Claims([Cycle(sections, haul) for haul in hauls.values()])


@pytest.mark.parametrize("name", MINES)
def test_all_interleavings_of_three_machines(name: str) -> None:
    begin = time.process_time()
    found = explore(claims_of(MINES[name](3)))
    assert time.process_time() - begin < CPU_S
    assert found.shared == ()
    assert found.stuck == ()
    assert found.never_again == ()
    assert found.sound
    assert found.states > 100


@pytest.mark.parametrize("name", TARGETS)
def test_three_machines_dump_so_much_more_than_one(name: str) -> None:
    for seed in range(2):
        sections, hauls = MINES[name](3)
        one = simulate(sections, dict(list(hauls.items())[:1]), chance=Chance(seed))
        three = simulate(sections, hauls, chance=Chance(seed))
        assert three.total / one.total >= TARGETS[name]
        assert three.longest_wait_s <= LONGEST_S
        assert max(three.buckets.values()) - min(three.buckets.values()) <= 0.1 * three.total / 3 + 1


def brute_force(claims: Claims) -> set[Joint]:
    """Return the safe states by their definition: all joint states, backwards from all being home, until nothing changes."""
    every = [
        at
        for at in itertools.product(*(range(len(cycle.places)) for cycle in claims.cycles))
        if len({cycle.section_of[k] for cycle, k in zip(claims.cycles, at, strict=True)}) == len(at)
    ]
    safe = {claims.home}
    grown = True
    while grown:
        grown = False
        for at in every:
            if at not in safe and any(after in safe for _, after in claims.moves(at)):
                safe.add(at)
                grown = True
    return safe


@pytest.mark.parametrize("bay", [True, False])
def test_the_safe_set_is_exact(bay: bool) -> None:
    claims = claims_of(drift(2, bay=bay))
    safe = brute_force(claims)
    for at in itertools.product(*(range(len(cycle.places)) for cycle in claims.cycles)):
        if len({cycle.section_of[k] for cycle, k in zip(claims.cycles, at, strict=True)}) == len(at):
            assert claims.safe(at) == (at in safe)


def test_going_ahead_wherever_it_is_free_gets_stuck() -> None:
    """The findings' greedy scheme, on the same mine: what the claims are for."""
    claims = claims_of(drift())
    seen, stack, stuck = {claims.home}, [claims.home], 0
    while stack:
        at = stack.pop()
        moves = [after for _, after in claims.moves(at)]
        stuck += not moves
        stack += [after for after in dict.fromkeys(moves) if after not in seen]
        seen.update(moves)
    assert stuck > 0


@given(
    st.lists(st.sampled_from(["way", "bay"]), min_size=1, max_size=4),
    st.lists(st.floats(5.0, 60.0), min_size=12, max_size=12),
    st.integers(2, 3),
)
@settings(deadline=None, max_examples=12)
def test_on_any_drift_nothing_is_ever_stuck(parts: list[str], lengths: list[float], count: int) -> None:
    names, bays, ways = ["j"], [], []
    for k, part in enumerate(parts):
        if part == "bay":
            bays.append((f"bay{k}", 25.0))
            ways.append(f"{names[-1]} bay{k} e{k}")
            names += [f"m{k}", f"e{k}"]
        else:
            names.append(f"w{k}")
    sections = [(name, length) for name, length in zip(names, lengths, strict=False)] + bays
    sections += [("dump", 12.0), *((f"dp{k}", 25.0) for k in range(count))]
    mine = named(sections, [" ".join([*names, "dump"]), *(f"dp{k} j" for k in range(count)), *ways])
    hauls = {f"m{k}": Haul(f"dp{k}", "dump", f"dp{k}") for k in range(count)}
    assert explore(claims_of((mine, hauls))).sound
    shift = simulate(mine, hauls, hours=1.0)
    assert all(buckets > 0 for buckets in shift.buckets.values())


def test_a_section_is_held_until_the_rear_has_left_it() -> None:
    sections, hauls = drift(2)
    control = TrafficControl(sections, hauls)
    control.wants("m0", 0)
    assert [(one.machine, one.section, one.leg) for one in control.step(10)] == [("m0", "j", Leg.LOADED)]
    control.wants("m1", 1)
    assert control.step(10) == []
    control.wants("m0", 2)
    assert control.step(10) == []  # its rear is still in the draw point
    control.left("m0")
    assert [one.section for one in control.step(10)] == ["a0"]
    assert control.held()["j"] == "m0"
    assert control.waiting() == {"m1": 1}


def test_who_has_waited_longest_goes_first() -> None:
    sections, hauls = drift(3)
    control = TrafficControl(sections, hauls)
    control.wants("m2", 5)
    control.wants("m0", 7)
    control.wants("m2", 9)  # asks again: its place in the line stays
    assert [one.machine for one in control.step(10)] == ["m2"]


def test_a_machine_that_wants_home_goes_home() -> None:
    sections, hauls = MINES["ring"](1)
    control = TrafficControl(sections, hauls)
    for now_ns in range(40):
        control.left("m0")
        place = control.place("m0")
        if place.section == "r6":
            break
        control.wants("m0", now_ns)
        control.step(10)
    places = []
    for now_ns in range(10):
        control.left("m0")
        control.wants("m0", 100 + now_ns, home=True)
        places += [one.section for one in control.step(10)]
    assert places[-1] == "p0"
    assert "r0" not in places


def test_what_is_no_map_for_it_is_refused() -> None:
    sections, hauls = drift(2)
    with pytest.raises(UsageError, match="did you mean one of dp0, dp1"):
        Cycle(sections, Haul("dp", "dump", "dp0"))
    with pytest.raises(UsageError, match="at home in 'dp0'"):
        Claims([Cycle(sections, hauls["m0"])] * 2)
    with pytest.raises(InputError, match="no way leads"):
        Cycle(named([("a", 1.0), ("b", 1.0)]), Haul("a", "b", "a"))


def test_a_single_machine_needs_as_long_as_its_way() -> None:
    """Closed form: 150 m there at 10 km/h, back at 12, load and dump as they are meant to last on average."""
    sections = named([("load", 30.0), ("way", 100.0), ("dump", 20.0)], ["load way dump"])
    shift = simulate(sections, {"m": Haul("load", "dump", "load")}, hours=10.0, chance=Chance(0, 1e-6, 1e-6))
    cycle_s = 120.0 / (10.0 / 3.6) + 130.0 / (12.0 / 3.6) + 25.0 + 18.0
    assert shift.total == pytest.approx(36_000.0 / cycle_s, abs=1.0)
    assert shift.longest_wait_s < 30.0 / (10.0 / 3.6)


def test_a_machine_whose_draw_point_is_the_home_of_another_is_refused() -> None:
    sections, hauls = drift(2)
    both = named(
        [*((one.name, one.length_m) for one in sections.sections), ("park", 15.0)],
        ["park j", "dp0 j", "dp1 j", "j dump"],
    )
    with pytest.raises(UsageError, match="machine 'm1' can never dump"):
        TrafficControl(both, {"m0": hauls["m0"], "m1": Haul("dp0", "dump", "park")})


def test_who_has_waited_too_long_stops_new_cycles() -> None:
    """Two machines before one lane: the first comes back again and again, the second asks for something that is never free."""
    sections, hauls = drift(2, bay=False)
    control = TrafficControl(sections, hauls)
    control.wants("m1", 0, "a1")  # not next to it: never granted
    control.wants("m0", int(95e9))
    assert [one.machine for one in control.step(int(95e9))] == [
        "m0"
    ]  # nothing else could be granted: not held back for nothing
    control.left("m0")
    control.wants("m1", int(96e9), "j")
    control.wants("m0", int(96e9), "a0")
    assert [one.machine for one in control.step(int(97e9))] == ["m0"]  # out of the way, as its cycle has begun
