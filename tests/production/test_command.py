"""`lhdmap production`: figures of journals, and the folder."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from lhdmap.cli.main import main
from lhdmap.haulage.records import Cycle
from lhdmap.pipeline.production_run import production_of_runs
from lhdmap.production.iredes_schema import faults_of
from lhdmap.production.journal import cycle_values, cycles_of_journal
from lhdmap.replay.journal import Journal

from tests.production.records import shift


def write_journal(path: Path, cycles: list[Cycle]) -> Path:
    journal = Journal(path)
    write_cycles(journal, "mission", cycles)
    journal.close()
    return path


def write_cycles(journal: Journal, process: str, cycles: list[Cycle]) -> None:
    scribe = journal.of(process)
    odometer_m = 0.0
    for one in cycles:
        for part in one.intervals:
            journal.now_ns = part.from_ns
            scribe.goes(str(part.phase), part.cause, place=part.place, odometer_m=odometer_m)
            odometer_m += part.distance_m
        journal.now_ns = one.to_ns
        scribe.event("cycle", odometer_m=odometer_m, **cycle_values(one))


def test_figures_of_a_journal_are_those_of_its_records(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    journal = write_journal(tmp_path / "journal.jsonl", shift())
    assert main(["production", str(journal), "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["cycles"] == 4
    assert values["tonnes"] == pytest.approx(40.7)
    assert values["levels_s"]["calendar"] == pytest.approx(420.0)
    assert values["distance_m"] == pytest.approx(684.0)
    (stop,) = values["stops"]
    assert (stop["place"], stop["seconds"]) == ("I1", pytest.approx(20.0))


def test_a_folder_with_all_of_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runs = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        runs.append(str(write_journal(tmp_path / name / "journal.jsonl", shift()).parent))
    out = tmp_path / "shift"
    assert main(["production", *runs, "--shift-h", "0.5", "-o", str(out)]) == 0
    assert "8 buckets, 81.4 t, 81.40 t/h" in capsys.readouterr().out
    names = {one.name for one in out.iterdir()}
    assert names >= {
        "report.html",
        "production.json",
        "cycles.csv",
        "cycles.parquet",
        "phases.csv",
        "phases.parquet",
        "run.json",
    }
    reports = sorted(name for name in names if name.endswith(".xml"))
    assert reports == ["iredes_lhd_1.xml", "iredes_lhd_2.xml"]
    for name in reports:
        assert list(faults_of(ET.parse(out / name).getroot())) == []  # noqa: S314  # our own
    assert main(["info", str(out)]) == 0
    assert main(["production", *runs, "-o", str(out)]) == 2


def test_what_is_no_run_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["production", str(tmp_path)]) == 3
    assert "no such file" in capsys.readouterr().err


def test_each_machine_of_a_run_has_its_own_figures(tmp_path: Path) -> None:
    one, other = shift(), [cycle._replace(machine="lhd2") for cycle in shift()[:2]]
    journal = Journal(tmp_path / "journal.jsonl")
    write_cycles(journal, "mission", [cycle._replace(machine="lhd1") for cycle in one])
    write_cycles(journal, "lhd2/mission", other)
    journal.of("crew/monitor").event("section shared")
    journal.close()
    cycles = cycles_of_journal(tmp_path / "journal.jsonl")
    finished = [(cycle.machine, cycle.number) for cycle in cycles if cycle.finished]
    assert finished == [("lhd1", k) for k in (1, 2, 3, 4)] + [("lhd2", 1), ("lhd2", 2)]
    assert sum(cycle.seconds() for cycle in cycles if cycle.machine == "lhd2" and cycle.finished) == pytest.approx(
        sum(cycle.seconds() for cycle in other)
    )
    each = production_of_runs([tmp_path / "journal.jsonl"]).by_machine()
    assert [(row["machine"], row["cycles"]) for row in each] == [("lhd1", 4), ("lhd2", 2)]
    assert sum(row["tonnes"] for row in each) == pytest.approx(40.7 + sum(cycle.mass_t for cycle in other))
    assert each[0]["waits_s"] == pytest.approx(20.0)
    out = tmp_path / "three"
    assert main(["production", str(tmp_path / "journal.jsonl"), "-o", str(out)]) == 0
    assert "waited for others" in (out / "report.html").read_text()
    for name in ("lhd1", "lhd2"):
        assert list(faults_of(ET.fromstring((out / f"iredes_{name}.xml").read_text()))) == []  # noqa: S314  # our own file
