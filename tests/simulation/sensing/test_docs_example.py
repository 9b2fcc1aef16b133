"""The sensors of docs/sensors.md, as they stand there, in a drift whose end is where geometry says."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.logs.source import LogSource
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import Record
from lhdmap.simulation.history import Column
from lhdmap.simulation.sensing.faults import FaultSettings, with_faults
from lhdmap.simulation.sensing.sensor import read_all
from lhdmap.simulation.world import DriftWorld

from tests.simulation.scanners import exact
from tests.simulation.sensing.machines import times_s

PAGE = Path(__file__).resolve().parents[3] / "docs" / "sensors.md"


def figures(record: Record) -> Any:
    message: Any = record.message
    return message.ranges_m


@pytest.fixture(scope="module")
def example() -> dict[str, Any]:
    """What the page's code makes."""
    made: dict[str, Any] = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        exec(compile(block, str(PAGE), "exec"), made)  # noqa: S102  # what the page says is what is tested
    return made


def test_the_radar_measures_the_way_to_the_end_of_a_straight_drift(
    example: dict[str, Any], plain_world: DriftWorld
) -> None:
    """The end comes nearer by what is driven, and is where the scanner sees it, which hangs 0.2 m behind; else the floor is."""
    world = plain_world
    radar = example["Radar"](world.machine, seed=5, noise_m=0.0)
    records = list(read_all([radar], world.history, world))
    states = world.history.at(times_s(records))
    driven = np.linalg.norm(states[:, [Column.X, Column.Y]] - states[0, [Column.X, Column.Y]], axis=1)
    shown = np.array([figures(record)[0] for record in records])
    floor_m = 1.9 / np.sin(np.radians(3.0))
    assert np.diff(times_s(records)) == pytest.approx(0.05)
    assert shown[0] == pytest.approx(floor_m, abs=0.01)
    near = shown < 21.0
    assert near.sum() > 20
    assert (shown + driven)[near] == pytest.approx((shown + driven)[-1], abs=0.02)
    ahead = exact(world, world.history.last_s - 0.1)[0, 190] - 0.2
    assert shown[-1] == pytest.approx(float(ahead), abs=0.02)


def test_all_of_it_makes_a_log_that_can_be_read(example: dict[str, Any], tmp_path: Path) -> None:
    with LogWriter(tmp_path / "drive.mcap") as writer:
        for record in example["records"]:
            writer.write(record.topic, record.message, record.log_time_ns)
    with LogSource(tmp_path / "drive.mcap", {"front": "/radar/front", "tachometer": "/machine/speedometer"}) as source:
        counts = {role: sum(1 for _ in source.messages([role])) for role in ("front", "tachometer")}
    last_s = example["world"].history.last_s
    assert counts == {"front": int(20 * last_s) + 1, "tachometer": int(10 * last_s) + 1}


def test_a_fault_finds_it_by_its_topic(example: dict[str, Any]) -> None:
    world = example["world"]
    fault = FaultSettings(at_s=1.0, kind="dead", target="/radar/front")
    faulty = with_faults([example["Radar"](world.machine, seed=1)], [fault], seed=1)
    assert len(list(read_all(faulty, world.history, world))) == 20
