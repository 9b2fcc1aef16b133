"""Machine files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import ConfigError, InputError
from lhdmap.machine import Machine, load_machine, machine_toml
from lhdmap.resources import resource


def test_the_shipped_file_is_the_default() -> None:
    assert load_machine(resource("pipelines/machines/lhd_11t.toml")) == load_machine() == Machine()


def test_a_machine_survives_its_file(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(machine_toml(Machine()), encoding="utf-8")
    assert load_machine(path) == Machine()


def test_the_bodies_have_the_papers_outline() -> None:
    machine = Machine()
    front, rear = machine.boxes("base_link"), machine.boxes("rear_link")
    length = front[:, 1, 0].max() + machine.dimensions.wheelbase_m - rear[:, 0, 0].min()
    assert length == pytest.approx(machine.dimensions.length_m, abs=0.01)
    boxes = np.concatenate([front, rear])
    assert np.ptp(boxes[:, :, 1]) == pytest.approx(machine.dimensions.width_m, abs=0.01)
    assert boxes[:, 1, 2].max() == pytest.approx(machine.dimensions.height_m)


def test_the_rear_scanner_looks_back_and_both_look_down() -> None:
    for name, forward in (("lidar_front", 1.0), ("lidar_rear", -1.0)):
        axis = Machine().mounts[name].T_parent_sensor[:3, 0]
        assert axis[0] * forward > 0.99
        assert axis[2] == pytest.approx(-np.sin(np.radians(2.5)))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[dimensions]\njoint_to_front_axel_m = 2.0", "joint_to_front_axle_m"),
        ("[dimensions]\nlength_m = 'long'", "float"),
        ("[bodies.x]", "body"),
        ("[body.x]\nmin_m = [1, 0, 0]\nmax_m = [0, 1, 1]", "min_m"),
        ("[mount.x]\nparent = 'odom'", "rear_link"),
    ],
)
def test_a_wrong_file_says_what_is_wrong(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=words) as error:
        load_machine(path)
    assert str(path) in str(error.value)


def test_a_missing_file_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nothing\.toml"):
        load_machine(tmp_path / "nothing.toml")
