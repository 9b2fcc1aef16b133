"""The grounds that ship: four mines that read back, within their bounds."""

from __future__ import annotations

from pathlib import Path

import pytest
from lhdmap.errors import ConfigError, InputError, UsageError
from lhdmap.resources import resource
from lhdmap.simulation.ground.sections import Grounds, ground_toml, load_ground

NAMES = sorted(path.stem for path in resource("datasets/grounds").glob("*.toml"))


def test_one_to_tune_on_and_three_held_out() -> None:
    assert len(NAMES) == 4
    assert "default" in NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_ground_reads_back(name: str, tmp_path: Path) -> None:
    ground = load_ground(name)
    assert ground.name == name
    path = tmp_path / f"{name}.toml"
    path.write_text(ground_toml(ground), encoding="utf-8")
    assert load_ground(path) == ground
    assert resource(f"datasets/grounds/{name}.toml").read_text(encoding="utf-8") == ground_toml(ground)


def test_mines_differ() -> None:
    grounds = [load_ground(name).rock for name in NAMES]
    assert max(one.hardness for one in grounds) > 1.5 * min(one.hardness for one in grounds)


def test_what_is_wrong_is_told(tmp_path: Path) -> None:
    path = tmp_path / "ground.toml"
    path.write_text("[rock]\nhardnes = 2.0\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="hardness"):
        load_ground(path)
    path.write_text("[rock]\nhardness = -2.0\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="outside its range"):
        load_ground(path)
    with pytest.raises(InputError):
        load_ground(tmp_path / "none.toml")
    with pytest.raises(UsageError):
        load_ground("nowhere")
    assert load_ground("default") != Grounds("other")
