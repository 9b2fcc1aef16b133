"""What the loading task makes of small worlds, for the probes: a cycle on the bench, and each limit alone."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from lhdmap.driving.motion import Motion
from lhdmap.loading.identification import Identification, target_of
from lhdmap.loading.moment import LoadingInput, Mission, Moment
from lhdmap.loading.positioning_align import Aligner
from lhdmap.loading.positioning_steps import Positioning
from lhdmap.loading.signals import Signals
from lhdmap.loading.states import ASSISTANCE, MOVING, State
from lhdmap.loading.task import LoadingTask
from lhdmap.loading.task_settings import LoadingSettings
from lhdmap.messages import FloatArray

from tests.guidance.tunnels import BODIES, MODEL
from tests.loading.task.bench import Drift, Until, bench, controllers
from tests.loading.task.test_conformance import Stub

_DRIFT = Drift()
_PILE = target_of(_DRIFT.snapshot(0).estimate, 0)
_SECOND_NS = 1_000_000_000


def cycle(settings: LoadingSettings) -> Iterator[Any]:
    """Yield what is said and asked in cycles: from the drift, and from a start that has to be corrected near the pile."""
    for start, bend, end in (
        ((17.0, 0.2, 0.0), 0.0, State.DONE),
        ((22.0, 0.3, 0.1), 0.1, State.CHARGING),
        ((23.8, 0.3, 0.1), 0.1, State.CHARGING),
    ):
        one = bench(start=start, bend_rad=bend, settings=settings)
        one.run(60.0, lambda out, end=end: out.state == end or out.request is not None)  # type: ignore[misc]
        yield [[out.state, out.phase, out.pedals, out.directive and out.directive.stop_m] for out in one.said]
        yield [[when, note.cause] for when, note in one.notes]
        yield one.truth.state


def limits(settings: LoadingSettings) -> Iterator[Any]:
    """Yield when each limit counts, each in a world of its own."""
    for look in (_looks, _ages, _restored, _aims, _newer, _toes, _faces, _squares):
        yield look(settings)
    for state in MOVING | ASSISTANCE | {State.HELD}:
        for count in (0, 7, 11):
            yield _ends(settings, state, count)


def _motion(now_ns: int, x: float = 0.0, y: float = 0.0, speed: float = 0.0) -> Motion:
    return Motion(now_ns, x, y, 0.0, 0.0, 0.0, speed)


def _signals(now_ns: int, noise: float = 0.0) -> Signals:
    return Signals(now_ns, 0.0, 0.0, now_ns, 0.0, 0.0, 0.0, 0.0, 60.0 + noise, 80.0 + noise, 10.0 + noise)


def _told(now_ns: int, **more: Any) -> LoadingInput:
    walls = np.zeros((0, 2))
    first = LoadingInput(now_ns, _signals(now_ns, now_ns * 1e-12), _motion(now_ns), walls_m=walls, mission=Mission(1))
    return first._replace(**more)


def _task(settings: LoadingSettings, state: State) -> LoadingTask:
    """A task in a state, whose parts go on for ever."""
    task = LoadingTask(MODEL, BODIES, controllers(), Until(), settings)
    stubs: Any = {one: Stub() for one in MOVING}
    task._parts = stubs
    memory = task._memory
    memory.state, memory.active, memory.mission = state, True, Mission(1)
    return task


def _ends(settings: LoadingSettings, state: State, count: int) -> list[Any]:
    """Return when a state ends, after so many requests and stops before."""
    task = _task(settings, state)
    task._help.count = task._memory.holds = count
    for k in range(1500):
        now_ns = k * _SECOND_NS
        task._health._last_ns = now_ns
        said = task.update(_told(now_ns, armed=state != State.HELD))
        if said.state != state:
            return [state, count, k, said.state]
    return [state, count, None]


def _looks(settings: LoadingSettings) -> list[Any]:
    """Return how near the machine comes before help is asked for, how long it looks from near, with how few hits."""
    found: list[Any] = []
    task = LoadingTask(MODEL, BODIES, controllers(), Until(), settings)
    for k in range(400):
        now_ns = k * 50_000_000
        mission = Mission(1, (40.0, 0.0))
        if task.update(_told(now_ns, motion=_motion(now_ns, 0.1 * k), mission=mission)).request is not None:
            found.append(k)
            break
    near, walls = Identification(MODEL, settings), _DRIFT.face_m[18:21] - np.array([20.0, 0.0])
    for pile, hits in ((None, walls), (_DRIFT.snapshot(0), walls), (None, walls[:2])):
        for k in range(800):
            moment = _moment(k * 50_000_000, _motion(0, 20.0), hits)._replace(
                pile=pile, draw_point_m=(30.0, 0.0), target=_PILE, face_m=1.5
            )
            if k == 0:
                near.begin(moment)
            step = near.step(moment)
            if step.event is not None:
                found += [k, step.event]
                break
    return found


def _moment(now_ns: int, motion: Motion, walls_m: FloatArray) -> Moment:
    return Moment(now_ns, _signals(now_ns), motion, walls_m, None, None, None, None, 0)


def _ages(settings: LoadingSettings) -> list[Any]:
    """Return how old signals and scans may be, and how long a pressure may stand."""
    found: list[Any] = []
    for what in ("signals", "scan", "pressure"):
        task = _task(settings, State.CHARGING)
        for k in range(400):
            now_ns = k * 20_000_000
            signals = _signals(now_ns, 0.0 if what == "pressure" else now_ns * 1e-12)
            if what == "signals":
                signals = signals._replace(now_ns=0)
            if what == "scan":
                signals = signals._replace(scan_ns=0)
            if task.update(_told(now_ns, signals=signals)).state == State.HELD:
                found.append([what, k])
                break
    return found


def _restored(settings: LoadingSettings) -> list[Any]:
    """Return when a stopped task goes on: at rest, slowly rolling, beside its trail."""
    found: list[Any] = []
    for aside, speed in ((0.0, 0.0), (0.0, 0.04), (2.0, 0.0)):
        task = _task(settings, State.HELD)
        task._memory.touched = True
        task._trail.add(_motion(0))
        for k in range(200):
            now_ns = k * 50_000_000
            said = task.update(_told(now_ns, motion=_motion(now_ns, 0.0, aside, speed)))
            if said.state != State.HELD:
                found.append([aside, speed, k])
                break
    return found


def _aims(settings: LoadingSettings) -> list[Any]:
    """Return to which joint angle it is turned from places across a drift, with walls near and far."""
    aligner, found = Aligner(MODEL, BODIES, settings), []
    for half_m in (1.55, 2.2):
        drift = Drift(8.0, half_m)
        for aside in np.linspace(-0.8, 0.8, 9):
            limits_m = drift.limits_m - np.array([0.0, aside])
            walls_m = drift.walls_m - np.array([0.0, 0.5 * aside])
            found += [aligner.aim(bend, limits_m, walls_m).bend_rad for bend in (0.0, 0.12, 0.4)]
    return found


def _newer(settings: LoadingSettings) -> list[Any]:
    """Return the limits that positioning goes by where the pile is seen 1.2 m farther on."""
    first, moved = _DRIFT.snapshot(0), Drift(31.2).snapshot(1)
    one = Positioning(MODEL, BODIES, settings)
    near = Identification(MODEL, settings)
    moment = _moment(0, _motion(0, 5.0), np.zeros((0, 2)))._replace(pile=first)
    near.begin(moment)
    target = near.step(moment).target
    one.begin(moment._replace(target=target))
    newer = one.step(moment._replace(target=target, pile=moved)).target
    stuck = (k for k in range(600) if one.step(moment._replace(target=target, now_ns=k * _SECOND_NS // 10)).event)
    return [newer, next(stuck, None)]


def _toes(settings: LoadingSettings) -> list[Any]:
    """Return where the last charge may begin, and the deviation that a charge is told."""
    task, found = LoadingTask(MODEL, BODIES, controllers(), Until(), settings), []
    charge: Any = task._parts[State.CHARGING]
    moment = _moment(0, _motion(0, 20.0), np.zeros((0, 2)))
    near = Identification(MODEL, settings)
    near.begin(moment._replace(pile=_DRIFT.snapshot(0)))
    target = near.step(moment._replace(pile=_DRIFT.snapshot(0), walls_m=_DRIFT.face_m - [20.0, 0.0])).target
    found.append(charge._told(moment._replace(target=target)).toe_std_m)
    for way_m in (0.8, 1.2, 1.8):
        one = Positioning(MODEL, BODIES, settings)
        x = 30.0 - way_m - float(BODIES.front_box_m[1, 0])
        at = moment._replace(motion=_motion(0, x), target=target)
        one.begin(at)
        found.append(one.step(at).event)
    assert all(math.isfinite(one) for one in found[:1])
    return found


def _faces(settings: LoadingSettings) -> list[Any]:
    """Return after how much way towards a pile that is not seen help is asked for, begun within the distance that counts."""
    one = Identification(MODEL, settings)
    for k in range(300):
        moment = _moment(k * 50_000_000, _motion(0, 10.0 + 0.1 * k, speed=2.0), np.zeros((0, 2)))
        moment = moment._replace(draw_point_m=(20.0, 0.0))
        if k == 0:
            one.begin(moment)
        if one.step(moment).event is not None:
            return [k]
    return []


def _squares(settings: LoadingSettings) -> list[Any]:
    """Return the phase and the pedals of a machine near the pile: turned by some degrees, and bent."""
    found: list[Any] = []
    for x, turned, bend in ((22.5, 0.11, 0.0), (22.5, 0.0, 0.11), (24.8, 0.0, 0.5)):
        one = Positioning(MODEL, BODIES, settings)
        motion = _motion(0, x)._replace(heading_rad=turned, articulation_rad=bend)
        moment = _moment(0, motion, np.zeros((0, 2)))._replace(target=_PILE)
        one.begin(moment)
        step = one.step(moment)
        found.append([step.phase, step.pedals, step.event])
    return found
