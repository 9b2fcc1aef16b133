"""The scripted operator: modes at their times, arming after a look, help by hand and the word to go on."""

from __future__ import annotations

from lhdmap.replay.journal import Journal
from lhdmap.replay.process import MACHINE_SAYS, Received
from lhdmap.replay.processes.station import Station
from lhdmap.replay.processes.told import Health, Word
from lhdmap.replay.scenario import ModeAt
from lhdmap.simulation.history import SECOND_NS, START_NS

HEALTHY = Health(START_NS, True, "autonomous", True, ())
STUCK, UNKNOWN = "assistance: no route: it is blocked", "assistance: place not known: lost"


def words(station: Station, health: Health, from_s: float, to_s: float) -> list[tuple[float, Word]]:
    """Return what it says where the machine tells the same all the time."""
    said = []
    for k in range(round(10 * from_s), round(10 * to_s)):
        now_ns = START_NS + k * SECOND_NS // 10
        (out,) = station.step(now_ns, [Received(MACHINE_SAYS, now_ns, health)])
        said.append((k / 10.0, out.message))
    return said


def station(*modes: ModeAt) -> Station:
    return Station(modes or (ModeAt(),), 5.0, 3.0, Journal().of("station"))


def test_it_arms_a_machine_that_stands_after_a_look() -> None:
    one = station()
    words(one, HEALTHY, 0.0, 1.0)
    moving = words(one, HEALTHY._replace(armed=False, standing=False), 1.0, 9.0)
    assert not any(word.rearm for _, word in moving)
    other = station()
    words(other, HEALTHY, 0.0, 1.0)
    stands = words(other, HEALTHY._replace(armed=False), 1.0, 9.0)
    assert next(at for at, word in stands if word.rearm) == 6.0
    assert all(word.mode == "autonomous" for _, word in stands if word.rearm)


def test_modes_are_wanted_at_their_times_with_what_the_operator_does() -> None:
    one = station(
        ModeAt(), ModeAt(2.0, "teleoperated", speed_kmh=-3.6, steering_dps=0.0), ModeAt(4.0, "autonomous", goal="DP2")
    )
    said = words(one, HEALTHY, 0.0, 3.0)
    assert [word.mode for at, word in said if at in (1.9, 2.0)] == ["", "teleoperated"]
    driving = words(one, HEALTHY._replace(mode="teleoperated"), 3.0, 4.0)
    assert {word.speed_mps for _, word in driving} == {-1.0}
    last = words(one, HEALTHY, 4.0, 4.5)
    assert {(word.goal, word.speed_mps) for _, word in last} == {("DP2", None)}


def test_in_idle_nothing_is_armed() -> None:
    said = words(station(ModeAt(0.0, "idle")), HEALTHY._replace(armed=False, mode="idle"), 0.0, 12.0)
    assert not any(word.rearm or word.mode for _, word in said)


def test_who_is_stuck_is_backed_up_by_hand_then_told_to_go_on() -> None:
    one = station()
    asks = HEALTHY._replace(asks=STUCK, gear=1)
    waited = words(one, asks, 0.0, 3.1)
    assert [word.mode for _, word in waited].index("teleoperated") == 30
    by_hand = words(one, asks._replace(mode="teleoperated"), 3.1, 11.0)
    assert {word.speed_mps < 0.0 for _, word in by_hand if word.speed_mps is not None} == {True}
    assert not any(word.go_on for _, word in by_hand)
    back = words(one, asks._replace(mode="teleoperated"), 11.0, 12.0)
    assert back[-1][1].mode == "autonomous"
    assert words(one, asks, 12.0, 12.5)[-1][1].go_on
    assert not words(one, HEALTHY, 12.5, 13.0)[-1][1].go_on


def test_after_so_many_requests_it_gives_up() -> None:
    one = Station((ModeAt(),), 5.0, 1.0, Journal().of("station"), assists=2)
    asks = HEALTHY._replace(asks=UNKNOWN)
    for k in range(2):
        assert words(one, asks, 10.0 * k, 10.0 * k + 2.0)[-1][1].go_on
        words(one, HEALTHY, 10.0 * k + 2.0, 10.0 * k + 3.0)
    said = words(one, asks, 20.0, 24.0)
    assert not any(word.go_on for _, word in said)
    assert all(word.gave_up == f"the station gave up: {UNKNOWN}" and word.mode == "idle" for _, word in said)
    assert words(one, HEALTHY._replace(mode="idle"), 24.0, 24.5)[-1][1].gave_up


def test_who_does_not_know_the_place_is_not_driven_by_hand() -> None:
    said = words(station(), HEALTHY._replace(asks=UNKNOWN), 0.0, 5.0)
    assert not any(word.mode for _, word in said)
    assert said[-1][1].go_on


def test_on_a_surface_site_it_says_go_on_and_does_not_drive() -> None:
    one = Station((ModeAt(),), 5.0, 3.0, Journal().of("station"), 1, backs_up=False)
    said = words(one, HEALTHY._replace(asks="no way to the dock"), 0.0, 5.0)
    assert next(at for at, word in said if word.go_on) == 3.0
    assert {word.mode for _, word in said} == {""}
    words(one, HEALTHY, 5.0, 5.2)
    assert next(word.gave_up for _, word in words(one, HEALTHY._replace(asks="again"), 5.2, 6.0) if word.gave_up)


def test_who_still_asks_after_he_was_helped_asks_again_until_it_gives_up() -> None:
    one = Station((ModeAt(),), 5.0, 1.0, Journal().of("station"), assists=2)
    said = words(one, HEALTHY._replace(asks=UNKNOWN), 0.0, 150.0)
    assert not any(word.gave_up for at, word in said if at < 120.0)
    assert said[-1][1].gave_up == f"the station gave up: {UNKNOWN}"
