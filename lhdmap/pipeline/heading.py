"""The gyroscope's part in the final path: how it turns the headings that realignment left."""

from __future__ import annotations

import numpy as np

from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.pipeline.track import TrackRows
from lhdmap.smoothing.heading import GyroNoise, Path, fused_heading, moves_of
from lhdmap.smoothing.smoother import Correction

_PLANAR = [0, 1, 5]  # of a pose: x, y, heading


def gyro_correction(pipeline: MappingPipeline, rows: TrackRows) -> Correction | None:
    """Return how the gyroscope moves the path `rows`, None where there is none or the scans contradict it (a warning says so)."""
    if not len(pipeline.evidence.turns) or len(rows.times_ns) < 2:
        return None
    settings = pipeline.settings.gyro
    noise = GyroNoise.of(
        pipeline.front_end.inclinometer.gyro.noise_deg_sqrt_h, settings.bias_deg_h, settings.bias_walk_deg_h
    )
    path = Path(rows.times_ns, rows.poses[:, _PLANAR])
    found = fused_heading(path, pipeline.evidence.turns.at(rows.times_ns), noise)
    if isinstance(found, str):
        pipeline.evidence.told.extend([found] if found else [])
        return None
    if found.left_out > 0.0:
        share = f"{100.0 * found.left_out:.1f} %"
        pipeline.evidence.told.append(f"gyroscope: it contradicts the scans over {share} of the drive; left out there")
    left = np.column_stack([found.share, np.full(len(found.share), found.bias_std_rps) * (1.0 - found.share)])
    return Correction(rows.times_ns, moves_of(path, found.turned_rad), 0, left=left)
