"""The map of a drift, and logs of drives that come later; made once."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest
from lhdmap.pipeline.build import BuildRequest, build_map
from lhdmap.pipeline.update import UpdateRequest, UpdateResult, update_map

from tests.update.drives import first_way, mine, second_way, write_drive


class Updated(NamedTuple):
    """The map of the drift, the log of a drive into a tunnel that was not there, and what both together came to."""

    before: Path
    log: Path
    result: UpdateResult


@pytest.fixture(scope="session")
def drift_map(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drift")
    log = write_drive(folder / "first.mcap", mine(branch=False), first_way(), 1)
    return build_map(BuildRequest([log], folder / "mine_map")).folder


@pytest.fixture(scope="session")
def branch_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_drive(tmp_path_factory.mktemp("branch") / "second.mcap", mine(branch=True), second_way(), 2)


@pytest.fixture(scope="session")
def updated(drift_map: Path, branch_log: Path, tmp_path_factory: pytest.TempPathFactory) -> Updated:
    target = tmp_path_factory.mktemp("updated") / "mine_map_v2"
    return Updated(drift_map, branch_log, update_map(UpdateRequest(drift_map, [branch_log], target)))
