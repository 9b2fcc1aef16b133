"""Order, stamps and chance of sensors; dust; what is told."""

from __future__ import annotations

import numpy as np
import pytest
from lhdmap.machine import Machine, SensorMount
from lhdmap.messages import FloatArray, Mount, Text
from lhdmap.simulation.history import START_NS, Column, History
from lhdmap.simulation.sensing.chance import Chance
from lhdmap.simulation.sensing.scans import Dust
from lhdmap.simulation.sensing.sections import SensorSettings
from lhdmap.simulation.sensing.sensor import Beat, Sampled
from lhdmap.simulation.sensing.suite import sensors_of
from lhdmap.simulation.sensing.told import Mounts, Words

from tests.simulation.sensing.machines import history, of_role, readings, times_s


def test_stamps_are_whole_nanoseconds_at_the_rate() -> None:
    beat = Beat(30.0, 0.01)
    for _ in range(2999):
        beat.advance()
    assert isinstance(beat.stamp_ns, int)
    assert abs(beat.stamp_ns - (START_NS + 10_000_000 + round(2999e9 / 30))) <= 1


def test_chance_is_that_of_the_index_not_of_the_order() -> None:
    chance = Chance(5, "front")
    forward = [chance.of(k).standard_normal(7).tolist() for k in range(20)]
    backward = [chance.of(k).standard_normal(7).tolist() for k in reversed(range(20))][::-1]
    assert forward == backward
    fresh = np.random.Generator(np.random.Philox(key=[5, 0xFEFB_4A36], counter=[0, 3, 0, 0]))
    assert len({tuple(row) for row in forward}) == 20
    assert Chance(6, "front").of(0).random() != Chance(5, "front").of(0).random() != Chance(5, "rear").of(0).random()
    assert fresh.standard_normal(7).tolist() != forward[3]  # another name
    assert chance.once().random() == Chance(5, "front").once().random() != chance.of(0).random()


def test_chance_of_neighbours_is_independent_and_normal() -> None:
    chance = Chance(1, "x")
    draws = np.array([chance.of(k).standard_normal(3) for k in range(20_000)])
    assert draws.mean(axis=0) == pytest.approx([0.0] * 3, abs=0.03)
    assert draws.std(axis=0) == pytest.approx([1.0] * 3, rel=0.02)
    assert np.corrcoef(np.hstack([draws[1:], draws[:-1]]).T) == pytest.approx(np.eye(6), abs=0.03)


def test_records_come_in_the_order_of_their_log_time_and_the_first_sensor_first() -> None:
    said = [Sampled(name, Beat(10.0), Words(lambda *_, name=name: name), 1) for name in ("node", "mode")]
    records = readings(said, history(1.0))
    assert [record.log_time_ns for record in records] == sorted(record.log_time_ns for record in records)
    assert [record.message.text for record in records if isinstance(record.message, Text)] == ["node", "mode"] * 11


def test_a_state_is_that_between_its_rows_and_on_a_row_needs_no_other() -> None:
    past = History(100.0)
    for k in range(700):
        past.append(np.full(len(Column), float(k)))
        assert past.state(past.last_ns).tolist() == [float(k)] * len(Column)
        assert past.last_ns == START_NS + k * 10_000_000
    assert past.state(START_NS + 6_995_000_000 - 10_000_000)[0] == pytest.approx(698.5)
    for k in range(2000):
        past.append(np.full(len(Column), 700.0 + k))
    with pytest.raises(ValueError, match="forgotten"):
        past.state(START_NS)


def test_words_are_asked_for_and_nothing_is_said_where_there_is_nothing() -> None:
    def told(stamp_ns: int, state: FloatArray) -> str:
        return "DP1" if state[Column.X] > 0.5 else ""

    sensors = sensors_of(Machine(), SensorSettings(), seed=1, node=told, mode=lambda *_: "autonomous")
    records = readings(sensors, history(1.0, X=lambda t: t))
    nodes = of_role(records, "node")
    assert times_s(nodes) == pytest.approx([0.6, 0.7, 0.8, 0.9, 1.0])
    assert {str(record.message.text) for record in nodes if isinstance(record.message, Text)} == {"DP1"}
    modes = [record.message for record in of_role(records, "mode")]
    assert [message.text for message in modes if isinstance(message, Text)] == ["autonomous"] * 2


def test_mounts_are_told_once_first_and_as_the_machine_file_has_them() -> None:
    records = readings(Mounts({"a": SensorMount("rear_link", (1.0, 2.0, 3.0), yaw_deg=90.0)}), history(1.0))
    assert len(records) == 1
    message = records[0].message
    assert isinstance(message, Mount)
    assert (message.parent_frame, message.child_frame) == ("rear_link", "a")
    assert message.T_parent_child @ [1.0, 0.0, 0.0, 1.0] == pytest.approx([1.0, 3.0, 3.0, 1.0])


def test_dust_comes_and_goes_about_its_mean() -> None:
    dust = Dust(0.05, 3)
    share = np.array([dust.share(t) for t in np.arange(0.0, 100.0, 0.04)])
    assert share.mean() == pytest.approx(0.05, rel=0.05)
    assert share.min() >= 0.0
    assert share.max() > 0.08
