"""Shows those who follow a run where the machine is, while it goes on."""

from __future__ import annotations

import numpy as np

from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.steps import OdometryStep
from lhdmap.pipeline.inspection import Inspection, Inspector
from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.report.recording_settings import Thinning

_EVERY_S = 0.2


class LiveView:
    """A `StepSink` of the mapping pipeline that is set once the pipeline is there."""

    def __init__(self, inspector: Inspector) -> None:
        self._inspector, self._thinning = inspector, Thinning(_EVERY_S)
        self.pipeline: MappingPipeline | None = None

    def take(self, stamp_ns: int, _step: OdometryStep, _odometry: PlanarOdometry) -> None:
        """Show the newest pose, a few times a second."""
        if self.pipeline is not None and len(self.pipeline.track) and self._thinning.take(stamp_ns, "now"):
            self._inspector.tell(Inspection.place, stamp_ns, np.array(self.pipeline.track.newest))
