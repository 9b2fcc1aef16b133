from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from lhdmap.exports.export import ExportRequest, export
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.sheet import Sheet

from tests.exports.folders import control_points, map_folder

Exporter = Callable[..., Path]


@pytest.fixture
def exported(tmp_path: Path) -> Exporter:
    """Writes a map made by hand as a format and returns the file; `grid`: registered by exact control points."""

    def write(
        name: str,
        suffix: str,
        topology: TopologicalMap | None = None,
        sheets: list[Sheet] | None = None,
        *,
        grid: bool = False,
        **options: Any,
    ) -> Path:
        folder = map_folder(tmp_path / "mine_map", topology, sheets)
        points = control_points(tmp_path / "points.csv") if grid else None
        export(ExportRequest(folder, name, tmp_path / f"out{suffix}", points, **options))
        return tmp_path / f"out{suffix}"

    return write
