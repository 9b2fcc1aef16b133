"""Scenario files: what is read, what is refused and how it is told, which ones ship."""

from __future__ import annotations

from pathlib import Path

import pytest
from lhdmap.errors import ConfigError, UsageError
from lhdmap.replay.assemble import parts_of
from lhdmap.replay.scenario import Scenario, find_scenario, load_scenario, scenario_toml, shipped_scenarios
from lhdmap.simulation.ground.sections import load_ground

WHOLE = """
kind = "tram"
mine = "ring"
seed = 7
load = 4.5
route = "T1,-T2"

[limits]
time_s = 100

[[fault]]
at_s = 3
kind = "link_degraded"
target = "link"
size = 0.2
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "one.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_scenario_is_read_and_printed(tmp_path: Path) -> None:
    found = load_scenario(write(tmp_path, WHOLE))
    assert (found.mine, found.seed, found.load, found.limits.time_s) == ("ring", 7, 4.5, 100.0)
    assert found.faults[0].size == 0.2
    (tmp_path / "again.toml").write_text(scenario_toml(found), encoding="utf-8")
    assert load_scenario(tmp_path / "again.toml") == found


def test_files_beside_the_scenario_are_found(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("", encoding="utf-8")
    found = load_scenario(write(tmp_path, 'mine = "mine.toml"'), seed=4)
    assert (found.mine, found.seed) == (str(tmp_path / "mine.toml"), 4)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "mine is missing"),
        ('mine = "ring"\nsped_kmh = 3', "unknown setting 'sped_kmh'; did you mean 'speed_kmh'"),
        ('mine = "ring"\nkind = "trams"', "one of tram, loading"),
        ('mine = "ring"\nseed = -1', "outside its range"),
        ('mine = "ring"\ngoal = "A"\nroute = "T1"', "one of them was wanted"),
        ('mine = "ring"\ngoal = "A"\nmission = [{ from = "DP1", to = "OP1" }]', "one of them was wanted"),
        ('mine = "ring"\nmission = [{ from = "DP1", too = "OP1" }]', r"\[\[mission\]\] 1: unknown setting 'too'"),
        ('mine = "ring"\n[limit]\ntime_s = 3', "unknown section 'limit'; did you mean 'limits'"),
        ('mine = "ring"\n[[fault]]\nkind = "ded"', r"\[\[fault\]\] 1: unknown kind 'ded'; did you mean 'dead'"),
        ('mine = "ring"\n[[fault]]\nkind = "dead"\ntarget = "/lidar/frot/scan"', "did you mean.*'?/lidar/front/scan"),
        ('mine = "ring"\n[[fault]]\nkind = "overrun"', "wants the name of a process"),
        ('mine = "ring"\n[[fault]]\nkind = "link_lost"\ntarget = "lnk"', "did you mean 'link'"),
        ('mine = "ring"\n[[fault]]\nkind = "link_degraded"\ntarget = "link"\nsize = 2', "a share, 0 to 1"),
        ('mine = "ring"\n[[fault]]\nkind = "person"\ntarget = "link"', "'person' has none"),
        ('mine = "ring"\n[[fault]]\nkind = "dead"\ntarget = "/machine/command"', "wants a topic"),
    ],
)
def test_what_is_wrong_is_refused_with_its_place(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(ConfigError, match=told) as caught:
        load_scenario(write(tmp_path, text))
    assert "one.toml" in str(caught.value)


def test_those_that_ship_are_found_by_name_and_are_whole() -> None:
    assert {"ring_manual", "ring_faults"} <= set(shipped_scenarios())
    for name in shipped_scenarios():
        found = load_scenario(find_scenario(name))
        assert bool(found.mine) != (found.kind in ("grizzly", "haulage"))
    with pytest.raises(UsageError, match="did you mean 'ring_manual'"):
        find_scenario("ring_manul")


def test_a_kind_without_a_vehicle_has_no_parts() -> None:
    with pytest.raises(UsageError, match=r"kind = .grizzly.: this version replays"):
        parts_of(Scenario(kind="grizzly", rocks=1), Path())


def test_a_ground_is_a_file_beside_the_scenario_or_one_that_ships(tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    own.write_text("", encoding="utf-8")
    text = 'kind = "loading"\nmine = "stope"\nstart = "DP1"\n[loading]\nground = "own.toml"\n'
    assert load_scenario(write(tmp_path, text)).loading.ground == str(own)
    assert load_ground(str(own)).name == "own"
    with pytest.raises(UsageError, match="did you mean 'default'"):
        load_ground("defalt")
