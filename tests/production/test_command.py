"""`lhdmap production`: figures of journals, and the folder."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from lhdmap.cli.main import main
from lhdmap.haulage.records import Cycle
from lhdmap.production.iredes_schema import faults_of
from lhdmap.production.journal import cycle_values
from lhdmap.replay.journal import Journal

from tests.production.records import shift


def write_journal(path: Path, cycles: list[Cycle]) -> Path:
    journal = Journal(path)
    scribe = journal.of("mission")
    odometer_m = 0.0
    for one in cycles:
        for part in one.intervals:
            journal.now_ns = part.from_ns
            scribe.goes(str(part.phase), part.cause, place=part.place, odometer_m=odometer_m)
            odometer_m += part.distance_m
        journal.now_ns = one.to_ns
        scribe.event("cycle", odometer_m=odometer_m, **cycle_values(one))
    journal.close()
    return path


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
