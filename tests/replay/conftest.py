"""Fixtures of the replays in which a machine drives itself."""

from __future__ import annotations

from pathlib import Path

import pytest
from lhdmap.config import Settings
from lhdmap.replay.assemble import parts_of

from tests.replay.short import tram


@pytest.fixture(scope="session")
def taught(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the map of the mine `short` as an operator has taught it."""
    folder = tmp_path_factory.mktemp("short")
    parts_of(tram(folder), folder, Settings())
    return folder
