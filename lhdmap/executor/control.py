"""Executor, watchdog, guard and modes as one object: what a machine's computer runs between guidance and the valves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from lhdmap.driving.bodies import Bodies
from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion, Setpoints
from lhdmap.executor.executor import Executor
from lhdmap.executor.guard_watch import GuardWatch
from lhdmap.executor.joint import JointWatch
from lhdmap.executor.modes import IDLE, MODES, Modes, operator_setpoints
from lhdmap.executor.notes import Note, Stop
from lhdmap.executor.settings import ExecutorSettings
from lhdmap.executor.watchdog import Watchdog
from lhdmap.messages import Command, FloatArray

_DIGS_NS = 100_000_000  # so old the pedals of a loading controller may be


class Control:
    """Give it inputs (`watchdog`), points, plans and modes as they come, and call `step` each 10 to 20 ms.

    It begins in `idle`, not armed. Nothing moves before `rearm`, a mode, and a plan made after both.
    """

    def __init__(
        self, model: DriveModel, bodies: Bodies, settings: ExecutorSettings, inputs: Mapping[str, float]
    ) -> None:
        self.executor = Executor(model, settings)
        self.watchdog, self.modes = Watchdog(inputs, settings), Modes()
        self.watch = GuardWatch(model, bodies, settings)
        self._joint = JointWatch(model)
        self._settings = settings
        self._pedals: Command | None = None

    def loaded(self, model: DriveModel) -> None:
        """Take the model for another load."""
        self.executor.loaded(model)
        self.watch.guard.model = self._joint.model = model

    def saw(
        self, name: str, stamp_ns: int, now_ns: int, values: Sequence[float] = (), content: int | None = None
    ) -> bool:
        """Take a message of an input, as `Watchdog.saw` does."""
        return self.watchdog.saw(name, stamp_ns, now_ns, values, content)

    def disagreement(self, stamp_ns: int, now_ns: int, apart_m: float, apart_rad: float) -> bool:
        """Take by how much pose and scan disagree."""
        return self.watchdog.disagreement(stamp_ns, now_ns, apart_m, apart_rad)

    def points(self, name: str, points_m: FloatArray, motion: Motion) -> None:
        """Take the points (N, 2) of a scanner in `base_link`, and the motion at their stamp; what is not finite goes."""
        self.watch.points(name, points_m, motion)

    def plan(self, source: str, setpoints: Setpoints, made_ns: int, now_ns: int) -> bool:
        """Take setpoints of `guidance` or `operator`, made of data of `made_ns`; False where they do not count now."""
        fresh = now_ns - made_ns <= self._settings.age_s * 1e9
        fits = self.watchdog.armed and fresh and self.modes.takes(source, made_ns)
        return fits and self.executor.insert(setpoints, now_ns)

    def operate(self, speed_mps: float, steering_rate_rps: float, made_ns: int, now_ns: int) -> bool:
        """Take an operator's command as a plan."""
        settings = self._settings
        plan = operator_setpoints(speed_mps, steering_rate_rps, now_ns, settings.hold_s, settings.age_s)
        return self.plan("operator", plan, made_ns, now_ns)

    def dig(self, pedals: Command, now_ns: int) -> bool:
        """Take what a loading controller asks of the pedals; False where it does not count now."""
        fits = self.watchdog.armed and self.modes.takes("guidance", pedals.stamp_ns)
        self._pedals = pedals if fits and self._fresh(pedals, now_ns) else None
        return self._pedals is not None

    def digs(self, now_ns: int) -> bool:
        """Return whether a loading controller has the pedals."""
        return self._pedals is not None and self.watchdog.armed and self._fresh(self._pedals, now_ns)

    def touches(self, corners_m: FloatArray | None) -> None:
        """Take where the bucket is to touch: corners (4, 2) in `odom`, counterclockwise; the guard looks beside it."""
        self.watch.touched_m = corners_m

    @staticmethod
    def _fresh(pedals: Command, now_ns: int) -> bool:
        return now_ns - pedals.stamp_ns <= _DIGS_NS

    def mode(self, name: str, now_ns: int, cause: str = "") -> bool:
        """Change the mode; the queue is emptied, so that the machine brakes until a plan comes that was made for it."""
        before = self.modes.name
        changed = self.modes.change(name, now_ns, refused=self._unfit(name, now_ns), cause=cause)
        if changed and name != before:
            self.executor.clear()
        return changed

    def emergency(self, cause: str) -> None:
        """Stop, whatever else is wanted; latched, and not armed any more."""
        self.executor.stop(cause)
        self.watchdog.trip((f"emergency stop: {cause}",))

    def release(self, cause: str) -> bool:
        """Let go of the emergency stop; False where it holds on, since the machine still moves."""
        return self.executor.release(cause)

    def rearm(self, now_ns: int, mode: str = "") -> tuple[str, ...]:
        """Arm for a mode (that in force, else `autonomous`); return what stands against it."""
        if self.executor.emergency:
            return (f"emergency stop: {self.executor.emergency}",)
        name = mode or (self.modes.name if self.modes.name != IDLE else "autonomous")
        reasons = self.watchdog.rearm(now_ns, MODES[name].needs)
        if not reasons:
            self.executor.clear()
            self.modes.renew(now_ns)
        return reasons

    def step(
        self, now_ns: int, motion: Motion | None, asked: Stop = Stop.GO, cause: str = "", pull_mps2: float = 0.0
    ) -> Command:
        """Return the command of now; the hardest stop of all layers wins, and of `asked`, what navigation wants."""
        self._watch_joint(motion)
        told, why = self.watchdog.check(now_ns, self.modes.mode.needs, standing=self.executor.standing)
        if not self.watchdog.armed:
            self.executor.clear()
        if told > asked:
            asked, cause = told, why
        if motion is not None and self._guarded(now_ns, motion, pull_mps2) and asked < Stop.FULL:
            asked, cause = Stop.FULL, "guard: contact on the braking path"
        if self._pedals is not None and self.digs(now_ns):
            command = self.executor.dig(now_ns, motion, self._pedals, asked, cause)
        else:
            command = self.executor.step(now_ns, motion, asked, cause, pull_mps2)
        self._joint.gave(now_ns, command.steering_rate_rps)
        return command

    def take_notes(self) -> list[tuple[str, Note]]:
        """Return what happened since the last call, each with who says so."""
        parts = {
            "watchdog": self.watchdog.notes,
            "modes": self.modes.notes,
            "guard": self.watch.notes,
            "executor": self.executor.notes,
        }
        return [(name, note) for name, notes in parts.items() for note in notes.take()]

    def _unfit(self, name: str, now_ns: int) -> tuple[str, ...]:
        """Return what stands against a mode, but for that the machine moves."""
        if name not in MODES or name == IDLE:
            return ()
        if not self.watchdog.armed:
            return ("not armed",)
        needs = MODES[name].needs
        return tuple(one for one in self.watchdog.refusals(now_ns, needs) if one != "the machine moves")

    def _watch_joint(self, motion: Motion | None) -> None:
        """Disarm where the joint does not do what it is told: what is predicted of the machine is wrong then."""
        apart_rad = 0.0 if motion is None else self._joint.sees(motion)
        if abs(apart_rad) > math.radians(self._settings.joint_deg) and not self.executor.standing:
            self.watchdog.trip((f"the joint is {math.degrees(apart_rad):.1f} deg off its commands",))

    def _guarded(self, now_ns: int, motion: Motion, pull_mps2: float) -> bool:
        """Return whether the guard holds the machine."""
        if self.watch.is_due(now_ns):
            commanded_mps, standing = self._commanded_mps(now_ns), self.executor.standing
            plan, digs = self._plan_ahead(), self._pedals is not None and self.digs(now_ns)
            self.watch.look(now_ns, motion, commanded_mps, plan, pull_mps2, standing=standing, digs=digs)
        return self.watch.holds

    def _commanded_mps(self, now_ns: int) -> float | None:
        """Return the speed that is asked for, by pedals or by the queue; None where nobody asks."""
        if self._pedals is not None and self.digs(now_ns):
            return self._pedals.propel * self.executor.model.top_speed_mps
        wanted = self.executor.queue.at(now_ns)
        return None if wanted is None else wanted.speed_mps

    def _plan_ahead(self) -> FloatArray | None:
        path = self.executor.keeper.path
        if path is None:
            return None
        ahead: FloatArray = np.column_stack([path.way_m - self.executor.keeper.way_m, path.bend_rad])
        return ahead
