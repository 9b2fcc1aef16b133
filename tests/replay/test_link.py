"""The link: what crosses it, what is lost, what is late; by chance that depends on (seed, topic, number) alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from lhdmap.replay.engine import Engine
from lhdmap.replay.faults import Faults
from lhdmap.replay.journal import Journal
from lhdmap.replay.link import Link, LinkSettings
from lhdmap.replay.process import EVERYWHERE, STATION
from lhdmap.simulation.history import START_NS
from lhdmap.simulation.sensing.faults import FaultSettings

from tests.replay.doubles import Ticker

MS = 1_000_000


def numbers(
    faults: tuple[FaultSettings, ...] = (),
    settings: LinkSettings | None = None,
    *,
    seed: int = 3,
    for_s: float = 10.0,
    position_m: tuple[float, float, float] | None = None,
    others: tuple[Ticker, ...] = (),
) -> dict[str, list[tuple[float, int]]]:
    """Return for a reader on the machine, at the station and everywhere when it got which message (s)."""
    sender = Ticker("sender", 10.0, "/machine/command", site=STATION, priority=0)
    readers = [
        Ticker("machine", 1.0, reads=("/machine/command",)),
        Ticker("station", 1.0, reads=("/machine/command",), site=STATION),
        Ticker("witness", 1.0, reads=("/machine/command",), site=EVERYWHERE),
    ]
    journal = Journal()
    board = Faults(faults, journal)
    link = Link(settings or LinkSettings(delay_s=0.0), board, seed)
    link.position_m = position_m
    engine = Engine([sender, *others, *readers], journal, faults=board, link=link)
    for _ in engine.run(START_NS + round(for_s * 1e9)):
        pass
    return {
        one.name: [((now_ns - START_NS) * 1e-9, int(got.message.text)) for now_ns, got in one.got] for one in readers
    }


def test_without_faults_and_delay_all_arrives_at_once() -> None:
    got = numbers(for_s=1.0)
    assert got["machine"] == got["station"] == got["witness"]
    assert len(got["machine"]) == 101


def test_a_lost_link_loses_what_crosses_it_and_nothing_else() -> None:
    fault = FaultSettings(kind="link_lost", target="link", at_s=2.0, duration_s=3.0)
    got = numbers((fault,))
    missing = set(range(1, 1002)) - {number for _, number in got["machine"]}
    assert missing == set(range(201, 501))  # said from 2.00 s to before 5.00 s
    assert len(got["station"]) == len(got["witness"]) == 1001


def test_a_topic_that_is_lost_is_lost_on_the_machine_too_but_not_for_witnesses() -> None:
    got = numbers((FaultSettings(kind="link_lost", target="/machine/command", at_s=2.0, duration_s=3.0),))
    assert len(got["machine"]) == len(got["station"]) == 701
    assert len(got["witness"]) == 1001


def test_a_degraded_link_loses_its_share_and_keeps_the_order() -> None:
    fault = FaultSettings(kind="link_degraded", target="link", size=0.3)
    got = numbers((fault,), LinkSettings(delay_s=0.0, degraded_delay_s=0.2), for_s=40.0)["machine"]
    share = 1.0 - len(got) / 4001
    assert share == pytest.approx(0.3, abs=4 * np.sqrt(0.21 / 4001))
    order = [number for _, number in got]
    assert order == sorted(order)
    late_s = np.array([at - 0.01 * (number - 1) for at, number in got])
    assert late_s.min() >= 0.1 - 1e-9
    assert late_s.max() <= 0.3 + 0.002


def test_chance_does_not_depend_on_what_else_is_said() -> None:
    fault = (FaultSettings(kind="link_degraded", target="link", size=0.5),)
    alone = numbers(fault)
    other: Any = Ticker("other", 7.0, "/operation/mode", site=STATION)
    listener = Ticker("listener", 5.0, reads=("/operation/mode",))
    assert numbers(fault, others=(other, listener)) == alone
    assert numbers(fault, seed=4) != alone


def test_it_fades_near_the_points_that_are_given() -> None:
    settings = LinkSettings(delay_s=0.0, fades_m=((0.0, 0.0, 0.0),), fade_radius_m=10.0, fade_loss_share=0.8)
    for apart_m in (0.0, 10.0, 40.0):
        got = numbers((), settings, for_s=40.0, position_m=(apart_m, 0.0, 0.0))["machine"]
        expected = 0.8 * np.exp(-((apart_m / 10.0) ** 2))
        assert 1.0 - len(got) / 4001 == pytest.approx(expected, abs=0.03)
