"""What goes into a recording and how it is drawn: settings, scans by their stamps, styles of paths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from lhdmap.settings import setting


class PathStyle(NamedTuple):
    """How a path is drawn: its name, its colour (in a word, and as 0xRRGGBBAA), and at which share of it the name stands."""

    label: str
    colour: str
    rgba: int
    label_at: float


@dataclass(frozen=True, slots=True)
class RecordingSettings:
    """What of a run goes into its Rerun recording."""

    scan_interval_s: float = setting(
        0.5, unit="s", minimum=0.0, maximum=60.0, doc="Time between the scans that are recorded; 0 records each."
    )
    cloud_parts: int = setting(90, unit="parts", minimum=1, maximum=1000, doc="Parts in which the cloud appears.")
    height_window_m: float = setting(
        4.0, unit="m", minimum=0.1, maximum=100.0, doc="Height over the floor that the colours of the cloud span."
    )
    point_size_px: float = setting(1.5, unit="px", minimum=0.1, maximum=20.0, doc="Size of a cloud point on screen.")


class Thinning:
    """Which scans go into a recording: of each name one in `interval_s`."""

    def __init__(self, interval_s: float = RecordingSettings().scan_interval_s) -> None:
        self._interval_ns = round(interval_s * 1e9)
        self._next_ns: dict[str, int] = {}

    def wants(self, stamp_ns: int, name: str) -> bool:
        """Return whether a scan of this stamp is due."""
        return stamp_ns >= self._next_ns.get(name, stamp_ns)

    def take(self, stamp_ns: int, name: str) -> bool:
        """Return whether a scan of this stamp is due; if so, it is taken for recorded."""
        due = self.wants(stamp_ns, name)
        if due:
            self._next_ns[name] = stamp_ns + self._interval_ns
        return due
