"""A cloud from above as a small picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from lhdmap.messages import FloatArray

_LONGEST_PX = 1400


def top_view(points_m: FloatArray, path_m: FloatArray, target: Path) -> None:
    """Write a PNG: points (N, 2+) dark on white, the path (M, 2+) in red, a bar of 10 m at the lower left."""
    low = np.minimum(points_m[:, :2].min(0), path_m[:, :2].min(0)) - 1.0
    high = np.maximum(points_m[:, :2].max(0), path_m[:, :2].max(0)) + 1.0
    scale = _LONGEST_PX / float((high - low).max())
    width, height = (np.ceil((high - low) * scale).astype(int) + 1).tolist()
    canvas = np.full((height, width, 3), 255, dtype=np.uint8)
    for xy, colour in ((points_m, (40, 40, 60)), (path_m, (220, 40, 40))):
        column, row = ((xy[:, :2] - low) * scale).astype(int).T
        canvas[height - 1 - row, column] = colour
    canvas[height - 12 : height - 8, 10 : 10 + round(10.0 * scale)] = (0, 120, 0)
    target.parent.mkdir(parents=True, exist_ok=True)
    from PIL import Image

    # a palette takes a quarter of the space
    Image.fromarray(canvas).quantize(8).save(target, optimize=True)
