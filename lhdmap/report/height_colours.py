"""Colours of points by their height over the floor."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lhdmap.messages import Float32Array, FloatArray

_VIRIDIS = np.array([[59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]], dtype=float)


def height_colours(
    heights_m: Float32Array,
    stamps_ns: npt.NDArray[np.int64],
    floor: tuple[npt.NDArray[np.int64], FloatArray] | None,
    window_m: float,
) -> npt.NDArray[np.uint32]:
    """Return RGBA of heights (N,) over the floor at the stamps (N,): its stamps and heights (M,), else the lowest point.

    `window_m`: height over the floor that the colours span.
    """
    at = heights_m.min() if floor is None else np.interp(stamps_ns, *floor)
    above = np.asarray(heights_m - at)
    share = np.clip(above / window_m, 0.0, 1.0) if np.ptp(above) > 0.05 else 0.6 + 0.0 * above
    return _palette()[(255 * share).astype(np.int64)]


def _palette() -> npt.NDArray[np.uint32]:
    """Return 256 colours as 0xRRGGBBAA: viridis without its dark end, which the viewer's ground would swallow."""
    steps = np.linspace(0, len(_VIRIDIS) - 1, 256)
    r, g, b = (np.interp(steps, range(len(_VIRIDIS)), _VIRIDIS[:, i]).astype(np.uint32) for i in range(3))
    return r << 24 | g << 16 | b << 8 | np.uint32(255)
