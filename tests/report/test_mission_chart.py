"""The picture of a mission: each stretch of the way has the colour of its phase, the strip under it the phases' times."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lhdmap.haulage.records import Phase
from lhdmap.report import charts
from lhdmap.report.mission_chart import has_mission, mission_chart, write_mission_picture
from lhdmap.report.production_charts import PHASE_COLOURS
from lhdmap.report.replay_data import Change, ReplayData
from lhdmap.report.replay_page import render

from tests.report.drives import START_NS, VERDICT, replayed

PHASES = (("tram", 0.0), ("load", 4.0), ("haul", 10.0))


def _mission(phases: tuple[tuple[str, float], ...] = PHASES) -> ReplayData:
    """Forward 20 m along x in 10 s, and back: tram for 4 s, load for 6 s, the rest haul."""
    changes = [Change(START_NS + round(at_s * 1e9), state, "") for state, at_s in phases]
    return replace(replayed(), changes={"mission": changes})


def test_the_way_is_drawn_by_phase() -> None:
    with charts.styled():
        plan, _ = mission_chart(_mission()).axes
    lines = {str(line.get_label()): line for line in plan.get_lines()}
    for phase, (from_m, to_m) in {"tram": (0.0, 8.0), "load": (8.0, 20.0), "haul": (0.0, 20.0)}.items():
        x = np.asarray(lines[phase].get_xdata(), dtype=float)
        assert (x.min(), x.max()) == pytest.approx((from_m, to_m), abs=0.41)
        assert lines[phase].get_color() == PHASE_COLOURS[Phase(phase)]


def test_the_strip_tells_how_long_each_phase_was() -> None:
    with charts.styled():
        _, strip = mission_chart(_mission()).axes
    assert [text.get_text() for text in strip.texts] == ["tram 4 s", "load 6 s", "haul 10 s"]
    assert strip.get_xlim() == (0.0, 20.0)


def test_of_a_long_run_the_beginning_is_drawn() -> None:
    long = replace(_mission((*PHASES, ("dump", 2000.0))), verdict=VERDICT | {"duration_s": 5000.0})
    with charts.styled():
        _, strip = mission_chart(long).axes
    assert strip.get_xlim() == (0.0, 900.0)
    assert "dump" not in "".join(text.get_text() for text in strip.texts)


def test_a_drive_without_phases_has_no_such_picture(tmp_path: Path) -> None:
    assert not has_mission(replayed())
    assert "Mission</h2>" not in render(replayed())
    assert "Mission</h2>" in render(replace(_mission(), verdict=VERDICT | {"cycles": 1, "tonnes": 9.0}))
    write_mission_picture(tmp_path / "mission.png", _mission())
    assert (tmp_path / "mission.png").read_bytes().startswith(b"\x89PNG")
