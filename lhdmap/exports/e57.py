"""The cloud as ASTM E57, for survey software: one scan, its pose holds the origin that the coordinates are about.

Points are stored in single precision about that origin, so their millimetres are kept in the mine's grid, too.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.errors import InputError
from lhdmap.exports.content import Content
from lhdmap.extras import library
from lhdmap.names import in_utf8

_UNTURNED = np.array([1.0, 0.0, 0.0, 0.0])  # w, x, y, z


def write(content: Content, path: Path, at: Callable[[Path], Path]) -> dict[str, Any]:
    """Write the points, without normals: the library's writer has no field for them.

    Raises:
        InputError: there is no point.
    """
    cloud = content.cloud
    if not len(cloud):
        raise InputError(f"{content.folder.path}: there is no point in its cloud, and E57 has no scan without one")
    columns = {f"cartesian{axis}": cloud.points_m[:, k].astype(np.float64) for k, axis in enumerate("XYZ")}
    with in_utf8(at(path)) as written:
        file = library("pye57").E57(str(written), mode="w")
        file.write_scan_raw(columns, name=content.frame, rotation=_UNTURNED, translation=np.array(cloud.origin_m))
        file.close()
    return {"points": len(cloud)}
