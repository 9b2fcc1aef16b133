"""What is no map is refused, whatever the log was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.messages import LaserScan
from lhdmap.pipeline.build import BuildRequest, build_map

from tests.logs import drives


def _refused(log: Path, words: str) -> None:
    with pytest.raises(InputError, match=words):
        build_map(BuildRequest([log], log.with_name("map")))
    assert not log.with_name("map").exists()


def test_one_scan_is_no_drive(tmp_path: Path) -> None:
    _refused(drives.write(tmp_path / "log.mcap", scans=1), "one scan only")


def test_key_scans_without_times_are_refused(tmp_path: Path) -> None:
    log = drives.write(tmp_path / "log.mcap", lambda _, scan: scan._replace(stamp_ns=0), lambda _: drives.START_NS)
    _refused(log, "150 scans without usable times")


def test_scans_of_which_none_fits_are_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)

    def elsewhere(_: int, scan: LaserScan) -> LaserScan:
        return scan._replace(ranges_m=rng.uniform(2.0, 40.0, len(scan.ranges_m)).astype(np.float32))

    _refused(drives.write(tmp_path / "log.mcap", elsewhere), "no scan fitted")


def test_key_scans_of_real_logs(shared_data: Path, tmp_path: Path) -> None:
    """Two have no times and are refused, three are too far apart and say so."""
    folder = shared_data / "06_corrected_keyscans"
    with pytest.raises(InputError, match="without usable times"):
        build_map(BuildRequest([folder / "orebro-corrected.log.gz"], tmp_path / "a"))
    found = build_map(BuildRequest([folder / "seattle-corrected.log.gz"], tmp_path / "b"))
    assert any("key scans are too far apart" in text for text in found.warnings)
