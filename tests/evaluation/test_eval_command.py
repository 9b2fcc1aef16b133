"""`lhdmap eval`: output, exit codes and errors, through the entry point."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from lhdmap.cli.main import main
from lhdmap.trajectory import write_tum

from tests.evaluation.paths import part, straight

CONTRACT = {"alignment", "pairs", "ape_m", "rpe", "segments", "reach", "end_pct", "along_m", "across_m", "height_m"}
STATISTICS = {"rmse", "mean", "median", "std", "min", "max"}


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    """An estimate that is 1 % too long, and its truth, 60 m."""
    write_tum(tmp_path / "estimate.tum", straight(60.0, scale=1.01))
    write_tum(tmp_path / "truth.tum", straight(60.0))
    return str(tmp_path / "estimate.tum"), str(tmp_path / "truth.tum")


def test_json_has_the_names_of_the_contract(files: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["eval", "trajectory", files[0], "--truth", files[1], "--json"]) == 0
    output = capsys.readouterr()
    found = json.loads(output.out)
    assert found.keys() >= CONTRACT
    assert found["ape_m"].keys() == STATISTICS
    assert found["rpe"].keys() >= STATISTICS
    assert found["segments"][0].keys() == {"length_m", "n", "translation_pct", "rotation_deg_per_m"}
    assert found["segments"][1]["translation_pct"] == pytest.approx(1.0, abs=1e-3)
    assert found["segments"][-1]["translation_pct"] is None
    assert (found["alignment"], found["pairs"], found["reach"]) == ("origin", 1201, 1.0)
    assert found["end_pct"] == pytest.approx(1.0, abs=1e-3)
    assert found["ape_m"]["max"] == pytest.approx(0.6, abs=1e-5)
    assert "no segment of 100 m" in output.err


def test_table_says_alignment_pairs_and_segments(files: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["eval", "trajectory", files[0], "--truth", files[1], "--segments", "10,100"]) == 0
    text = capsys.readouterr().out
    assert "alignment origin, 1201 pairs over 60.00 m, reach 100.0 % of the true path" in text
    assert "none: the path is too short" in text
    assert "nan" not in text.lower()


def test_straight_tunnel_with_se3_says_that_it_fell_back(
    files: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["eval", "trajectory", files[0], "--truth", files[1], "--alignment", "se3", "--json"]) == 0
    output = capsys.readouterr()
    assert json.loads(output.out)["alignment"] == "origin"
    assert "straight" in output.err


@pytest.mark.parametrize(
    ("limit", "code"),
    [
        (["--max-translation-pct", "1.1"], 0),
        (["--max-translation-pct", "0.9"], 1),
        (["--max-ape-m", "0.5"], 0),
        (["--max-ape-m", "0.3"], 1),
        (["--max-end-pct", "0.9"], 1),
        (["--min-reach", "0.99"], 0),
        (["--max-rotation-deg-per-m", "0.001"], 0),
        (["--segments", "100", "--max-translation-pct", "5"], 1),
    ],
)
def test_limits_decide_the_exit_code(
    files: tuple[str, str], limit: list[str], code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["eval", "trajectory", files[0], "--truth", files[1], "--json", *limit]) == code
    output = capsys.readouterr()
    assert json.loads(output.out)["pairs"] == 1201
    assert ("fell short" in output.err) == (code == 1)


def test_a_short_estimate_misses_the_reach(tmp_path: Path, files: tuple[str, str]) -> None:
    write_tum(tmp_path / "half.tum", part(straight(60.0), slice(0, 600)))
    assert main(["eval", "trajectory", str(tmp_path / "half.tum"), "--truth", files[1], "--min-reach", "0.9"]) == 1


def test_relations(tmp_path: Path, files: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    first, second = 1_700_000_000, 1_700_000_004
    (tmp_path / "x.relations").write_text(f"{first}.0 {second}.0 10.0 0 0 0 0 0\n")
    command = ["eval", "trajectory", files[0], "--truth", str(tmp_path / "x.relations")]
    assert main([*command, "--json", "--max-relation-m", "0.11"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found.keys() >= CONTRACT
    assert found["relations"][1]["translation_m"]["mean"] == pytest.approx(0.1, abs=1e-5)
    assert main([*command, "--max-relation-m", "0.09"]) == 1
    assert "below 5 s" in capsys.readouterr().out
    assert main([*command, "--max-ape-m", "1"]) == 2


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_plot(tmp_path: Path, files: tuple[str, str], suffix: str) -> None:
    target = tmp_path / f"plot.{suffix}"
    assert main(["eval", "trajectory", files[0], "--truth", files[1], "--plot", str(target)]) == 0
    assert target.read_bytes().startswith({"png": b"\x89PNG", "svg": b"<?xml"}[suffix])


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        (["eval", "picnic"], 2, "known: loading, localization, navigation, pile"),
        (["eval"], 2, "SUBJECT"),
        (["eval", "trajectory", "a.tum"], 2, "--truth"),
        (["eval", "trajectory", "a.tum", "--truth", "b.tum"], 3, "a.tum"),
        (["eval", "trajectory", "a.tum", "--truth", "b.tum", "--segments", "5;10"], 2, "5;10"),
    ],
)
def test_errors_are_short_and_have_their_code(
    words: list[str], code: int, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == code
    output = capsys.readouterr()
    assert text in output.err
    assert "Traceback" not in output.err
