"""Cloud files by suffix: PLY, PCD, LAS and LAZ."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lhdmap.errors import InputError, UsageError
from lhdmap.integration import laz, pcd, ply
from lhdmap.integration.cloud import GridCloud

READERS: dict[str, Callable[[Path], GridCloud]] = {
    ".ply": ply.read_ply,
    ".pcd": pcd.read_pcd,
    ".las": laz.read_laz,
    ".laz": laz.read_laz,
}
WRITERS: dict[str, Callable[[Path, GridCloud], None]] = {
    ".ply": ply.write_ply,
    ".pcd": pcd.write_pcd,
    ".las": laz.write_laz,
    ".laz": laz.write_laz,
}


def read_cloud(path: Path) -> GridCloud:
    """Return the cloud of a PLY, PCD, LAS or LAZ file; points that are not finite are left out.

    Raises:
        InputError: the file is missing, of an unknown kind, cut off or damaged.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: a cloud file was wanted, one of {', '.join(READERS)}")
    try:
        return reader(path)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error


def write_cloud(path: Path, cloud: GridCloud) -> None:
    """Write a cloud in the format of the suffix.

    Raises:
        UsageError: the suffix is of no format that can be written.
    """
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        raise UsageError(f"{path}: the suffix must be one of {', '.join(WRITERS)}")
    writer(path, cloud)
