"""What a run comes to: the ways that were driven, then cloud, pile, figures and warnings, for all files of the map folder."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.config import Settings, settings_toml
from lhdmap.errors import InputError
from lhdmap.integration.cloud import Cloud
from lhdmap.landmarks.model import Landmarks
from lhdmap.logs.source import LogSource
from lhdmap.logs.survey import Survey
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, Joints, LaserScan, PointCloud
from lhdmap.names import name_of
from lhdmap.pile.result import PileReport
from lhdmap.pipeline.beside import HelperDied
from lhdmap.pipeline.closures import closure_rows
from lhdmap.pipeline.given import GROUND_TRUTH
from lhdmap.pipeline.heading import gyro_correction
from lhdmap.pipeline.identify import identify_along
from lhdmap.pipeline.landmarks import landmarks_for, with_stretches
from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.pipeline.pile import NO_FRONT, NO_INCLINOMETER, OFF, PileSink
from lhdmap.pipeline.refusal import key_scans_remark
from lhdmap.pipeline.said import said_once
from lhdmap.pipeline.sweep_times import SweepTimes
from lhdmap.pipeline.sweeps import SweepIntegration
from lhdmap.pipeline.topology import counts_of, seen_of
from lhdmap.pipeline.track import FinalTrack, Rows, resample, trajectory_of
from lhdmap.proprioception.wheels import WheelOdometry
from lhdmap.report.bounded import bounded
from lhdmap.report.data import ReportData, Summary, TopicRow
from lhdmap.report.recording_end import left_out
from lhdmap.roles import BUILD_MAP, GIVEN_POSES, read_by
from lhdmap.smoothing.evidence import open_loops
from lhdmap.smoothing.smoother import Correction, corrected
from lhdmap.smoothing.trust import expected_error
from lhdmap.topology.build import Topology, topology_of
from lhdmap.topology.edits import NO_EDITS, TopologyEdits
from lhdmap.topology.points import with_piles
from lhdmap.trajectory import Trajectory

ROLES_READ = read_by(BUILD_MAP)
_ROLES_PLACED = read_by(GIVEN_POSES)
_OF_ODOMETRY = ("odometry:", "wheels:", "wheel odometry:", "tachometer:", "inclinometer:")
_WITNESSES = {"articulated": "tachometer", "tachometer": "tachometer", "wheel_pose": "wheel odometry"}
_FEWEST_TOLD = 0.1  # of the scans
_GAP_S = 10.0
_FLOOR = [2, 3, 4]  # of a pose: height, roll, pitch
_HOLE_S, _HOLE_M = 1.0, 2.0


class Inputs(NamedTuple):
    """What a map is made of: logs, settings, topics by role, title of the map, given poses; whether bad logs are tried.

    `window_ns`: only what was logged between these times.
    """

    logs: Sequence[Path]
    settings: Settings
    topics: Mapping[str, str]
    title: str
    poses: str = ""
    force: bool = False
    edits: TopologyEdits = NO_EDITS
    window_ns: tuple[int, int] | None = None


class Ways(NamedTuple):
    """The way by odometry alone and the final one, at the scans; the final `rows`, whether they `moved`, closed loops.

    `end_covariance` (3, 3) and `end_height_std_m`: of the last key scan once loops were closed.
    """

    odometry: Trajectory
    final: Trajectory
    rows: Rows
    moved: bool
    closures: int
    end_covariance: FloatArray | None = None
    end_height_std_m: float | None = None


def odometry_of(pipeline: MappingPipeline) -> Trajectory:
    """Return the way by odometry alone."""
    stamps, times = _moments(pipeline)
    return trajectory_of(resample(pipeline.track.rows(), times), stamps)


def ways_of(pipeline: MappingPipeline, given: Rows | None) -> Ways:
    """Close loops and return both ways; with `given` poses these are final.

    Raises:
        InputError: no scan was taken at a time of the given poses.
    """
    stamps, times = _moments(pipeline)
    rows = pipeline.path.final.rows() if given is None else given
    steadied = None if given is not None else gyro_correction(pipeline, rows)
    if steadied is not None:
        rows = Rows(rows.times_ns, corrected(rows.poses, rows.times_ns, steadied))
    correction = None if given is not None else _correction(pipeline, rows, steadied)
    if given is not None and not any(map(FinalTrack(given).covers, times.tolist())):
        raise InputError(
            f"the given poses are of {given.times_ns[0] / 1e9:.3f} to {given.times_ns[-1] / 1e9:.3f} s, "
            f"the scans of {times[0] / 1e9:.3f} to {times[-1] / 1e9:.3f} s: none has a pose"
        )
    if correction is not None:
        rows = Rows(rows.times_ns, corrected(rows.poses, rows.times_ns, correction))
    final = trajectory_of(resample(rows, times), stamps)
    moved = given is not None or correction is not None or steadied is not None
    if correction is not None:
        end: tuple[int, FloatArray | None, float | None] = (
            correction.closures, correction.end_covariance, correction.height_std_m
        )  # fmt: skip
    else:
        end = 0, None if steadied is None else pipeline.smoother.end_covariance([steadied]), None
    return Ways(odometry_of(pipeline), final, rows, moved, *end)


def _correction(pipeline: MappingPipeline, rows: Rows, steadied: Correction | None) -> Correction | None:
    """Return how closed loops move the path; heights close where an inclinometer tells them."""

    def floor(times_ns: npt.NDArray[np.int64]) -> FloatArray:
        return resample(rows, times_ns).poses[:, _FLOOR]

    moved = [one for one in (pipeline.path.correction(), steadied) if one is not None]
    return pipeline.smoother.correction(moved, floor if pipeline.has_inclinometer else None)


class Outcome:
    """Cloud, pile, figures and warnings of a run.

    Raises:
        InputError: the scans hold no hit at all.
    """

    def __init__(self, inputs: Inputs, source: LogSource, pipeline: MappingPipeline, ways: Ways) -> None:
        self.pipeline, self.ways = pipeline, ways
        self._inputs, self._source = inputs, source
        rows = ways.rows
        if ways.moved:
            pipeline.sweeps.forget()  # two clouds at a time would take twice the memory
        with ThreadPoolExecutor(1, "landmarks") as beside:  # they are compared while the scans are read once more
            found = self._topology(beside)
            sweeps = integrate_again(inputs, pipeline, rows, source.survey) if ways.moved else pipeline.sweeps
            self.cloud: Cloud = sweeps.cloud()
        of_sweeps = sweeps.warnings
        sweeps.forget()
        distance_m = float(np.linalg.norm(np.diff(rows.poses[:, :3], axis=0), axis=1).sum())
        if not len(self.cloud.points_m) and pipeline.records.degenerate_share == 1.0:
            raise InputError(f"{source.paths[0]}: its scans hold no hit; lhdmap doctor tells what is wrong")
        self.pile_reason = self._no_pile()
        self.pile = None if self.pile_reason else self._pile(pipeline.pile)
        self.topology, self.landmarks = self._with_landmarks(*found)
        told = [*source.warnings, *source.damage, *_of_the_run(pipeline, inputs), *of_sweeps]
        told += _holes(rows) if inputs.poses else _remarks(pipeline)
        self.warnings = said_once([*told, *_of_the_pile(self.pile), *left_out()])
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
        height_std_m = pipeline.front_end.attitude.height_std_m(distance_m) if pipeline.has_inclinometer else None
        if height_std_m is not None and self.ways.end_height_std_m is not None:
            height_std_m = min(height_std_m, self.ways.end_height_std_m)
        found = expected_error(pipeline.smoother.keys, height_std_m, self.ways.end_covariance)
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
        if settings.topology.method == "off" or not len(self.pipeline.views):
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
            topics=_topic_rows(self._source, inputs),
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
            closures=closure_rows(self.pipeline.smoother.evidence, self.ways.rows),
            warnings=self.warnings,
            settings_text=settings_toml(inputs.settings),
            provenance={"log": ", ".join(name_of(path) for path in inputs.logs)} | _given(inputs),
            poses=_poses_name(inputs),
        )
        if not inputs.poses:  # else what the scans say of the motion took no part
            data = replace(
                data,
                odometry=self.ways.odometry,
                diagnostics=records.diagnostics(),
                odometry_speed=records.speed(),
                tachometer_speed=records.tachometer(),
                witness=_witness(self.pipeline),
            )
        return bounded(data)


def integrate_again(
    inputs: Inputs, pipeline: MappingPipeline, rows: Rows, survey: Survey | None = None
) -> SweepIntegration:
    """Read the scans once more and integrate them at their final poses: closed loops have moved them, or they are given.

    Sweeps before the first pose or after the last are left out. `survey`: of these logs, where one was taken.
    """
    sweeps = SweepIntegration(inputs.settings, pipeline.machine, pipeline.mounts, None)
    wheels = WheelOdometry(inputs.settings.wheels, pipeline.machine or Machine())
    track, times, sweep_times = FinalTrack(rows), map(int, pipeline.records.times_ns), SweepTimes()
    with LogSource(
        list(inputs.logs), inputs.topics, force=inputs.force, survey=survey, window_ns=inputs.window_ns
    ) as source:
        for role, message in source.messages(
            [role for role in ("front", "rear", "points", "joints") if role in source.roles]
        ):
            if isinstance(message, Joints):
                wheels.update(message)
            elif isinstance(message, (LaserScan, PointCloud)):
                time_ns = next(times, message.stamp_ns) if role == "front" else message.stamp_ns
                message = sweep_times.checked(role, message)
                sweeps.add_final(role, time_ns, message, track, wheels)
    sweeps.wait(track, wheels)
    return sweeps


def _moments(pipeline: MappingPipeline) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return the stamps of the front scans and the times of their poses, shape (N,)."""
    records = pipeline.records
    return records.stamps_ns, records.times_ns


def _topic_rows(source: LogSource, inputs: Inputs) -> list[TopicRow]:
    used = {topic: role for role, topic in source.roles.items()}
    read = (
        (*_ROLES_PLACED, "ground_truth")[: None if inputs.poses == GROUND_TRUTH else -1] if inputs.poses else ROLES_READ
    )
    rows = []
    for inventory in source.inventory():
        for topic in inventory.topics.values():
            role = used.get(topic.name)
            remark = f"used as {role}" if role in read else "not an input"
            rows.append(TopicRow(topic.name, topic.type_name, topic.count, topic.rate_hz, remark))
    return rows


def _poses_name(inputs: Inputs) -> str:
    return inputs.poses if inputs.poses in ("", GROUND_TRUTH) else name_of(Path(inputs.poses))


def _given(inputs: Inputs) -> dict[str, str]:
    return {"poses, given": _poses_name(inputs)} if inputs.poses else {}


def _of_the_run(pipeline: MappingPipeline, inputs: Inputs) -> list[str]:
    """Return what the stages found odd; with given poses without those that took no part."""
    return [text for text in pipeline.warnings if not (inputs.poses and text.startswith(_OF_ODOMETRY))]


def _of_the_pile(pile: PileReport | None) -> Sequence[str]:
    """Return the warnings of a pile that was found: what nothing closes has none to be measured wrong."""
    return () if pile is None or pile.estimate.status in (None, "none") else pile.estimate.warnings


def _witness(pipeline: MappingPipeline) -> str:
    """Return which sensors told of the motion beside the scans; empty where none did."""
    told, steps = pipeline.front_end.wheel_sources, sum(pipeline.front_end.wheel_sources.values())
    if pipeline.odometry is not None:
        wheels = pipeline.odometry.wheels
        steps = 0 if wheels.trust.warning() else steps - wheels.stale.steps
    if steps <= _FEWEST_TOLD * pipeline.records.scans:
        return ""
    return " and ".join(dict.fromkeys(_WITNESSES[source] for source in sorted(told)))


def _remarks(pipeline: MappingPipeline) -> list[str]:
    """Return warnings about the run as a whole."""
    remarks = []
    lost = pipeline.records.lost_stretches
    if lost:
        remarks.append(f"odometry: {lost} stretch(es) where the scan did not fit; the pose there is the motion model's")
    share = pipeline.records.degenerate_share
    if share > 0.2:
        remarks.append(
            f"odometry: in {100 * share:.0f} % of the scans a direction is weakly observed (smooth walls, or too far away?)"
        )
    remarks += key_scans_remark(pipeline.records)
    remarks += open_loops(pipeline.smoother.evidence)
    gap_s = float(np.diff(pipeline.records.times_ns).max(initial=0.0)) * 1e-9
    if gap_s > _GAP_S:
        remarks.append(
            f"no scan for {gap_s:.0f} s: if the machine was moved meanwhile, what follows is in another place than it was; "
            "build it apart"
        )
    if pipeline.drives_by_rear_body:
        remarks.append(
            "the front scanner is mounted on rear_link: the path is that of a machine that does not bend, wrong in bends"
        )
    if not pipeline.has_inclinometer and pipeline.clouds is None:
        remarks.append("no inclinometer in the log: the drive is treated as planar, heights are not observed")
    return remarks


def _holes(rows: Rows) -> list[str]:
    """Return a warning about stretches between given poses that are too long to be straight."""
    dt_s, step_m = np.diff(rows.times_ns) * 1e-9, np.linalg.norm(np.diff(rows.poses[:, :3], axis=0), axis=1)
    holes = (dt_s > _HOLE_S) & (step_m > _HOLE_M)
    if not holes.any():
        return []
    longest = int(np.argmax(np.where(holes, step_m, 0.0)))
    text = f"the longest of {step_m[longest]:.1f} m and {dt_s[longest]:.1f} s"
    return [f"given poses: {np.count_nonzero(holes)} hole(s), {text}: the way in it was taken for straight"]
