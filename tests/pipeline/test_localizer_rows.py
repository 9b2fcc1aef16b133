"""Rows of a localizer: all of a log, the newest of a run that may last for a shift."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from lhdmap.pipeline.localizer_rows import LocalizerRows


@pytest.mark.parametrize(("newest_only", "kept"), [(False, [0, 1, 2]), (True, [2])])
def test_of_a_run_only_the_newest_row_is_kept(newest_only: bool, kept: list[int]) -> None:
    nowhere: Any = SimpleNamespace(status="unknown", probability=0.0, tracker=None)
    rows = LocalizerRows(None, None, newest_only=newest_only)  # type: ignore[arg-type]  # asked only where there is a place
    for stamp_ns in range(3):
        rows.add(stamp_ns, nowhere, nowhere, "", 0.0)
    assert [one.stamp_ns for one in rows.rows] == kept
