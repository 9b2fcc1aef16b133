"""`lhdmap rockbreaker` and `lhdmap eval rockbreaker` as a user types them."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.cli.main import main
from lhdmap.evaluation import rockbreaker as paper
from lhdmap.rockbreaker.plan import Planner

from tests.report.test_page import svgs
from tests.report.test_page import words as words_of

T1 = ["--from", "2.20,2.15,-1", "--to", "6.27,-2.15,-1"]
KEYS = (
    *("feasible", "reason", "path", "timing", "duration_s", "t_r_s", "limiting", "limit_reached_at_s", "pump_volume_l"),
    *("bound_s", "phi_from_deg", "phi_to_deg", "max_flow_ratio", "planning_ms", "csv"),
)
COLUMNS = [
    *("t_s", "sigma", "sigma_dot", "theta1_deg", "theta2_deg", "theta3_deg", "theta4_deg"),
    *("rho0_m", "rho1_m", "rho2_m", "rho3_m", "rho4_m", "x_m", "y_m", "z_m", "phi_deg", "q1", "q2", "q3", "q4", "qp"),
    *("q1_l_per_min", "q2_l_per_min", "q3_l_per_min", "q4_l_per_min", "qp_l_per_min"),
]


def told(words: list[str], capsys: pytest.CaptureFixture[str], exit_code: int = 0) -> dict[str, Any]:
    """Run a command with --json and return its object."""
    assert main([*words, "--json"]) == exit_code
    values: dict[str, Any] = json.loads(capsys.readouterr().out)
    return values


def test_a_plan_says_all_that_is_promised_and_writes_its_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["rockbreaker", "plan", *T1, "--phi-from", "270", "--phi-to", "293.6", "-o", str(tmp_path / "plan")]
    values = told(words, capsys)
    assert set(KEYS) <= set(values)
    assert values["feasible"]
    assert values["reason"] is None
    assert values["duration_s"] == pytest.approx(20.26, abs=0.05)
    assert values["t_r_s"] == pytest.approx(1.0, abs=1e-4)
    assert values["limiting"] == "Q3"
    assert values["pump_volume_l"] == pytest.approx(26.13, abs=0.03)
    assert values["bound_s"] == pytest.approx(12.59, abs=0.005)
    with Path(values["csv"]).open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == COLUMNS
    assert float(rows[-1]["t_s"]) == pytest.approx(values["duration_s"], abs=1e-6)
    assert [float(rows[-1][name]) for name in ("x_m", "y_m", "z_m")] == pytest.approx([6.27, -2.15, -1.0], abs=1e-6)
    assert float(rows[0]["theta1_deg"]) == pytest.approx(44.3415, abs=1e-4)
    assert float(rows[-1]["phi_deg"]) == pytest.approx(293.6, abs=1e-6)
    assert max(float(row["q3"]) for row in rows) == pytest.approx(1.0, abs=2e-3)
    litres = np.trapezoid([float(row["qp_l_per_min"]) / 60.0 for row in rows], [float(row["t_s"]) for row in rows])
    assert litres == pytest.approx(values["pump_volume_l"], rel=1e-3)
    names = {path.name for path in (tmp_path / "plan").iterdir()}
    assert {"plan.json", "trajectory.csv", "report.html", "recording.rrd"} <= names
    page = (tmp_path / "plan" / "report.html").read_text(encoding="utf-8")
    assert page.count("<img") == 7
    assert "L/min, flow of the pump" in page
    plan = json.loads((tmp_path / "plan" / "plan.json").read_text(encoding="utf-8"))
    assert plan["csv"] == "trajectory.csv"
    assert list(plan["csv_columns"]) == COLUMNS
    assert str(tmp_path) not in json.dumps(plan)


def test_what_cannot_be_planned_says_why_and_ends_with_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "rockbreaker",
        "plan",
        "--from",
        "2.2,2.15,-1",
        "--to",
        "9,0,0",
        "-o",
        str(tmp_path / "plan"),
        "--no-pictures",
    ]
    values = told(words, capsys, exit_code=1)
    assert not values["feasible"]
    assert values["reason"]["joint"] == "reach"
    assert values["reason"]["sigma"] == 1.0
    assert values["csv"] is None
    assert values["duration_s"] is None
    assert values["error"] == {
        "kind": "shortfall",
        "message": f"not feasible: {values['reason']['text']}",
        "exit_code": 1,
    }
    assert main(words) == 2
    assert "--force" in capsys.readouterr().err
    assert main([*words, "--force"]) == 1
    assert "not feasible" in capsys.readouterr().out


def test_measured_cylinders_are_a_start(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["rockbreaker", "plan", "--from-cylinders", "1.44001,2.49193,2.50731,2.08847", "--to", "6.27,-2.15,-1"]
    values = told([*words, "-o", str(tmp_path / "plan"), "--no-pictures"], capsys)
    assert values["from_m"] == pytest.approx([2.2, 2.15, -1.0], abs=1e-3)
    assert values["phi_from_deg"] == pytest.approx(270.0, abs=0.01)


def test_from_a_cloud_to_the_rock_in_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cloud = tmp_path / "grizzly.ply"
    scene = told(["simulate", "grizzly", "--seed", "2", "-o", str(cloud)], capsys)
    largest = max(scene["rocks"], key=lambda rock: float(rock["size_m"]))
    asked = ["rockbreaker", "plan", "--cloud", str(cloud), "--timing", "smooth", "-o", str(tmp_path / "plan")]
    values = told(asked, capsys)
    assert values["rock"]["top_m"][:2] == pytest.approx(largest["top_m"][:2], abs=0.15)
    assert "oversize" in values["rock"]["why"]
    assert len(values["steps"]) == 2
    way, side, over_time = (
        words_of(picture) for picture in svgs((tmp_path / "plan" / "report.html").read_text("utf-8"))[:3]
    )
    for text in ("step 1, straight", "step 2", f"target, {values['rock']['size_m']:.2f} m", "falls through"):
        assert text in way
    for text in ("bars of the grizzly", "target", "step 1", "step 2", "distance from the swing axis, m"):
        assert text in side
    assert "step 1" in over_time
    assert "step 2" in over_time
    assert values["duration_s"] == pytest.approx(sum(step["duration_s"] for step in values["steps"]))
    assert values["clearance_m"] > 0.0
    bound = told([*asked, "--path", "cslm", "--timing", "limit", "--no-pictures", "--force"], capsys)
    assert bound["limit_reached_at_s"] > 0.0
    assert main(["rockbreaker", "plan", "--cloud", str(cloud), "--no-pictures", "-o", str(tmp_path / "other")]) == 0
    assert "oversize" in capsys.readouterr().out


def test_a_machine_that_stands_elsewhere_in_the_cloud_finds_the_same_rock(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    machine = tmp_path / "elsewhere.toml"
    machine.write_text("[base]\nposition_m = [120.0, -45.0, 7.5]\nyaw_deg = 130.0\n", encoding="utf-8")
    plans = []
    for number, words in enumerate(([], ["--machine", str(machine)])):
        cloud = tmp_path / f"grizzly{number}.ply"
        told(["simulate", "grizzly", "--seed", "2", *words, "-o", str(cloud)], capsys)
        asked = [
            "rockbreaker",
            "plan",
            "--cloud",
            str(cloud),
            *words,
            "--no-pictures",
            "-o",
            str(tmp_path / f"{number}"),
        ]
        plans.append(told(asked, capsys))
    assert plans[1]["rock"]["top_m"] == pytest.approx(plans[0]["rock"]["top_m"], abs=0.05)
    assert plans[1]["duration_s"] == pytest.approx(plans[0]["duration_s"], rel=0.02)


def test_a_grizzly_without_large_rocks_ends_with_1_and_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    machine = tmp_path / "wide.toml"
    machine.write_text("[grizzly]\nopening_m = 2.0\n", encoding="utf-8")
    cloud = tmp_path / "grizzly.ply"
    told(["simulate", "grizzly", "--seed", "2", "-o", str(cloud)], capsys)
    words = ["rockbreaker", "plan", "--cloud", str(cloud), "--machine", str(machine), "-o", str(tmp_path / "plan")]
    values = told(words, capsys, exit_code=1)
    assert "no oversize rock" in values["reason"]["text"]


def test_the_workspace_and_the_orientations_at_a_point(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["rockbreaker", "workspace", "--at", "6.27,2.15,-1", "-o", str(tmp_path / "space")]
    values = told(words, capsys)
    assert (values["phi_min_deg"], values["phi_max_deg"]) == pytest.approx((292.719, 331.542), abs=0.01)
    assert values["theta_limits_deg"][0] == pytest.approx([-73.232, 73.232], abs=1e-3)
    assert 0.0 < values["vertical_area_m2"] < values["area_m2"]
    assert "<img" in (tmp_path / "space" / "report.html").read_text(encoding="utf-8")
    assert main(["rockbreaker", "workspace", "--at", "9,0,0", "--no-pictures"]) == 1
    assert "cannot be there" in capsys.readouterr().out


def test_eval_prints_the_paper_beside_the_result(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    table = paper.regenerate(Planner())
    monkeypatch.setattr(paper, "regenerate", lambda _: table)  # it takes seconds, and is wanted twice
    assert main(["eval", "rockbreaker"]) == 0
    text = capsys.readouterr().out
    assert "292.72" in text
    assert "MISSED" not in text
    values = told(["eval", "rockbreaker"], capsys)
    row = next(
        row for row in values["rows"] if (row["trajectory"], row["path"], row["timing"]) == ("T2", "cslm", "paper")
    )
    assert row["paper_s"] == 50.0
    assert row["duration_s"] == pytest.approx(49.62, abs=0.05)
    assert {"phi_given", "target_s", "ok"} <= set(row)


@pytest.mark.parametrize(
    ("words", "exit_code", "expected"),
    [
        ("plan --from 2,2,-1", 2, "--cloud"),
        ("plan --from 2,2 --to 6,0,-1", 2, "3 numbers were wanted, 2 were found"),
        ("plan --from 2,2,nan --to 6,0,-1", 2, "finite"),
        ("plan --from a,b,c --to 6,0,-1", 2, "--from"),
        ("plan --from 2,2,-1 --from-cylinders 1.4,2.4,2.5,2.0 --to 6,0,-1", 2, "--from-cylinders"),
        ("plan --from-cylinders 9,2.4,2.5,2.0 --to 6,0,-1", 2, "pins"),
        ("plan --from-cylinders 1.4,2.4,2.5,2.0 --phi-from 250 --to 6,0,-1", 2, "--phi-from"),
        ("plan --from= --to 6,0,-1", 2, "--from"),
        ("plan --to=", 2, "--to"),
        ("workspace --at=", 2, "--at"),
        ("plan --to 6,0,-1 --set rockbreaker.min_ramp=2", 2, "did you mean 'min_ramp_s'"),
        ("plan --to 6,0,-1 --machine none.toml", 3, "none.toml"),
        ("plan --cloud none.ply", 3, "none.ply"),
        ("plan --to 6,0,-1 --obstacles none.toml", 3, "none.toml"),
        ("workspace --at 1,2", 2, "--at"),
        ("", 2, "TASK"),
    ],
)
def test_refusals(words: str, exit_code: int, expected: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rockbreaker", *words.split()]) == exit_code
    assert expected in capsys.readouterr().err


def test_a_simulated_grizzly_goes_into_a_new_folder_and_over_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud = tmp_path / "new" / "grizzly.ply"
    assert main(["simulate", "grizzly", "--seed", "4", "-o", str(cloud)]) == 0
    assert cloud.stat().st_size > 100_000
    assert main(["simulate", "grizzly", "--seed", "4", "-o", str(cloud)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["simulate", "grizzly", "--seed", "-1", "-o", str(tmp_path / "other.ply")]) == 2
    assert "--seed -1" in capsys.readouterr().err
