"""m and n of Eq. (9): recovered, with intervals that hold, or refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from lhdmap.cli.main import main
from lhdmap.errors import InputError
from lhdmap.loading.calibrate import fit_weights, student_95
from scipy.stats import t as student

M, N = 0.0207, 1.0774


def test_table_2_comes_back() -> None:
    fill = np.linspace(0.0, 1.1, 7)
    model = fit_weights((fill + N) / M, fill)
    assert [model.m, model.n] == pytest.approx([M, N])
    assert model.m_95 == pytest.approx(0.0, abs=1e-9)


def test_the_intervals_hold_95_times_of_100() -> None:
    rng, inside = np.random.default_rng(3), np.zeros(2)
    for _ in range(600):
        truth = rng.uniform(0.0, 1.1, 8)
        model = fit_weights((truth + N) / M, truth + 0.03 * rng.standard_normal(8))
        inside += (abs(model.m - M) <= model.m_95, abs(model.n - N) <= model.n_95)
    assert np.all(np.abs(inside / 600 - 0.95) < 0.027)  # three deviations of such a count


@pytest.mark.parametrize("degrees", [1, 3, 10, 11, 15, 40, 300])
def test_student(degrees: int) -> None:
    assert student_95(degrees) == pytest.approx(student.ppf(0.975, degrees), rel=2e-4)


@pytest.mark.parametrize(
    ("fill", "pressure", "said"),
    [
        ([0.0, 0.5, 1.0], [52.0, 76.2, 100.4], "3 weighed buckets"),
        ([0.9, 0.91, 0.92, 0.9, 0.95], [95.0, 96.0, 97.0, 95.0, 98.0], "fills from 0.90 to 0.95"),
        ([0.0, 1.0, 0.0, 1.0, 0.0], [52.0, 100.0, 52.0, 100.0, 52.0], "three different ones"),
        ([0.0, 0.4, 0.6, 0.8, 1.0], [70.0] * 5, "all pressures are 70 bar"),
        ([0.0, 0.4, 0.6, 0.8, 1.0], [90.0, 70.0, 95.0, 60.0, 80.0], "may be zero"),
    ],
)
def test_what_makes_no_line_is_refused(fill: list[float], pressure: list[float], said: str) -> None:
    with pytest.raises(InputError, match=said):
        fit_weights(np.array(pressure), np.array(fill))


def _table(path: Path, head: str, rows: list[str]) -> str:
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return str(path)


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [f"{(fill + N) / M},{fill * 11.0}" for fill in (0.0, 0.3, 0.6, 0.9, 1.1)]
    table = _table(tmp_path / "w.csv", "pressure_bar,mass_t", rows)
    assert main(["loading", "calibrate", table, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["fill_per_bar"] == pytest.approx(M)
    assert found["fill_offset"] == pytest.approx(N)
    assert found["points"] == 5
    assert main(["loading", "calibrate", table]) == 0
    assert "[weighing]" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("head", "rows", "code", "said"),
    [
        ("pressure_bar,fill", ["52,0", "76,x"], 3, "line 3: 'x' is not a number"),
        ("pressure_bar,fill", ["52,0", "76,0.5"], 3, "2 weighed buckets"),
        ("p,fill", ["52,0"], 3, "pressure_bar and fill or mass_t were wanted"),
        ("pressure_bar,fill", ["52,nan"], 3, "line 2"),
        ("pressure_bar,fill", [], 3, "columns none"),
    ],
)
def test_refusals(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], head: str, rows: list[str], code: int, said: str
) -> None:
    assert main(["loading", "calibrate", _table(tmp_path / "w.csv", head, rows), "--json"]) == code
    assert said in json.loads(capsys.readouterr().out)["error"]["message"]


def test_no_file_and_no_mass(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["loading", "calibrate", str(tmp_path / "none.csv")]) == 3
    assert main(["loading", "calibrate", _table(tmp_path / "w.csv", "pressure_bar,fill", ["52,0"]), "--full", "0"]) == 2
    capsys.readouterr()
