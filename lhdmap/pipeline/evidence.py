"""What a drive leaves for the steps after it: loop closure, the final heading, the topology and its names."""

from __future__ import annotations

from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.smoother import Smoother
from lhdmap.smoothing.turns import Turns
from lhdmap.topology.views import Views


class DriveEvidence:
    """Key scans (of the `smoother`), `turns` by the gyroscope where there is one, `views` of the drift, and names.

    `said`: names of nodes, each where the operator begins to say it; `told`: what came out once the drive was over, in words.
    """

    def __init__(self, settings: SmoothingSettings) -> None:
        self.smoother = Smoother(settings)
        self.turns = Turns()
        self.views = Views()  # for the free space that the topology is found in
        self.said: list[tuple[int, str]] = []
        self.told: list[str] = []

    def say(self, time_ns: int, name: str) -> None:
        """Take the name of the node that the machine is in; it is repeated while it is there."""
        if not self.said or self.said[-1][1] != name:
            self.said.append((time_ns, name))
