"""The paper's own rows, pushed through the grouping, give the µ and σ that it prints."""

from __future__ import annotations

import pytest
from lhdmap.evaluation.navigation.groups import Group, grouped
from lhdmap.evaluation.navigation.paper import paper_rows, printed

UNITS = {"kmh": 0.01, "_s": 0.1, "td_": 0.1, "tad": 0.1, "cd": 1e-4, "sd": 1e-4, "w_m": 0.01}
SMOOTH = ("acd", "mcd", "asd", "msd")


def _group(operation: str, load: str) -> Group:
    return next(one for one in grouped(paper_rows()) if (one.operation, one.load) == (operation, load))


def _unit(figure: str) -> float:
    return next(unit for word, unit in UNITS.items() if word in figure)


def _agree(group: Group, line: str, values: dict[str, float]) -> None:
    found = group.mu if line.startswith("mu") else group.sigma
    for figure, value in values.items():
        assert found[figure] == pytest.approx(value, abs=_unit(figure)), (line, figure)


@pytest.mark.parametrize(
    ("name", "operation", "load", "n"),
    [("(1-14) w/E", "autonomous", "E", 7), ("(1-14) w/L", "autonomous", "L", 7), ("(M2-M4)", "manual", "E", 3)],
)
def test_table_3(name: str, operation: str, load: str, n: int) -> None:
    table, group = printed()[0], _group(operation, load)
    assert group.n == n
    for line in ("mu" + name, "sigma" + name):
        assert len(table[line]) >= 7
        _agree(group, line, table[line])


def test_sigma_is_that_of_a_sample() -> None:
    group, line = _group("autonomous", "E"), printed()[0]["sigma(1-14) w/E"]
    of_all = group.sigma["length_s"] * (6 / 7) ** 0.5
    assert abs(of_all - line["length_s"]) > 5.0
    assert group.sigma["length_s"] == pytest.approx(line["length_s"], abs=0.05)


def test_table_4() -> None:
    table = printed()[1]
    for line in ("mu(M1-M4)", "sigma(M1-M4)"):
        _agree(_group("manual", "all"), line, table[line])
    for line in ("mu(1-14)", "sigma(1-14)"):
        walls = {key: value for key, value in table[line].items() if key not in SMOOTH}
        assert len(walls) == 4
        _agree(_group("autonomous", "all"), line, walls)


def test_table_4_prints_the_smoothness_of_the_loaded_runs_as_that_of_all() -> None:
    for line in ("mu(1-14)", "sigma(1-14)"):
        smooth = {key: value for key, value in printed()[1][line].items() if key in SMOOTH}
        _agree(_group("autonomous", "L"), line, smooth)
        found = _group("autonomous", "all").mu if line.startswith("mu") else _group("autonomous", "all").sigma
        assert abs(found["msd"] - smooth["msd"]) > 0.2  # type: ignore[operator]


def test_the_mean_speed_of_the_paper_is_autonomous_distance_over_navigation_time() -> None:
    for row in paper_rows():
        if row.operation == "autonomous":
            figures = {key: value or 0.0 for key, value in row.figures.items()}
            speed = 3.6 * figures["tad_travelled_m"] / figures["navigation_s"]
            assert speed == pytest.approx(figures["mean_speed_kmh"], abs=0.02)
            parts = figures["navigation_s"] + figures["stop_s"] + figures["teleoperation_s"]
            assert parts == pytest.approx(figures["length_s"], abs=0.15)
