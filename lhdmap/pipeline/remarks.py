"""What a run says of itself beside its figures: topics, witnesses of the motion, warnings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lhdmap.logs.source import LogSource
from lhdmap.names import name_of
from lhdmap.pile.result import PileReport
from lhdmap.pipeline.given import GROUND_TRUTH
from lhdmap.pipeline.inputs import ROLES_PLACED, ROLES_READ, Inputs
from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.pipeline.refusal import key_scans_remark
from lhdmap.pipeline.track import TrackRows
from lhdmap.report.data import TopicRow
from lhdmap.smoothing.evidence import open_loops

_OF_ODOMETRY = ("odometry:", "wheels:", "wheel odometry:", "tachometer:", "inclinometer:")
_WITNESSES = {"articulated": "tachometer", "tachometer": "tachometer", "wheel_pose": "wheel odometry"}
_FEWEST_TOLD = 0.1  # of the scans
_GAP_S = 10.0
_HOLE_S, _HOLE_M = 1.0, 2.0


def topic_rows(source: LogSource, inputs: Inputs) -> list[TopicRow]:
    """Return the topics of a log, each with what it was used as."""
    used = {topic: role for role, topic in source.roles.items()}
    read = (
        (*ROLES_PLACED, "ground_truth")[: None if inputs.poses == GROUND_TRUTH else -1] if inputs.poses else ROLES_READ
    )
    rows = []
    for inventory in source.inventory():
        for topic in inventory.topics.values():
            role = used.get(topic.name)
            remark = f"used as {role}" if role in read else "not an input"
            rows.append(TopicRow(topic.name, topic.type_name, topic.count, topic.rate_hz, remark))
    return rows


def poses_name(inputs: Inputs) -> str:
    """Return what given poses are called, empty where there are none."""
    return inputs.poses if inputs.poses in ("", GROUND_TRUTH) else name_of(Path(inputs.poses))


def given_of(inputs: Inputs) -> dict[str, str]:
    """Return the line of the provenance for given poses, none where there are none."""
    return {"poses, given": poses_name(inputs)} if inputs.poses else {}


def odd_of_the_run(pipeline: MappingPipeline, inputs: Inputs) -> list[str]:
    """Return what the stages found odd; with given poses without those that took no part."""
    return [text for text in pipeline.warnings if not (inputs.poses and text.startswith(_OF_ODOMETRY))]


def odd_of_the_pile(pile: PileReport | None) -> Sequence[str]:
    """Return the warnings of a pile that was found: what nothing closes has none to be measured wrong."""
    return () if pile is None or pile.estimate.status in (None, "none") else pile.estimate.warnings


def witness_of(pipeline: MappingPipeline) -> str:
    """Return which sensors told of the motion beside the scans; empty where none did."""
    told, steps = pipeline.front_end.wheel_sources, sum(pipeline.front_end.wheel_sources.values())
    if pipeline.odometry is not None:
        wheels = pipeline.odometry.wheels
        steps = 0 if wheels.trust.warning() else steps - wheels.stale.steps
    if steps <= _FEWEST_TOLD * pipeline.records.scans:
        return ""
    return " and ".join(dict.fromkeys(_WITNESSES[source] for source in sorted(told)))


def remarks_of(pipeline: MappingPipeline) -> list[str]:
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
    remarks += open_loops(pipeline.evidence.smoother.evidence)
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


def holes_of(rows: TrackRows) -> list[str]:
    """Return a warning about stretches between given poses that are too long to be straight."""
    dt_s, step_m = np.diff(rows.times_ns) * 1e-9, np.linalg.norm(np.diff(rows.poses[:, :3], axis=0), axis=1)
    holes = (dt_s > _HOLE_S) & (step_m > _HOLE_M)
    if not holes.any():
        return []
    longest = int(np.argmax(np.where(holes, step_m, 0.0)))
    text = f"the longest of {step_m[longest]:.1f} m and {dt_s[longest]:.1f} s"
    return [f"given poses: {np.count_nonzero(holes)} hole(s), {text}: the way in it was taken for straight"]
