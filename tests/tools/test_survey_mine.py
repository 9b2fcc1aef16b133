"""A plan of a surveyed mine, made of a rough one: lines in the middle of the drift, widths as they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from lhdmap.mine.plan import load_plan
from lhdmap.simulation.mesh_file import write_ply
from tools.survey_mine import make_plan

from tests.simulation.mine_world.boxes import HALF_M, tunnel


def test_a_rough_line_is_put_in_the_middle(tmp_path: Path) -> None:
    write_ply(tmp_path / "drift.ply", [tunnel()])
    rough, out = tmp_path / "rough.toml", tmp_path / "out.toml"
    rough.write_text(
        '[surface]\nfile = "drift.ply"\nkind = "mesh"\n'
        '[[drift]]\nname = "A"\nline_m = [[3, 0, 0.3], [20, 0.9, 0.4], [37, 0, 0.3]]\n',
        encoding="utf-8",
    )
    make_plan(rough, out)
    line = np.array(load_plan(out).drifts[0].line_m)
    assert np.abs(line[:, 1]).max() < 0.12  # it was off by 0.9 m
    assert np.abs(line[:, 2]).max() < 0.02
    widths = np.array(load_plan(out).drifts[0].width_m)[:, 1]
    assert np.abs(widths - 2.0 * HALF_M).max() < 0.2
