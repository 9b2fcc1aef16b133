"""Warnings are said once: exact repetitions, and those that differ in a name alone."""

from __future__ import annotations

import pytest
from lhdmap.pipeline.said import said_once

MOUNT = "no mount of '{}' in the log: a level sensor at base_link is assumed"


@pytest.mark.parametrize(
    ("texts", "expected"),
    [
        ([], []),
        (["a", "b", "a"], ["a", "b"]),
        ([MOUNT.format("laser"), "b", MOUNT.format("imu")], [MOUNT.replace("'{}'", "'laser', 'imu'"), "b"]),
        ([MOUNT.format("laser"), MOUNT.format("laser")], [MOUNT.format("laser")]),
        (["'a' is not 'b'", "'a' is not 'c'"], ["'a' is not 'b'", "'a' is not 'c'"]),
        (["/front: 3 scans late", "/rear: 3 scans late"], ["/front: 3 scans late", "/rear: 3 scans late"]),
        (["the machine's 'x' is off", "the machine's 'x' is off"], ["the machine's 'x' is off"]),
    ],
)
def test_once(texts: list[str], expected: list[str]) -> None:
    assert said_once(texts) == expected
