"""Fixtures of the replays in which a machine drives itself."""

from __future__ import annotations

from pathlib import Path

import pytest
from lhdmap.config import Settings
from lhdmap.replay.assemble import parts_of

from tests.replay.tiny import PLAN, tram


@pytest.fixture(scope="session")
def taught(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a plan, and its map as an operator has taught it."""
    folder = tmp_path_factory.mktemp("tiny")
    (folder / "tiny.toml").write_text(PLAN, encoding="utf-8")
    parts_of(tram(folder), folder, Settings())
    return folder
