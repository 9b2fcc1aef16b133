"""Figures, tables and the page, on records whose figures are known by heart and on a mission that was driven."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from xml.etree import ElementTree as ET

import pyarrow.parquet as pq
import pytest
from lhdmap.errors import InputError
from lhdmap.haulage.records import Cycle, Ledger, Phase
from lhdmap.production.figures import Production, production_of
from lhdmap.production.files import cycle_rows, phase_rows, write_csv, write_parquet
from lhdmap.production.iredes import iredes_xml
from lhdmap.production.iredes_schema import faults_of
from lhdmap.production.journal import cycle_values, cycles_of_journal
from lhdmap.replay.journal import Journal
from lhdmap.report.production_page import render, write_production_page

from tests.haulage.drives import Drive
from tests.haulage.sites import hejase
from tests.haulage.test_mission import ORDER
from tests.production.records import cycle, intervals, shift


@pytest.fixture(scope="module")
def production() -> Production:
    return production_of(shift())


def test_figures_by_hand(production: Production) -> None:
    values = production.values()
    assert values["cycles"] == 4
    assert values["tonnes"] == pytest.approx(11.0 * (0.85 + 0.9 + 0.95 + 1.0))
    assert values["tonnes_per_hour"] == pytest.approx(values["tonnes"] / (420.0 / 3600.0))
    assert values["cycle_mean_s"] == pytest.approx(105.0)
    assert values["fill_mean"] == pytest.approx(0.925)
    assert values["attempts_mean"] == pytest.approx(1.5)
    assert values["slip_mean"] == pytest.approx(0.04)
    assert (values["distance_m"], values["distance_loaded_m"]) == pytest.approx((4 * 171.0, 4 * 81.0))
    assert values["time_by_phase_s"] == pytest.approx(
        {"load": 100.0, "haul": 108.0, "dump": 72.0, "return": 120.0, "traffic": 20.0}
    )
    assert values["effectiveness"] == pytest.approx(400.0 / 420.0)
    assert values["stops"] == [
        {"phase": "traffic", "place": "I1", "cause": "no permit for the next section", "times": 1, "seconds": pytest.approx(20.0)}
    ]  # fmt: skip
    json.dumps(values)


def test_buckets_are_those_that_the_productive_time_is_enough_for(production: Production) -> None:
    assert production.pace == pytest.approx(1.0)


def test_a_fill_is_counted_once(production: Production) -> None:
    rows = production.fill_histogram()
    assert sum(count for *_, count in rows) == 4
    assert {low: count for low, _, count in rows if count} == {0.8: 1, 0.9: 2, 1.0: 1}
    over = production_of([cycle(1, 0.0, fill=1.9)]).fill_histogram()
    assert over[-1][2] == 1


def test_what_is_not_known_is_none_and_never_zero() -> None:
    bare = Cycle("lhd", 1, "DP1", "OP1", shift()[0].intervals)
    values = production_of([bare]).values()
    assert values["fill_mean"] is values["attempts_mean"] is values["slip_mean"] is None
    nothing = production_of([])
    assert nothing.values()["cycles"] == 0
    assert math.isnan(nothing.tonnes_per_hour)


def test_two_machines_at_the_same_time_have_twice_the_time() -> None:
    both = production_of([*shift(), *(one._replace(machine="lhd 2") for one in shift())])
    assert both.stack.level_s("calendar") == pytest.approx(840.0)
    assert both.tonnes_per_hour == pytest.approx(production_of(shift()).tonnes_per_hour)


def test_help_is_shared_among_the_buckets() -> None:
    helped = cycle(1, 0.0)._replace(
        intervals=intervals((Phase.ASSISTANCE, 30.0, "DP1", "boulder", 0.0), (Phase.DUMP, 10.0, "", "", 0.0))
    )
    assert production_of([helped, cycle(2, 40.0)]).assist_s_per_bucket == pytest.approx(15.0)


def test_tables_hold_all_and_add_up(tmp_path: Path) -> None:
    cycles = shift()
    write_csv(tmp_path / "cycles.csv", cycle_rows(cycles))
    with (tmp_path / "cycles.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["load_s"]) for row in rows] == [25.0] * 4
    assert [float(row["traffic_s"]) for row in rows] == [0.0, 20.0, 0.0, 0.0]
    write_parquet(tmp_path / "phases.parquet", phase_rows(cycles))
    table = pq.read_table(tmp_path / "phases.parquet").to_pydict()
    seconds = sum(b - a for a, b in zip(table["from_ns"], table["to_ns"], strict=True)) * 1e-9
    assert seconds == pytest.approx(420.0)
    assert set(table["usage"]) == {"productive", "delay"}


def test_the_page_is_one_file_that_names_the_stop(production: Production, tmp_path: Path) -> None:
    write_production_page(tmp_path / "production.html", production, "Shift & such")
    text = (tmp_path / "production.html").read_text(encoding="utf-8")
    assert "<h1>Shift &amp; such</h1>" in text
    assert "no permit for the next section" in text
    assert text.count("<img") == 4
    assert "http" not in text.replace("http://www.w3.org", "")
    assert "None was dumped." in render(production_of([]))


def test_a_mission_that_was_driven_is_read_back_from_its_journal(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal.jsonl")
    scribe, drive = journal.of("mission"), Drive(hejase())
    for _ in range(12_000):
        output = drive.tick(ORDER)
        journal.now_ns = drive.now_ns
        if output.cycle is not None:
            scribe.event("cycle", **cycle_values(output.cycle))
        scribe.goes(str(output.phase), odometer_m=drive.odometer_m)
        if output.phase == Phase.IDLE and drive.cycles:
            break
    journal.close()
    read = cycles_of_journal(tmp_path / "journal.jsonl")
    assert [one.finished for one in read] == [True, True, False]
    for mine, theirs in zip(drive.cycles, read, strict=False):
        assert (theirs.number, theirs.load, theirs.mass_t, theirs.fill) == (mine.number, "L1", 10.0, 0.91)
        for phase in Phase:
            assert theirs.seconds(phase) == pytest.approx(mine.seconds(phase), abs=0.2), phase
        assert theirs.distance_m == pytest.approx(mine.distance_m, abs=1.0)


def test_a_mission_is_at_the_pace_that_its_productive_time_allows() -> None:
    drive = Drive(hejase())
    drive.run(ORDER, 3000.0)
    rest = drive.task.rest()
    assert rest is not None
    found = production_of([*drive.cycles, rest])
    assert found.pace >= 0.95
    assert found.stack.level_s("calendar") == pytest.approx(1e-9 * (rest.to_ns - drive.cycles[0].from_ns))


def test_a_drive_without_a_mission_has_its_drives_and_waits(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal.jsonl")
    scribe = journal.of("navigation")
    executor = journal.of("executor")
    for seconds, state in ((0, "driving"), (40, "assistance"), (50, "driving"), (80, "arrived")):
        journal.now_ns = seconds * 1_000_000_000
        scribe.goes(state, "because")
        if seconds == 50:
            for at, cause, after in (
                (55, "guard: wall", "braking"),
                (57, "queue", "standing"),
                (60, "queue", "driving"),
            ):
                journal.now_ns = at * 1_000_000_000
                executor.event("executor: state", cause, before="driving" if at == 55 else "braking", after=after)
    journal.now_ns = 90_000_000_000
    journal.write("engine", "ended")
    journal.close()
    (only,) = cycles_of_journal(tmp_path / "journal.jsonl")
    assert not only.finished
    assert {str(phase): only.seconds(phase) for phase in Phase if only.seconds(phase)} == {
        "tram": 65.0, "assistance": 10.0, "obstacle": 5.0, "idle": 10.0,
    }  # fmt: skip
    found = production_of([only])
    assert [(one.cause, one.seconds) for one in found.stops] == [("because", 10.0), ("guard: wall", pytest.approx(5.0))]
    assert found.values()["distance_m"] is None
    assert ">nan" not in render(found)
    assert list(faults_of(ET.fromstring(iredes_xml([only]).encode()))) == []  # noqa: S314  # our own


def test_a_journal_that_was_cut_is_read_and_one_that_is_none_refused(tmp_path: Path) -> None:
    line = '{"t_ns": 5, "process": "navigation", "event": "state", "from": "", "to": "driving", "cause": "", "values": {}}\n'
    file = tmp_path / "journal.jsonl"
    file.write_text(line + line.replace("5", "9000000000") + line[:30], encoding="utf-8")
    assert cycles_of_journal(file)[0].seconds() == pytest.approx(9.0)
    file.write_text("nothing\n" + line, encoding="utf-8")
    with pytest.raises(InputError, match="line 1: no line of a journal"):
        cycles_of_journal(file)
    with pytest.raises(InputError, match="not a readable journal"):
        cycles_of_journal(tmp_path / "none.jsonl")


def test_a_ledger_never_goes_back_in_time() -> None:
    ledger = Ledger()
    ledger.note(10, Phase.TRAM, "", "", 0.0)
    ledger.note(20, Phase.LOAD, "", "", math.nan)
    ledger.note(15, Phase.HAUL, "", "", 5.0)
    ledger.note(30, Phase.DUMP, "", "", 9.0)
    parts = ledger.take()
    assert [(one.phase, one.from_ns, one.to_ns) for one in parts] == [(Phase.TRAM, 10, 20), (Phase.HAUL, 20, 30)]
    assert sum(one.distance_m for one in parts) <= 9.0
