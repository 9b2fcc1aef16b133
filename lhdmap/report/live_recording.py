"""Where the machine is, for those who follow a recording while it is written: `map/now`, over time."""

from __future__ import annotations

from lhdmap.geometry import se3
from lhdmap.messages import FloatArray
from lhdmap.report.recording import RecordingWriter
from lhdmap.report.recording_end import rerun

_ARROW_M, _COLOUR = 3.0, 0xF0C419FF


def add_pose_now(recording: RecordingWriter, stamp_ns: int, pose: FloatArray) -> None:
    """Record a pose (6,): x, y, z (m), roll, pitch, heading (rad), as an arrow ahead that carries the word «now»."""
    roll, pitch, heading = (float(angle) for angle in pose[3:])
    ahead_m = _ARROW_M * se3.from_rpy(roll, pitch, heading)[:3, 0]
    arrow = rerun().Arrows3D(origins=[pose[:3]], vectors=[ahead_m], colors=_COLOUR, labels=["now"])
    recording.add_at(stamp_ns, "map/now", arrow)
