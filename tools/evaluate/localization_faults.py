"""Faults of a second drive through a small mine in space: what localization says while they last, and how soon it is right again.

A drive is simulated once; a fault changes or drops its messages. What has to be simulated is a drive of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from lhdmap.config import settings_from
from lhdmap.evaluation.localization import LocalizationTable, MapTruth, _at
from lhdmap.localization.rows import columns
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.mapfolder import MapFolder
from lhdmap.messages import FloatArray, Joints, LaserScan, Message, Tachometer
from lhdmap.mine.make_network import make_network
from lhdmap.mine.plan import load_plan
from lhdmap.pipeline.build import BuildRequest, build_map
from lhdmap.pipeline.inputs import ROLES_READ
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.pipeline.localize import Localizer
from lhdmap.simulation.mine_drive import MineDriveSettings, simulate_mine
from lhdmap.simulation.operator import OperatorSettings
from lhdmap.simulation.sensing.sections import ScannerSettings, SensorSettings
from lhdmap.trajectory import read_tum

Messages = list[tuple[str, Message]]
Change = Callable[[float, str, Message, np.random.Generator], Message | None]
_SECOND = 1e9
_RIGHT_M, _WRONG_M, _WRONG_DEG = 0.15, 1.0, 10.0
_SETTINGS = settings_from({"pile.method": "off", "recording.scan_interval_s": 10.0})
_MINE = """
name = "loop"
seed = 8
[[drift]]
name = "T1"
line_m = [[-14, 0, 0], [56, 0, 0]]
[[drift]]
name = "T2"
line_m = [[42, 0, 0], [42, 34, 1.5], [4, 34, 1.5], [4, 0, 0]]
bend_radius_m = 12.0
[[place]]
drift = "T1"
at_m = 4.0
kind = "park"
name = "Park"
"""
_CHANGED = (
    _MINE.replace('"loop"', '"changed"')
    + """
[[equipment]]
drift = "T1"
at_m = 37.0
kind = "box"
size_m = [8.0, 0.8, 2.4]
lateral_m = 1.95
[[equipment]]
drift = "T2"
at_m = 50.0
kind = "box"
size_m = [5.0, 0.7, 1.9]
lateral_m = 1.95
[[equipment]]
drift = "T2"
at_m = 62.0
kind = "person"
lateral_m = -1.9
[[dust]]
drift = "T2"
from_m = 70.0
to_m = 85.0
share = 0.15
"""
)
_INTRO = """\
A mine of two drifts that make a ring of 150 m with a chord (rough walls, tilted scanners, uneven floor, 12.5 Hz), its map from a
teaching drive; second drives at 8 km/h with 0.25 m of wander. The fault lasts as long as the table says, the start is about known.
"Off" is while it tracks; "right again": way after the fault's end until it tracks within {right:g} m; "silent": scans that track
over 1 m or 10° off.
"""
_COLUMNS = (
    "fault", "for", "tracked", "off RMSE, max", "heading max", "within 3 σ along / across", "losses reported", "silent",
    "right again after",
)  # fmt: skip


class Fault(NamedTuple):
    """A fault by name: what it does to messages between two times (s after the log's start), in which drive."""

    name: str
    change: Change
    from_s: float = 30.0
    until_s: float = 40.0
    drive: str = "second"


def _same(_t: float, _role: str, message: Message, _rng: np.random.Generator) -> Message | None:
    return message


def _without(*roles: str) -> Change:
    return lambda _t, role, message, _rng: None if role in roles else message


def _dropped(share: float) -> Change:
    return lambda _t, _role, message, rng: None if rng.random() < share else message


def _blind(share: float, role_of: str = "") -> Change:
    """Return what takes a share of the returns of scanners (of one role) away."""

    def change(_t: float, role: str, message: Message, rng: np.random.Generator) -> Message | None:
        if not isinstance(message, LaserScan) or (role_of and role != role_of):
            return message
        ranges = message.ranges_m.copy()
        ranges[rng.random(len(ranges)) < share] = np.inf
        return message._replace(ranges_m=ranges)

    return change


def _dust(_t: float, _role: str, message: Message, rng: np.random.Generator) -> Message | None:
    if not isinstance(message, LaserScan):
        return message
    ranges = message.ranges_m.copy()
    hit = rng.random(len(ranges)) < 0.2
    ranges[hit] = np.minimum(ranges[hit], rng.uniform(0.5, 6.0, int(hit.sum())).astype(np.float32))
    return message._replace(ranges_m=ranges)


def _people(t: float, _role: str, message: Message, _rng: np.random.Generator) -> Message | None:
    """Return a scan with three people who walk before the scanners, 2 to 4 m away."""
    if not isinstance(message, LaserScan):
        return message
    ranges = message.ranges_m.copy()
    bearings = message.angle_min_rad + message.angle_increment_rad * np.arange(len(ranges))
    for k in range(3):
        at, far = 0.9 * math.sin(0.4 * t + 2.1 * k), 3.0 + math.sin(0.7 * t + k)
        hidden = np.abs(bearings - at) < 0.25 / far
        ranges[hidden] = np.minimum(ranges[hidden], np.float32(far))
    return message._replace(ranges_m=ranges)


def _slipping(factor: float) -> Change:
    def change(t: float, _role: str, message: Message, _rng: np.random.Generator) -> Message | None:
        if isinstance(message, Tachometer) and t % 6.0 < 2.0:
            return message._replace(speed_mps=factor * message.speed_mps)
        return message

    return change


def _later(step_s: float) -> Change:
    """Return what moves stamps: the clock was set."""
    return lambda _t, _role, message, _rng: message._replace(stamp_ns=message.stamp_ns + round(step_s * _SECOND))


def _bent(_t: float, _role: str, message: Message, _rng: np.random.Generator) -> Message | None:
    if isinstance(message, Joints):
        return message._replace(positions_rad=dict.fromkeys(message.positions_rad, 0.1))
    return message


_ALL = math.inf
FAULTS = (
    Fault("none", _same),
    Fault("reverse gear first, then the other direction", _same, drive="reverse"),
    Fault("changed world: two parked things, a person, dust on 15 m", _same, drive="changed"),
    Fault("30 % of returns missing", _blind(0.3), 0.0, _ALL),
    Fault("90 % of returns missing", _blind(0.9)),
    Fault("dust: 20 % of returns nearer", _dust, 0.0, _ALL),
    Fault("three people walk along", _people, 0.0, _ALL),
    Fault("10 % of messages lost", _dropped(0.1), 0.0, _ALL),
    Fault("rear scanner dead", _without("rear"), 0.0, _ALL),
    Fault("front scanner sees nothing", _blind(1.0, "front")),
    Fault("front scanner silent", _without("front"), 30.0, 35.0),
    Fault("no scans at all", _without("front", "rear"), 30.0, 35.0),
    Fault("wheels slip by 60 %, 2 s in 6", _slipping(1.6), 0.0, _ALL),
    Fault("no wheels, no joint", _without("tachometer", "joints"), 0.0, _ALL),
    Fault("joint stuck at 0.1 rad", _bent),
    Fault("no inclinometer", _without("inclinometer")),
    Fault("clock set ahead by 2 s", _later(2.0), 30.0, _ALL),
    Fault("clock set back by 2 s", _later(-2.0), 30.0, _ALL),
    Fault(
        "moved on while it was off (log cut)",
        _without("front", "rear", "tachometer", "joints", "inclinometer"),
        30.0,
        45.0,
    ),
)


def made(folder: Path) -> None:
    """Simulate the drives and build the map, as far as they are not there."""
    sensors = SensorSettings(scanner=ScannerSettings(rate_hz=12.5))
    plans = {"loop": _MINE, "changed": _CHANGED}
    for name, text in plans.items():
        if not (folder / f"{name}.toml").exists():
            (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    drives = {
        "teach": ("loop", 1, "", 10.0, 0.0),
        "second": ("loop", 2, "", 8.0, 0.25),
        "reverse": ("loop", 3, "-T1,-T2,T1", 7.0, 0.0),
        "changed": ("changed", 4, "", 10.0, 0.2),
    }
    for name, (plan, seed, route, speed_kmh, wander_m) in drives.items():
        log = folder / f"{name}.mcap"
        if not log.exists():
            network, operator = (
                make_network(load_plan(folder / f"{plan}.toml")),
                OperatorSettings(speed_kmh=speed_kmh, wander_m=wander_m),
            )
            drive = MineDriveSettings(route=route, seed=seed, operator=operator, sensors=sensors, names=True)
            simulate_mine(network, Machine(), drive, log)
    if not (folder / "teach.map").exists():
        build_map(BuildRequest([folder / "teach.mcap"], folder / "teach.map", _SETTINGS))


def messages_of(log: Path) -> Messages:
    """Return what of a log localization reads."""
    with LogSource([log]) as source:
        return list(source.messages([role for role in ROLES_READ if role in source.roles]))


def changed(messages: Messages, fault: Fault, seed: int = 0) -> Messages:
    """Return messages with a fault."""
    rng, begins = np.random.default_rng(seed), min(one.stamp_ns for role, one in messages if role == "front")
    found: Messages = []
    for role, message in messages:
        t = (message.stamp_ns - begins) / _SECOND
        if not fault.from_s <= t < fault.until_s or role == "tf_static":
            found.append((role, message))
            continue
        new = fault.change(t, role, message, rng)
        if new is not None:
            found.append((role, new))
    return found


def faults(folder: Path) -> Iterator[str]:
    """Yield the lines of the section."""
    made(folder)
    known = KnownMap.read(folder / "teach.map")
    truth = MapTruth(read_tum(folder / "teach.truth.tum"), MapFolder.open(folder / "teach.map").trajectory())
    logs: dict[str, Messages] = {}
    yield _INTRO.format(right=_RIGHT_M)
    yield f"| {' | '.join(_COLUMNS)} |"
    yield "|" + " --- |" * len(_COLUMNS)
    for fault in FAULTS:
        if fault.drive not in logs:
            logs[fault.drive] = messages_of(folder / f"{fault.drive}.mcap")
        drive = read_tum(folder / f"{fault.drive}.truth.tum")
        yield row(fault, known, changed(logs[fault.drive], fault), drive, truth)


def row(fault: Fault, known: KnownMap, messages: Messages, drive: Any, truth: MapTruth) -> str:
    """Localize a drive with a fault and return its line."""
    placed = truth.placed(_at(drive, drive.stamps_ns))
    with Localizer(known, _SETTINGS, Machine(), placed[0][[0, 1, 3, 2]]) as localizer:
        for role, message in messages:
            localizer.update(role, message)
        localizer.finish()
    table = LocalizationTable.of({name: np.asarray(values) for name, values in columns(localizer.rows).items()})
    stamps = table.stamp_ns - _shift_ns(fault, messages, len(table.stamp_ns))
    true = truth.placed(_at(drive, stamps))
    error = _error(table.poses, true)
    tracks = table.status == "tracking"
    off = np.hypot(error[:, 0], error[:, 1])
    silent = tracks & ((off > _WRONG_M) | (np.abs(np.degrees(error[:, 2])) > _WRONG_DEG))
    inside = np.abs(error[tracks, :2]) <= 3.0 * table.deviations[tracks, :2]
    lasts = fault.until_s - fault.from_s
    cells = (
        fault.name,
        ""
        if fault.change is _same
        else "all the drive"
        if fault.from_s == 0.0
        else f"{lasts:g} s"
        if math.isfinite(lasts)
        else "on",
        f"{100 * tracks.mean():.1f} %",
        f"{1e3 * math.sqrt(float((off[tracks] ** 2).mean())):.0f}, {1e3 * off[tracks].max():.0f} mm",
        f"{np.abs(np.degrees(error[tracks, 2])).max():.2f}°",
        f"{100 * inside[:, 0].mean():.0f} / {100 * inside[:, 1].mean():.0f} %",
        str(localizer.facts.lost_stretches),
        str(int(silent.sum())),
        _again(fault, stamps, drive, tracks & (off < _RIGHT_M)),
    )
    return f"| {' | '.join(cells)} |"


def _shift_ns(fault: Fault, messages: Messages, rows: int) -> Any:
    """Return by how much the stamps of rows are ahead of the truth's clock: from the message on at which the clock was set."""
    probe = fault.change(fault.from_s, "tachometer", Tachometer(0, 0.0), np.random.default_rng(0))
    if probe is None or probe.stamp_ns == 0:
        return 0
    stamps = [one.stamp_ns for role, one in messages if role == "front"]
    before = int(np.argmax(np.abs(np.diff(stamps)))) + 1
    return np.where(np.arange(rows) >= before - len(stamps) + rows, probe.stamp_ns, 0)


def _error(poses: FloatArray, true: FloatArray) -> FloatArray:
    """Return errors (N, 3) along, across and of the heading, in the axes of the true poses."""
    d, c, s = poses - true, np.cos(true[:, 3]), np.sin(true[:, 3])
    heading = (d[:, 3] + math.pi) % (2.0 * math.pi) - math.pi
    return np.column_stack([c * d[:, 0] + s * d[:, 1], -s * d[:, 0] + c * d[:, 1], heading])


def _again(fault: Fault, stamps: Any, drive: Any, right: Any) -> str:
    """Return the way from the fault's end to the first scan that is right."""
    if fault.change is _same or fault.from_s == 0.0:
        return ""
    ends = fault.until_s if math.isfinite(fault.until_s) else fault.from_s
    end_ns = drive.stamps_ns[0] + round(ends * _SECOND)
    after = np.flatnonzero(right & (stamps >= end_ns))
    if not len(after):
        return "**never**"
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(drive.positions_m, axis=0), axis=1))])
    at = [
        float(np.interp(float(one - drive.stamps_ns[0]), (drive.stamps_ns - drive.stamps_ns[0]).astype(float), way))
        for one in (end_ns, stamps[after[0]])
    ]
    return f"{at[1] - at[0]:.1f} m"
