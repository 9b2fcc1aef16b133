"""What a run comes to: cloud, pile, figures and warnings, for all files of the map folder."""

from __future__ import annotations

import contextlib
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np

from lhdmap.config import settings_toml
from lhdmap.errors import InputError
from lhdmap.integration.cloud import GridCloud
from lhdmap.landmarks.model import Landmarks
from lhdmap.logs.source import LogSource
from lhdmap.names import name_of
from lhdmap.pile.result import PileReport
from lhdmap.pipeline.again import integrate_again
from lhdmap.pipeline.beside import HelperDied
from lhdmap.pipeline.closures import closure_rows
from lhdmap.pipeline.driven import DrivenPaths
from lhdmap.pipeline.identify import identify_along
from lhdmap.pipeline.inputs import Inputs
from lhdmap.pipeline.landmarks import landmarks_for, with_stretches
from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.pipeline.pile import NO_FRONT, NO_INCLINOMETER, OFF, PileSink
from lhdmap.pipeline.remarks import (
    given_of,
    holes_of,
    odd_of_the_pile,
    odd_of_the_run,
    poses_name,
    remarks_of,
    topic_rows,
    witness_of,
)
from lhdmap.pipeline.said import said_once
from lhdmap.pipeline.topology import counts_of, seen_of
from lhdmap.report.bounded import bounded
from lhdmap.report.data import ReportData, Summary
from lhdmap.report.recording_end import left_out
from lhdmap.smoothing.trust import expected_error
from lhdmap.topology.build import Topology, topology_of
from lhdmap.topology.points import with_piles


class MapOutcome:
    """Cloud, pile, figures and warnings of a run.

    Raises:
        InputError: the scans hold no hit at all.
    """

    def __init__(self, inputs: Inputs, source: LogSource, pipeline: MappingPipeline, ways: DrivenPaths) -> None:
        self.pipeline, self.ways = pipeline, ways
        self._inputs, self._source = inputs, source
        rows = ways.rows
        if ways.moved:
            pipeline.sweeps.forget()  # two clouds at a time would take twice the memory
        with ThreadPoolExecutor(1, "landmarks") as beside:  # they are compared while the scans are read once more
            found = self._topology(beside)
            sweeps = integrate_again(inputs, pipeline, rows, source.survey) if ways.moved else pipeline.sweeps
            self.cloud: GridCloud = sweeps.cloud()
        of_sweeps = sweeps.warnings
        sweeps.forget()
        distance_m = float(np.linalg.norm(np.diff(rows.poses[:, :3], axis=0), axis=1).sum())
        if not len(self.cloud.points_m) and pipeline.records.degenerate_share == 1.0:
            raise InputError(f"{source.paths[0]}: its scans hold no hit; lhdmap doctor tells what is wrong")
        self.pile_reason = self._no_pile()
        self.pile = None if self.pile_reason else self._pile(pipeline.pile)
        self.topology, self.landmarks = self._with_landmarks(*found)
        told = [*source.warnings, *source.damage, *odd_of_the_run(pipeline, inputs), *of_sweeps]
        told += holes_of(rows) if inputs.poses else remarks_of(pipeline)
        self.warnings = said_once([*told, *odd_of_the_pile(self.pile), *left_out()])
        stamps, records = ways.odometry.stamps_ns, pipeline.records
        self.duration_s = source.duration_s or float(stamps[-1] - stamps[0]) * 1e-9
        self.summary: dict[str, Any] = {
            "expected_error": None if inputs.poses else self._expected_error(distance_m),
            "scans": len(stamps),
            "scans_processed": records.processed,
            "duration_s": self.duration_s,
            "distance_m": distance_m,
            "poses": inputs.poses or None,
            "degenerate_share": None if inputs.poses else records.degenerate_share,
            "lost_stretches": 0 if inputs.poses else records.lost_stretches,
            "closures": ways.closures,
            "topology": None if self.topology is None else counts_of(self.topology),
            "pile": None if self.pile is None else self.pile.estimate.status,
            "pile_reason": self.pile_reason or (None if self.pile is None else self.pile.estimate.reason or None),
        }

    def _expected_error(self, distance_m: float) -> dict[str, Any] | None:
        """Return how far the map may be off at its end; None of clouds of a 3D scanner, whose drift nobody measures."""
        pipeline = self.pipeline
        height_std_m = (
            pipeline.front_end.inclinometer.attitude.height_std_m(distance_m) if pipeline.has_inclinometer else None
        )
        if height_std_m is not None and self.ways.end_height_std_m is not None:
            height_std_m = min(height_std_m, self.ways.end_height_std_m)
        found = expected_error(pipeline.evidence.smoother.keys, height_std_m, self.ways.end_covariance)
        return None if found is None else found._asdict()

    def _no_pile(self) -> str:
        """Return why no pile is looked for; empty where one is."""
        if self._inputs.settings.pile.method == "off":
            return OFF
        if self.pipeline.pile is None:
            return NO_FRONT
        return "" if self.pipeline.has_inclinometer or self._inputs.poses else NO_INCLINOMETER

    def _pile(self, stage: PileSink | None) -> PileReport:
        """Return what is said of the pile, on the final poses."""
        inputs = self._inputs
        if stage is not None and not self.ways.moved:
            with contextlib.suppress(HelperDied):  # looked for anew below, and told of when the report is written
                return self.pipeline.path.moved(stage.report())
        return identify_along(
            self.ways.rows, inputs.logs, inputs.settings, self.pipeline.machine, inputs.topics, inputs.window_ns
        )

    def _topology(self, beside: Executor) -> tuple[Topology | None, Future[Landmarks] | None]:
        """Return the topological map, None where it is not wanted or no planar scanner saw the drift, and landmarks to come."""
        settings = self._inputs.settings
        if settings.topology.method == "off" or not len(self.pipeline.evidence.views):
            return None, None
        seen = seen_of(self.pipeline, self.ways.rows)
        topology = topology_of(seen, settings.topology, self._inputs.edits)
        return topology, beside.submit(landmarks_for, topology.map, seen, settings.landmarks)

    def _with_landmarks(
        self, topology: Topology | None, coming: Future[Landmarks] | None
    ) -> tuple[Topology | None, Landmarks | None]:
        """Return the map with what landmarks and piles tell of it, and the landmarks."""
        if topology is None or coming is None:
            return None, None
        landmarks = coming.result()
        whole = with_stretches(topology.map, landmarks, self._inputs.settings.landmarks)
        piles = [] if self.pile is None else self.pile.middles_m()
        return topology._replace(map=with_piles(whole, piles)), landmarks

    def report(self) -> ReportData:
        """Return the data of the HTML page and of the recording."""
        records, inputs = self.pipeline.records, self._inputs
        data = ReportData(
            title=inputs.title,
            summary=Summary(**{key: value for key, value in self.summary.items() if key in Summary.__slots__}),
            topics=topic_rows(self._source, inputs),
            trajectory=self.ways.final,
            cloud=self.cloud,
            articulation=records.articulation(),
            has_inclinometer=self.pipeline.has_inclinometer,
            pile=self.pile,
            pile_reason=self.pile_reason,
            topology=None if self.topology is None else self.topology.map,
            landmarks=self.landmarks,
            landmark_settings=inputs.settings.landmarks,
            sheets=() if self.topology is None else self.topology.sheets,
            closures=closure_rows(self.pipeline.evidence.smoother.evidence, self.ways.rows),
            warnings=self.warnings,
            settings_text=settings_toml(inputs.settings),
            provenance={"log": ", ".join(name_of(path) for path in inputs.logs)} | given_of(inputs),
            poses=poses_name(inputs),
        )
        if not inputs.poses:  # else what the scans say of the motion took no part
            data = replace(
                data,
                odometry=self.ways.odometry,
                diagnostics=records.diagnostics(),
                odometry_speed=records.speed(),
                tachometer_speed=records.tachometer(),
                witness=witness_of(self.pipeline),
            )
        return bounded(data)
