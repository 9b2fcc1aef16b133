"""What the page of a loading is drawn from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lhdmap.messages import FloatArray

COLUMNS = (
    "time_s", "propel", "tilt", "lift", "bucket_rad", "boom_rad", "transmission_bar", "lift_bar", "tilt_bar", "tacho_mps",
    "scan_mps", "skid", "fill", "fill_true", "embed_m",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class LoadData:
    """Signals of a machine that loads: `rows` (N, 15) of `COLUMNS`; the last two are the simulator's truth.

    `piles`: when an estimate of a pile was made, and points of its face (M, 3) in the frame of the truth.
    """

    rows: FloatArray
    piles: Sequence[tuple[int, FloatArray]] = ()

    def column(self, name: str) -> FloatArray:
        """Return a column by its name, shape (N,)."""
        values: FloatArray = self.rows[:, COLUMNS.index(name)]
        return values
