"""`lhdmap eval loading`: digs and weighings found in signals alone, in journals; output, exit codes, logs that lack something."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.cli.main import main
from lhdmap.descriptions import SOFTWARE
from lhdmap.evaluation.loading.read import LoadingRequest, read_loads
from lhdmap.evaluation.loading.segments import Span, spans_of

from tests.evaluation.loading.loadings import TOPICS, write_loading

FILLS = [[0.55, 0.80, 0.92], [0.70, 0.95]]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[float]]:
    """Two loads, three and two attempts, without a journal."""
    path = tmp_path_factory.mktemp("loading") / "shift.mcap"
    return path, write_loading(path, FILLS)


def test_digs_fills_and_loads_are_found_in_signals(log: tuple[Path, list[float]]) -> None:
    path, durations_s = log
    found = read_loads(LoadingRequest(path))
    assert [len(load.attempts) for load in found.loads] == [3, 2]
    digs = [one for load in found.loads for one in load.attempts]
    np.testing.assert_allclose([one.duration_s for one in digs], durations_s, atol=0.16)
    np.testing.assert_allclose([one.fill for one in digs], [fill for load in FILLS for fill in load], atol=0.02)
    assert {one.mode for one in digs} == {"autonomous"}
    assert not any(one.early for one in digs)
    assert found.warnings == []


def _json(capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_json(log: tuple[Path, list[float]], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["eval", "loading", str(log[0]), "--json", "--quiet"]) == 0
    found = _json(capsys)
    assert [(row["attempts"], row["n"]) for row in found["table3"]["rows"]] == [(2, 1), (3, 1)]
    assert found["table4"]["attempts"]["mean"] == 2.5
    assert [row["n"] for row in found["table5"]["rows"]] == [2, 2, 1]
    assert found["table5"]["rows"][1]["gain"]["mean"] == pytest.approx(0.25, abs=0.02)
    assert found["paper"]["table4"]["attempts"]["mean"] == pytest.approx(74 / 30)
    assert [len(load["attempts"]) for load in found["loads"]] == [3, 2]


def test_folder_text_and_limits(
    log: tuple[Path, list[float]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "tables"
    assert main(["eval", "loading", str(log[0]), "-o", str(out), "--max-attempts", "2.5"]) == 0
    assert "erratum" in capsys.readouterr().out
    with (out / "attempts.csv").open(encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == 5
    with (out / "table5.csv").open(encoding="utf-8") as file:
        assert [row["n"] for row in csv.DictReader(file)] == ["2", "2", "1"]
    assert main(["info", str(out), "--json"]) == 0
    capsys.readouterr()
    assert main(["eval", "loading", str(log[0]), "-o", str(out)]) == 2
    assert main(["eval", "loading", str(log[0]), "--max-attempts", "2.4"]) == 1
    assert main(["eval", "loading", str(log[0]), "--min-first-fill", "0.7"]) == 1
    capsys.readouterr()


def test_another_weighing_model(log: tuple[Path, list[float]], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["eval", "loading", str(log[0]), "--set", "weighing.fill_offset=1.1774", "--json"]) == 0
    assert _json(capsys)["table4"]["fill"]["mean"] == pytest.approx(0.835, abs=0.02)


@pytest.mark.parametrize(
    ("lacks", "said"),
    [("t", "no transmission pressure"), ("l", "no lift pressure"), ("s", "no tachometer"), ("m", "no mode")],
)
def test_a_log_that_lacks_something(tmp_path: Path, lacks: str, said: str) -> None:
    path = tmp_path / "log.mcap"
    write_loading(path, [[0.6, 0.9]], TOPICS.replace(lacks, ""))
    found = read_loads(LoadingRequest(path))
    assert sum(len(load.attempts) for load in found.loads) == 2
    assert any(said in text for text in found.warnings)


def test_no_dig_and_no_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_loading(tmp_path / "none.mcap", [[]])
    write_loading(tmp_path / "deaf.mcap", [[0.6]], TOPICS.replace("c", ""))
    assert main(["eval", "loading", str(tmp_path / "none.mcap"), "--json"]) == 3
    assert "no dig in it" in _json(capsys)["error"]["message"]
    assert main(["eval", "loading", str(tmp_path / "deaf.mcap"), "--json"]) == 3
    assert "no commands" in _json(capsys)["error"]["message"]


def test_one_log_that_cannot_be_used_does_not_stop_the_others(
    log: tuple[Path, list[float]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["eval", "loading", str(tmp_path / "gone.mcap"), str(log[0]), "--json"]) == 3
    found = _json(capsys)
    assert found["table4"]["attempts"]["n"] == 2
    assert len(found["problems"]) == 1


def _event(t_s: float, before: str, after: str, **values: float) -> str:
    keys = {"t_ns": round(t_s * 1e9), "process": "loading", "event": "state", "from": before, "to": after}
    return json.dumps(keys | {"cause": "", "values": values})


def test_a_replay_is_read_from_its_journal(tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    (run / "run.json").write_text(json.dumps({"software": SOFTWARE, "kind": "replay"}))
    lines = [
        _event(1.0, "positioning", "charging"),
        json.dumps({"t_ns": 2, "process": "vehicle", "event": "state", "from": "excavation", "to": "done"}),
        _event(10.0, "charging", "excavation"),
        _event(22.5, "excavation", "pull_back"),
        _event(40.0, "payload_weighing", "rock_pile_identification", fill=0.6, fill_std=0.03),
        _event(60.0, "charging", "excavation"),
        _event(70.0, "excavation", "pull_back"),
        _event(90.0, "payload_weighing", "done", fill=0.9, fill_std=0.03),
    ]
    (run / "journal.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")
    loads = read_loads(LoadingRequest(run)).loads
    assert [(one.duration_s, one.fill) for one in loads[0].attempts] == [(12.5, 0.6), (10.0, 0.9)]


def test_spans() -> None:
    mask = np.zeros(200, dtype=bool)
    mask[10:30] = mask[50:90] = mask[150:152] = True
    assert spans_of(mask) == [Span(10, 30), Span(50, 90), Span(150, 152)]
    assert spans_of(mask, break_s=1.0, least_s=0.5) == [Span(10, 90)]
