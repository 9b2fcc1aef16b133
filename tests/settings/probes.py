"""What a user gets out of a short run, part by part as it comes: a probe for each part of the settings.

A probe takes settings and runs the same small scenario with them. Two runs with the same settings give the same parts; one
that has differed need not go on.
"""

from __future__ import annotations

import functools
import hashlib
import json
import math
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
from lhdmap.cli.main import main
from lhdmap.config import Settings, settings_toml
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.cloud_io import write_cloud
from lhdmap.landmarks.build import landmarks_of
from lhdmap.landmarks.scans import NodeScan
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.movement.check import topology_findings
from lhdmap.movement.route import route_json
from lhdmap.movement.routes import RouteOptions, route
from lhdmap.odometry.cloud.steps import CloudStep
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.steps import OdometryStep
from lhdmap.pile.stage import ScanHits
from lhdmap.pipeline.heading import gyro_correction
from lhdmap.pipeline.inspection import Inspection
from lhdmap.pipeline.localize import Localizer
from lhdmap.pipeline.mapping import MappingOptions, MappingPipeline
from lhdmap.pipeline.pile import PileWatch, PlacedScan
from lhdmap.pipeline.step_recorder import StepRecorder
from lhdmap.pipeline.track import TrackRows
from lhdmap.proprioception.slip import SlipSettings
from lhdmap.proprioception.wheels import WheelOdometry
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.simulation.grizzly import simulate_grizzly
from lhdmap.smoothing.trust import expected_error
from lhdmap.topology.build import Seen, topology_of
from lhdmap.topology.geojson import to_geojson

from tests.executor.rig import Rig
from tests.landmarks.worlds import MODERATE, TunnelWorld, drive, tunnel
from tests.localization import known
from tests.movement.mines import fast_ladder
from tests.report.synthetic import START_NS, report_data
from tests.report.test_recording import read
from tests.settings import loading, streams
from tests.settings.consoled import operated
from tests.settings.digs import charges, decisions, digs, weighings
from tests.settings.guided import barred, plans, remembered, stops, trips
from tests.settings.hauled import asked, fleet, tried
from tests.settings.streams import Stream
from tests.settings.tracked import docks, tracks

Told = Iterator[Any]
Probe = Callable[[Settings], Told]


def digest(*parts: Any) -> str:
    """Return a digest of arrays, texts, numbers and whatever is made of them."""
    into = hashlib.sha256()
    _feed(into, parts)
    return into.hexdigest()


def _feed(into: Any, part: Any) -> None:
    if isinstance(part, np.ndarray):
        into.update(f"{part.dtype}{part.shape}".encode())
        into.update(np.ascontiguousarray(part).tobytes())
    elif is_dataclass(part) and not isinstance(part, type):
        _feed(into, [getattr(part, field.name) for field in fields(part)])
    elif isinstance(part, dict):
        _feed(into, list(part.items()))
    elif isinstance(part, Iterable) and not isinstance(part, str):
        for one in part:
            _feed(into, one)
    else:
        into.update(repr(part).encode())


class _Watched(StepRecorder):
    """A recorder with the covariances that a program on the machine gets with each step."""

    def __init__(self, wheels: WheelOdometry, settings: SlipSettings) -> None:
        super().__init__(wheels, settings)
        self.covariances: list[FloatArray] = []

    def record(
        self, stamp_ns: int, time_ns: int, step: OdometryStep | CloudStep, odometry: PlanarOdometry | None
    ) -> None:
        self.covariances.append(step.covariance)
        super().record(stamp_ns, time_ns, step, odometry)


def run(
    settings: Settings, stream: Stream, primary: Literal["front", "points"] = "front", *, own: bool = False
) -> Told:
    """Yield covariances, then a map: paths, diagnostics, curves, cloud, warnings; `own`: hits on the machine's bodies occur."""
    pipeline = MappingPipeline(settings, Machine() if own else None, MappingOptions(primary))
    pipeline._steps = watched = _Watched(pipeline.front_end.wheels, settings.slip)
    told = 0
    for role, message in stream:
        pipeline.update(role, message)
        yield from watched.covariances[told:]
        told = len(watched.covariances)
    pipeline.finish()
    records = pipeline.records
    yield (
        pipeline.track.rows(),
        pipeline.path.final.rows(),
        records.diagnostics(),
        records.stamps_ns,
        records.speed(),
        records.tachometer(),
        records.articulation(),
        watched.covariances[told:],
        expected_error(pipeline.evidence.smoother.keys, pipeline.front_end.inclinometer.attitude.height_std_m(10.0)),
        pipeline.sweeps.cloud(),
        pipeline.warnings,
        pipeline.sweeps.warnings,
    )


def turning(settings: Settings) -> Told:
    """Yield how a gyroscope moves a path whose scans drift in heading."""
    pipeline = MappingPipeline(settings)
    for k, message in enumerate(streams.turning()):
        pipeline.front_end.update("inclinometer", message)
        late_ns = message.stamp_ns - 200_000_000
        if k % 5 == 0 and late_ns > 0 and pipeline.front_end.inclinometer.gyro.there:
            pipeline.evidence.turns.append(
                late_ns, pipeline.front_end.inclinometer.gyro.turned_at(np.array([late_ns]))[0]
            )
    t = np.arange(0.5, 119.0, 0.1)
    heading = 0.4 * (1.0 - np.cos(0.5 * t)) + 1e-3 * np.cumsum(np.random.default_rng(9).standard_normal(len(t)))
    x, y = 0.3 * np.cumsum(np.cos(heading)), 0.3 * np.cumsum(np.sin(heading))
    zero = np.zeros(len(t))
    rows = TrackRows(np.round(t * 1e9).astype(np.int64), np.column_stack([x, y, zero, zero, zero, heading]))
    yield gyro_correction(pipeline, rows)


def lap(settings: Settings) -> Told:
    """Yield the smoother's corrections after a lap and a quarter around a pillar, scans each half metre."""
    stage = MappingPipeline(settings).evidence.smoother
    for key in streams.lap_scans():
        stage.keys.update(key.time_ns, key.pose, key.points.astype(np.float64), key.error)
    yield stage.correction()


def pile(settings: Settings) -> Told:
    """Yield `pile.json`, and of the distances of all estimates, after a drive towards a pile."""
    watch = PileWatch(settings)
    for scan in streams.towards_a_pile():
        watch.update(cast("PlacedScan", _Hits(scan)))
    report = watch.report()
    yield (report.to_json(), [one.distance_m for one in report.history])


@dataclass(frozen=True, slots=True)
class _Hits:
    """A placed scan whose hits are known."""

    known: ScanHits

    def hits(self) -> ScanHits:
        return self.known


def recording(settings: Settings) -> Told:
    """Yield a Rerun recording, read back: what is drawn, and when."""
    with tempfile.TemporaryDirectory() as folder:
        inspection = Inspection(Path(folder), "drive", START_NS, settings)
        for number in range(20):
            inspection.record(START_NS + number * 200_000_000, np.ones((7, 3)), "front")
        inspection.write(report_data(scans=60, points=400), Machine())
        inspection.close()
        yield [_drawn(batches) for _, batches in sorted(read(Path(folder) / "recording.rrd").items())]


def _drawn(batches: list[Any]) -> list[Any]:
    """Return the columns of an entity, less those that tell when the file was made; batches and their order are chance."""
    names = sorted({name for batch in batches for name in batch.schema.names})
    names = [name for name in names if not name.startswith(("rerun.", "log_t", "RecordingInfo"))]
    return [
        [name, *sorted(str(value) for batch in batches if name in batch.schema.names for value in _values(batch, name))]
        for name in names
    ]


def _values(batch: Any, name: str) -> list[Any]:
    return [value for value in batch.column(name).to_pylist() if value is not None]


def plan(settings: Settings) -> Told:
    """Yield the plan and table of a rockbreaker whose orientation has to be shifted on the way."""
    ends = ["--from", "2.2,2.15,-1", "--to", "2.2,-2.15,-1", "--phi-from", "270", "--phi-to", "270", "--path", "cslm"]
    yield _planned(settings, ends)


def rock(settings: Settings) -> Told:
    """Yield the plan to the largest rock on a grizzly."""
    with tempfile.TemporaryDirectory() as folder:
        cloud = Path(folder) / "grizzly.ply"
        write_cloud(cloud, GridCloud(simulate_grizzly(Rockbreaker(), 3).points_m.astype(np.float32)))
        yield _planned(settings, ["--cloud", str(cloud)])


def routes(settings: Settings) -> Told:
    """Yield routes on a map with fast tunnels and a turning bay, and of its check: twins that are a little off."""
    topology = fast_ladder()
    ways = [(loaded, RouteOptions(*headings)) for loaded in (False, True) for headings in _HEADINGS]
    found = [
        route_json(route(topology, "t1.start", "DP1", asked, settings.movement, loaded=loaded))
        for loaded, asked in ways
    ]
    yield (found, list(topology_findings(topology, settings.movement)))


_HEADINGS = (("along", "along"), ("along", "against"), ("against", "along"), ("against", "against"))


def _planned(settings: Settings, words: list[str]) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        file, target = Path(folder) / "settings.toml", Path(folder) / "plan"
        file.write_text(settings_toml(settings, ["rockbreaker"]), encoding="utf-8")
        command = ["rockbreaker", "plan", *words, "--config", str(file), "--no-pictures", "--quiet", "-o", str(target)]
        assert main(command) == 0
        values = json.loads((target / "plan.json").read_text(encoding="utf-8"))
        return _untimed(values), (target / "trajectory.csv").read_text(encoding="utf-8")


def _untimed(values: Any) -> Any:
    """Return values without how long the planning took."""
    if isinstance(values, dict):
        return {key: _untimed(value) for key, value in values.items() if key != "planning_ms"}
    return [_untimed(value) for value in values] if isinstance(values, list) else values


@functools.cache
def _taught() -> tuple[TunnelWorld, list[NodeScan]]:
    world = tunnel(5, MODERATE, 44.0, bends=True, niches=True)
    return world, drive(world, seed=1)


def landmarks(settings: Settings) -> Told:
    """Yield the landmarks of a tunnel with bends and niches."""
    world, scans = _taught()
    made = landmarks_of(scans, {"t": world.frame()}, {"t"}, settings.landmarks)
    yield (made, made.not_distinctive_m("t", settings.landmarks))


def topology(settings: Settings, seen: Callable[[], Seen]) -> Told:
    """Yield the topological map, as its file has it, and of the free space of a drive; None where it is off."""
    if settings.topology.method == "off":
        yield None
        return
    found = topology_of(seen(), settings.topology)
    yield (json.dumps(to_geojson(found.map)), found.sheets, found.niches)


def localized(settings: Settings, *, way_m: float, jump_m: float = 0.0, known_start: bool = False) -> Told:
    """Yield what localization says of a drive, of which the start is known or not, then how often it withheld."""
    stream, poses = known.drive(5.0, way_m, jump_m=jump_m)
    localizer, told = Localizer(known.known_map(), settings, None, poses[0] if known_start else None), 0
    for role, message in stream:
        localizer.update(role, message)
        yield from _untimed_rows(localizer, told)
        told = len(localizer.rows)
    localizer.finish()
    searches = [(one.stamp_ns, one.purpose) for one in localizer.searches]
    yield (
        _untimed_rows(localizer, told),
        localizer.facts.withheld,
        localizer.facts.lost_stretches,
        localizer.facts.first_fix,
        searches,
    )


def _untimed_rows(localizer: Localizer, known: int) -> list[Any]:
    return [row._replace(latency_ms=0.0) for row in localizer.rows[known:]]


def driven(settings: Settings) -> Told:
    """Yield what a machine is told while inputs fail, pose and scan disagree, and things are near."""
    inputs = {"motion": 0.01, "scan_front": 0.04, "pose": 0.04, "link": 0.1, "operator": 0.2}
    rig = Rig(settings.executor, inputs)
    control = rig.control
    rig.beside = [(60.0, 1.225 + 0.056)]
    rig.own = [(2.0, 1.225 - 0.12)]

    def go(seconds: float, mode: str = "") -> list[Any]:
        told: list[Any] = []

        def each() -> None:
            if mode and not (control.watchdog.armed and control.modes.name == mode) and rig.speed == 0.0:
                control.rearm(rig.now_ns, mode)
                control.mode(mode, rig.now_ns)
            told.append((rig.command, *control.take_notes()))

        rig.run(seconds, each)
        return told

    yield go(5.0, "autonomous")
    for name, failed_s in (("motion", 0.4), ("link", 2.5)):
        rig.failed.add(name)
        yield go(failed_s)
        rig.failed.clear()
        yield go(6.0, "autonomous")
    for apart in ((0.25, 0.0), (0.0, math.radians(1.2))):
        rig.apart_m, rig.apart_rad = apart
        yield go(0.5)
        rig.apart_m, rig.apart_rad = 0.0, 0.0
        yield go(6.0, "autonomous")
    rig.rate_wanted = math.radians(0.4)
    yield go(1.0)
    rig.rate_wanted = math.radians(-10.0)
    yield go(1.0)
    rig.rate_wanted = 0.0
    control.mode("idle", rig.now_ns)
    yield go(3.0)
    yield go(5.0, "teleoperated")
    rig.beside = []  # the guard has held the machine there
    yield go(14.0, "teleoperated")
    rig.failed.add("operator")
    yield go(0.7)
    rig.failed.clear()
    yield go(5.0, "teleoperated")
    rig.operates = False
    yield go(6.0)


def guided(settings: Settings) -> Told:
    """Yield what guidance commands in a narrow bend, and on the way to a stop."""
    parts = plans, stops, remembered, barred
    for part in parts:
        yield from part(settings.guidance)


def navigated(settings: Settings) -> Told:
    """Yield what navigation control says and asks for on trips over a small map."""
    yield from trips(settings)


def _dug(method: str) -> Probe:
    return lambda settings: digs(settings, method)


def loading_cycle(settings: Settings) -> Told:
    """Yield what the loading task says and asks for in short cycles."""
    yield from loading.cycle(settings.loading)


def loading_limits(settings: Settings) -> Told:
    """Yield when each limit of the loading task counts."""
    yield from loading.limits(settings.loading)


def tracked(settings: Settings) -> Told:
    """Yield what a tracker commands on a drive with slip, noise, an offset, and poses that fail."""
    yield from tracks(settings.tracking)


def attended(settings: Settings) -> Told:
    """Yield when a silent or slow operator stops a machine, of sessions, tries and alarms."""
    yield operated(settings.console)


def docked(settings: Settings) -> Told:
    """Yield ways to a dock on wide and tight aprons, or why there is none."""
    yield from docks(settings.docking)


def hauled(settings: Settings) -> Told:
    """Yield how often a mission tries, and when it asks for its next section."""
    yield tried(settings.haulage)
    yield from asked(settings.haulage)


def shared(settings: Settings) -> Told:
    """Yield what three machines achieve on a level."""
    yield from fleet(settings.traffic)


def _mapped(stream: Callable[[], Stream], primary: Literal["front", "points"] = "front", *, own: bool = False) -> Probe:
    return lambda settings: run(settings, stream(), primary, own=own)


PROBES: dict[str, Probe] = {
    "tilted": _mapped(streams.tilted, own=True),
    "unlevelled": _mapped(streams.unlevelled, own=True),
    "faulty": _mapped(streams.faulty, own=True),
    "rare": _mapped(streams.rare, own=True),
    "turning": turning,
    "level": _mapped(streams.planar),
    "smooth": _mapped(partial(streams.planar, 0.005)),
    "tachometer": _mapped(partial(streams.planar, wheels="tachometer")),
    "poses": _mapped(partial(streams.planar, wheels="poses")),
    "jump": _mapped(partial(streams.planar, wheels="none", jumps=True)),
    "clouds": _mapped(streams.clouds, "points"),
    "returning": _mapped(streams.returning, "points"),
    "cut": _mapped(streams.cut, "points"),
    "lap": lap,
    "driven": driven,
    "guided": guided,
    "navigated": navigated,
    "charged": charges,
    "charged_as_printed": lambda settings: charges(settings, "paper"),
    "dug": _dug(""),
    "dug_as_printed": _dug("paper"),
    "dug_tuned": _dug("paper-tuned"),
    "weighed": weighings,
    "decided": decisions,
    "loading_cycle": loading_cycle,
    "loading_limits": loading_limits,
    "tracked": tracked,
    "docked": docked,
    "attended": attended,
    "hauled": hauled,
    "shared": shared,
    "landmarks": landmarks,
    "pile": pile,
    "recording": recording,
    "plan": plan,
    "rock": rock,
    "route": routes,
    "topology": partial(topology, seen=streams.side_chambers),
    "levels": partial(topology, seen=streams.two_levels),
    "put_down": partial(localized, way_m=24.0),
    "carried_off": partial(localized, way_m=20.0, jump_m=12.0, known_start=True),
}
