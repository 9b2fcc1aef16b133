"""`lhdmap eval pile`: the paper's own table, files with faults, running of logs, exit codes."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.cli import eval_pile
from lhdmap.cli.main import main
from lhdmap.errors import InputError
from lhdmap.evaluation.pile import PileEvaluation, PileRow, evaluate_pile
from lhdmap.evaluation.pile_truth import Attempt, Measured, read_pile_truth
from lhdmap.pile.result import PileEstimate, PileReport, Snapshot

TABLE_6 = Path(__file__).parents[2] / "evaluation" / "table6_autonomous_loading.csv"
HEADER = "attempt,log,gt_width_m,gt_inclination_deg"
ROW_KEYS = {
    "log",
    "pred_width_m",
    "pred_inclination_deg",
    "pred_status",
    "gt_width_m",
    "gt_inclination_deg",
    "gt_status",
}
ROW_KEYS |= {"width_std_m", "inclination_std_deg", "width_error_m", "inclination_error_deg"}
KEYS = {
    "rows",
    "width_mae_m",
    "inclination_mae_deg",
    "width_max_error_m",
    "inclination_max_error_deg",
    "status_accuracy",
    "n",
}


def _report(width_m: float, inclination_deg: float, status: str = "loadable", *, decided: bool = True) -> PileReport:
    estimate = PileEstimate(
        status=status, width_m=width_m, inclination_deg=inclination_deg, width_std_m=0.1, inclination_std_deg=1.0
    )
    snapshot = Snapshot(1, 15.0, estimate)
    return PileReport(snapshot if decided else None, snapshot)


@pytest.fixture
def truth_file(tmp_path: Path) -> Callable[..., Path]:
    """Write lines below a header into a truth file."""

    def write(*lines: str, header: str = HEADER) -> Path:
        path = tmp_path / "truth.csv"
        path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
        return path

    return write


def test_table_6_of_the_paper_gives_the_figures_of_its_text(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["eval", "pile", "--truth", str(TABLE_6), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found.keys() >= KEYS
    assert all(row.keys() >= ROW_KEYS for row in found["rows"])
    assert found["n"] == 6
    assert found["width_mae_m"] == pytest.approx((0.36 + 2.17 + 0.06 + 0.15 + 0.52 + 0.22) / 6)
    assert found["inclination_mae_deg"] == pytest.approx((0.4 + 1.4 + 1.9 + 0.1 + 3.4 + 3.0) / 6)
    assert found["width_max_error_m"] == pytest.approx(2.17)
    assert found["inclination_max_error_deg"] == pytest.approx(3.4)
    assert found["status_accuracy"] is None


def test_table_prints_the_figures_of_the_paper(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["eval", "pile", "--truth", str(TABLE_6)]) == 0
    text = capsys.readouterr().out
    assert "mean 0.58," in text
    assert "mean 1.7," in text
    assert "+2.17" in text
    assert "nan" not in text.lower()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "it is empty"),
        ("# only a comment\n", "it is empty"),
        (HEADER + "\n", "only the line with the column names"),
        ("attempt|log|gt_width_m|gt_inclination_deg\n1|a.mcap|3|-50\n", "no column attempt, gt_width_m"),
        ("attempt,gt_width_m,gt_inclination_deg\n1,3,-50\n", "no column log (or pred_width_m"),
        (HEADER + ",log\n1,a.mcap,3,-50,b\n", "the column log stands twice"),
        ("attempt;log;gt_width_m;gt_inclination_deg\n1;a;1.234,5;-50\n", "gt_width_m is '1.234,5'"),
        (HEADER + "\n1,a.mcap,three,-50\n", "line 2: gt_width_m is 'three'"),
        (HEADER + "\n1,a.mcap,3,inf\n", "gt_inclination_deg is inf"),
        (HEADER + "\n1,a.mcap,-3,-50\n", "gt_width_m is -3"),
        (HEADER + "\n1,a.mcap,3,20,-50,10\n", "6 cells, but 4 columns"),
        (HEADER + ",gt_status\n1,a.mcap,3,-50,nice\n", "gt_status is 'nice'"),
        (HEADER + "\n1,,3,-50\n", "neither a log nor predictions"),
    ],
)
def test_faults_of_a_file_are_told_with_exit_code_3(
    content: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "truth.csv"
    path.write_text(content, encoding="utf-8")
    assert main(["eval", "pile", "--truth", str(path)]) == 3
    errors = capsys.readouterr().err
    assert said in errors
    assert str(path) in errors
    assert len(errors.splitlines()) <= 2


@pytest.mark.parametrize("content", [b"\xff\xfe\x00\x01" * 50, b'1,"2\x00,3\n'])
def test_what_is_no_text_is_told(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "truth.csv").write_bytes(content)
    with pytest.raises(InputError, match=r"truth\.csv"):
        read_pile_truth(tmp_path / "truth.csv")


def test_missing_file_and_missing_option(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["eval", "pile", "--truth", str(tmp_path / "no.csv")]) == 3
    assert main(["eval", "pile"]) == 2
    assert main(["eval", "pile", "--truth", str(TABLE_6), "--set", "pile.method=figure9"]) == 2
    assert "holds predictions" in capsys.readouterr().err


def test_signs_comments_and_blank_lines_of_other_tools_are_read(truth_file: Callable[..., Path]) -> None:
    path = truth_file("# a comment", "", " 1 , a.mcap , 3.0 ,\N{MINUS SIGN}50.0", header="\ufeff" + HEADER)
    (attempt,) = read_pile_truth(path).attempts
    assert attempt == Attempt("1", "a.mcap", Measured(3.0, -50.0), Measured())


PREDICTIONS = ["1,3.0,-50.0,3.2,-51.5", "2,4.0,-40.0,,", "3,3.5,-45.0,3.5,-45.0"]
NAMES = "attempt,gt_width_m,gt_inclination_deg,pred_width_m,pred_inclination_deg"
VARIANTS = {
    "no log": ("\n".join([NAMES, *PREDICTIONS]), "utf-8"),
    "mark": ("\n".join([NAMES, *PREDICTIONS]), "utf-8-sig"),
    "utf-16": ("\n".join([NAMES, *PREDICTIONS]), "utf-16"),
    "line ends of DOS": ("\r\n".join([NAMES, *PREDICTIONS]), "utf-8"),
    "semicolons": ("\n".join([NAMES, *PREDICTIONS]).replace(",", ";"), "utf-8"),
    "decimal commas": ("\n".join([NAMES, *PREDICTIONS]).replace(",", ";").replace(".", ","), "utf-8"),
    "tabs": ("# a comment, with a comma; and more\n" + "\n".join([NAMES, *PREDICTIONS]).replace(",", "\t"), "utf-8"),
    "quotes": ("\n".join([NAMES, '1,"3,0","-50,0","3,2","-51,5"', *PREDICTIONS[1:]]), "utf-8"),
    "more columns": ("\n".join([f"note,{NAMES.upper()},,", *(f"x,{line},," for line in PREDICTIONS)]), "utf-8"),
    "empty cells": ("\n".join([NAMES, PREDICTIONS[0] + ",,", "2,4.0,-40.0", "", ",,,,", PREDICTIONS[2]]), "utf-8"),
    "words for nothing": ("\n".join([NAMES, PREDICTIONS[0], "2,4.0,-40.0,n/a,null", PREDICTIONS[2]]), "utf-8"),
}


@pytest.mark.parametrize("name", VARIANTS)
def test_a_table_as_others_write_it_gives_the_same_figures(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content, encoding = VARIANTS[name]
    (tmp_path / "truth.csv").write_bytes(content.encode(encoding))
    assert main(["eval", "pile", "--truth", str(tmp_path / "truth.csv"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["n"], found["identified"], found["was_run"]) == (3, 2, False)
    assert found["width_mae_m"] == pytest.approx(0.1)
    assert found["inclination_mae_deg"] == pytest.approx(0.75)


def test_statuses_are_read_as_they_are_spoken(truth_file: Callable[..., Path]) -> None:
    names = "attempt,gt_width_m,gt_inclination_deg,gt_status,pred_status"
    path = truth_file("1,3,-20,Too shallow,too-shallow", "2,3,-88,Hang-up,HANG_UP", header=names)
    found = PileEvaluation(tuple(evaluate_pile(read_pile_truth(path))), was_run=False)
    assert found.status.accuracy == 1.0


def test_only_what_has_no_prediction_is_run(
    truth_file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[str] = []

    def run(log: Path) -> PileReport:
        asked.append(log.name)
        return _report(3.15, -51.5)

    names = HEADER + ",pred_width_m,pred_inclination_deg"
    path = truth_file("1,a.mcap,3.0,-50.0,3.0,-50.0", "2,b.mcap,3.0,-50.0,,", "3,,3.0,-50.0,,", header=names)
    monkeypatch.setattr(eval_pile, "_runner", lambda _: run)
    assert main(["eval", "pile", "--truth", str(path), "--json", "--at", "decision"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert asked == ["b.mcap"]
    assert [row["pred_width_m"] for row in found["rows"]] == [3.0, 3.15, None]
    assert found["was_run"]


def test_logs_are_run_beside_the_file_and_one_that_fails_does_not_end_it(truth_file: Callable[..., Path]) -> None:
    path = truth_file("1,logs/a.mcap,3.0,-50.0", "2,gone.mcap,3.0,-50.0", "3,c.mcap,3.0,-50.0")
    asked: list[Path] = []

    def run(log: Path) -> PileReport:
        asked.append(log)
        if log.name == "gone.mcap":
            raise InputError(f"{log}: no such file")
        return _report(3.15, -51.5)

    rows = list(evaluate_pile(read_pile_truth(path), run))
    assert asked == [path.parent / name for name in ("logs/a.mcap", "gone.mcap", "c.mcap")]
    found = PileEvaluation(tuple(rows), was_run=True).to_json()
    assert found["n"] == 3
    assert found["identified"] == 2
    assert found["width_mae_m"] == pytest.approx(0.15)
    assert found["width_within_2_std"] == pytest.approx(1.0)
    assert found["inclination_within_2_std"] == pytest.approx(1.0)
    assert found["rows"][1]["pred_width_m"] is None
    assert "no such file" in found["rows"][1]["problem"]


def test_a_pile_that_is_not_identified_is_null_and_counts_as_none(truth_file: Callable[..., Path]) -> None:
    path = truth_file("1,a,3.0,-50.0,loadable", "2,b,,,none", header=HEADER + ",gt_status")
    reports = {"a": _report(3.0, -50.0, decided=False), "b": PileReport(None, None)}
    rows = evaluate_pile(read_pile_truth(path), lambda log: reports[log.name])
    found = PileEvaluation(tuple(rows), was_run=True).to_json()
    assert [row["pred_width_m"] for row in found["rows"]] == [None, None]
    assert [row["pred_status"] for row in found["rows"]] == [None, None]
    assert found["status_accuracy"] == 0.5
    assert found["status_counts"] == {"loadable": {"none": 1}, "none": {"none": 1}}
    assert found["width_mae_m"] is None


def test_decision_and_end_are_told_apart(truth_file: Callable[..., Path]) -> None:
    truth = read_pile_truth(truth_file("1,a,3.0,-50.0"))
    early, late = _report(4.0, -40.0).last, _report(3.1, -50.0).last
    report = PileReport(early, late)
    (at_end,) = evaluate_pile(truth, lambda _: report)
    (at_decision,) = evaluate_pile(truth, lambda _: report, at_decision=True)
    assert at_end.width_error_m == pytest.approx(0.1)
    assert at_decision.width_error_m == pytest.approx(1.0)


def test_macro_accuracy_weighs_statuses_alike_and_false_loadables_are_counted(truth_file: Callable[..., Path]) -> None:
    lines = [
        *(f"{k},,3,-50,3,-50,loadable,loadable" for k in range(8)),
        "8,,3,-85,3,-55,wall,loadable",
        "9,,3,-88,3,-88,wall,wall",
    ]
    header = HEADER + ",pred_width_m,pred_inclination_deg,gt_status,pred_status"
    found = PileEvaluation(tuple(evaluate_pile(read_pile_truth(truth_file(*lines, header=header)))), was_run=False)
    assert found.status.accuracy == pytest.approx(0.9)
    assert found.status.macro_accuracy == pytest.approx(0.75)
    assert found.status.called_loadable == pytest.approx(0.5)


def test_command_runs_logs_tells_of_failures_and_holds_limits(
    truth_file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = truth_file("1,a.mcap,3.0,-50.0", "2,b.mcap,3.0,-50.0")
    monkeypatch.setattr(eval_pile, "_runner", lambda _: lambda log: _report(3.3, -53.0))
    assert main(["eval", "pile", "--truth", str(path), "--max-width-mae-m", "0.5"]) == 0
    assert "0.58 m and 1.7 deg" in capsys.readouterr().out
    assert main(["eval", "pile", "--truth", str(path), "--max-width-mae-m", "0.2"]) == 1
    assert "0.3, at most 0.2 was wanted" in capsys.readouterr().err

    def failing(log: Path) -> PileReport:
        raise InputError(f"{log}: no such file")

    monkeypatch.setattr(eval_pile, "_runner", lambda _: failing)
    assert main(["eval", "pile", "--truth", str(path), "--json"]) == 3
    output = capsys.readouterr()
    assert json.loads(output.out)["width_mae_m"] is None
    assert "2 of 2 logs could not be used" in output.err


def test_interruption_keeps_the_finished_rows(
    truth_file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(log: Path) -> PileReport:
        if log.name == "b":
            raise KeyboardInterrupt
        return _report(3.3, -53.0)

    monkeypatch.setattr(eval_pile, "_runner", lambda _: run)
    assert main(["eval", "pile", "--truth", str(truth_file("1,a,3,-50", "2,b,3,-50")), "--json"]) == 4
    assert json.loads(capsys.readouterr().out)["n"] == 1


@given(st.lists(st.tuples(st.floats(0, 10), st.floats(0, 10), st.floats(-100, 0), st.floats(-100, 0)), min_size=1))
def test_figures_agree_with_plain_arithmetic(values: list[tuple[float, float, float, float]]) -> None:
    rows = tuple(PileRow(Attempt("", "", Measured(a, c), Measured()), Measured(b, d)) for a, b, c, d in values)
    found = PileEvaluation(rows, was_run=False)
    table = np.array(values)
    for summary, errors in ((found.width, table[:, 1] - table[:, 0]), (found.inclination, table[:, 3] - table[:, 2])):
        assert summary.mae == pytest.approx(sum(abs(e) for e in errors) / len(errors))
        assert summary.max == pytest.approx(max(abs(e) for e in errors))
        assert summary.median is not None
        assert summary.p90 is not None
        assert summary.max is not None
        assert summary.median <= summary.p90 <= summary.max


def test_a_pile_that_was_not_looked_for_is_null_and_counts_for_nothing(truth_file: Callable[..., Path]) -> None:
    path = truth_file("1,a,3.0,-50.0,loadable", "2,b,,,none", header=HEADER + ",gt_status")
    reports = {"a": _report(3.0, -50.0), "b": PileReport(None, None, reason="no pile was looked for: no inclinometer")}
    rows = evaluate_pile(read_pile_truth(path), lambda log: reports[log.name])
    found = PileEvaluation(tuple(rows), was_run=True).to_json()
    assert [row["pred_status"] for row in found["rows"]] == ["loadable", None]
    assert "inclinometer" in found["rows"][1]["reason"]
    assert found["rows"][1]["problem"] is None
    assert found["status_n"] == 1
    assert found["status_accuracy"] == 1.0
