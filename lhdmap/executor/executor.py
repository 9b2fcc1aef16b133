"""The command executor: each period one command of the machine, from the queue, within limits, or a brake along the path.

`topological_navigation`, section 3.4.4. What watchdog and guard ask for comes as a `Stop`; it decides on two stops itself:
a queue that is exhausted, and a speed from which a full brake would end after the last queued command (Eq. (20)).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion, Setpoint
from lhdmap.executor.limits import SpeedLimiter, changed, dead_zone, speed_bound
from lhdmap.executor.notes import Notes, Stop
from lhdmap.executor.path import PathKeeper, Sent
from lhdmap.executor.queue import CommandQueue
from lhdmap.executor.settings import ExecutorSettings
from lhdmap.messages import Command

STANDING_MPS = 0.02
_SHIFT_MPS = 0.05  # slower than this the other gear may be asked for
_FREED_MPS = 0.2  # so far below the bound a brake that the bound put on is let go
_LONGEST_PERIOD_S = 0.1
_PARKS_MPS = 0.8  # a brake for a planned stop is for its end alone
_STAYS_M = 0.03  # it stays on until the plan goes on by so much
_RESERVE = 0.92  # of the bound is commanded: tyres slip downhill, and from the bound on it brakes


class Executor:
    """Call `step` each 10 to 20 ms; `notes` has what is to be journalled."""

    def __init__(self, model: DriveModel, settings: ExecutorSettings) -> None:
        self.model, self.settings = model, settings
        self.queue, self.keeper, self.notes = CommandQueue(), PathKeeper(model), Notes()
        self.state, self.emergency = "standing", ""
        self._limiter, self._rate_rps, self._resting = SpeedLimiter(), 0.0, False
        self._last_ns: int | None = None

    def loaded(self, model: DriveModel) -> None:
        """Take the model for another load."""
        self.model = self.keeper.model = model

    def insert(self, setpoints: Sequence[Setpoint], now_ns: int) -> bool:
        """Take a plan; False where it is none (not finite, out of order) or an emergency stop holds."""
        if self.emergency:
            return False
        try:
            self.queue.insert(setpoints)
        except ValueError as error:
            self.notes.add("refused", cause=str(error))
            return False
        self.queue.forget(now_ns)
        self.keeper.plan(self.queue, now_ns)
        return True

    def clear(self) -> None:
        """Erase the queue; the path stays, to brake on it."""
        self.queue.clear()

    def stop(self, cause: str) -> None:
        """Emergency stop: latched until `release`."""
        if not self.emergency:
            self.notes.add("emergency", after="stop", cause=cause)
        self.emergency = self.emergency or cause
        self.clear()

    def release(self, cause: str) -> bool:
        """Let go of an emergency stop, at standstill alone; nothing moves by that: the queue is empty."""
        if self.emergency and self.standing:
            self.notes.add("emergency", "stop", "released", cause, was=self.emergency)
            self.emergency = ""
        return not self.emergency

    @property
    def standing(self) -> bool:
        """Whether the machine stood when it was last seen."""
        return self.keeper.motion is not None and abs(self.speed_mps) <= STANDING_MPS

    @property
    def speed_mps(self) -> float:
        """Speed when the machine was last seen."""
        return 0.0 if self.keeper.motion is None else self.keeper.motion.speed_mps

    def step(
        self, now_ns: int, motion: Motion | None, stop: Stop = Stop.GO, cause: str = "", pull_mps2: float = 0.0
    ) -> Command:
        """Return the command of now.

        Args:
            now_ns: time.
            motion: the newest that is known.
            stop: the hardest stop that watchdog, guard or navigation asks for.
            cause: why, for the journal.
            pull_mps2: gravity along x of the machine: positive where the nose is lower.
        """
        self.keeper.sees(motion)
        if self._last_ns is None:
            self._limiter.restart(self.speed_mps)  # it may be driven already
        period_s = self._period_s(now_ns)
        self.queue.forget(now_ns)
        if stop is Stop.EMERGENCY:
            self.stop(cause)
        wanted = self.queue.at(now_ns)
        way = self.speed_mps if wanted is None or abs(self.speed_mps) > STANDING_MPS else wanted.speed_mps
        bound = speed_bound(self.model, self.queue.left_s(now_ns), period_s, math.copysign(1.0, way) * pull_mps2)
        stop, cause = self._decided(wanted, stop, cause, bound)
        if stop >= Stop.FULL or wanted is None:
            return self._brake(now_ns, cause, period_s)
        if stop is Stop.SERVICE:
            return self._service(now_ns, cause, period_s)
        return self._drive(now_ns, wanted, period_s, bound, held=stop is Stop.HOLD)

    def dig(
        self, now_ns: int, motion: Motion | None, pedals: Command, stop: Stop = Stop.GO, cause: str = ""
    ) -> Command:
        """Return the command of now for a loading controller, who asks for pedals and not for a path; any stop is a brake.

        The joint moves within its limits; a gear is changed at standstill alone; the queue stays empty.
        """
        self.keeper.sees(motion)
        period_s = self._period_s(now_ns)
        self.queue.clear()
        if stop is Stop.EMERGENCY:
            self.stop(cause)
        if self.emergency or stop >= Stop.SERVICE:
            return self._brake(now_ns, self.emergency or cause, period_s)
        self._goes("digging", "pedals")
        self._limiter.restart(self.speed_mps)
        rate = self._steered(pedals.steering_rate_rps, period_s)
        propel = min(max(pedals.propel, -1.0), 1.0)
        if propel * self.speed_mps < 0.0 and abs(self.speed_mps) > _SHIFT_MPS:
            propel = 0.0  # the other gear through standstill alone
        self.keeper.gave(Sent(now_ns, self.speed_mps, rate, pedals.brake))
        return pedals._replace(stamp_ns=now_ns, propel=propel, steering_rate_rps=rate)

    def _period_s(self, now_ns: int) -> float:
        last, self._last_ns = self._last_ns, now_ns
        return 0.01 if last is None else min(max((now_ns - last) * 1e-9, 1e-3), _LONGEST_PERIOD_S)

    def _decided(self, wanted: Setpoint | None, stop: Stop, cause: str, bound: float) -> tuple[Stop, str]:
        """Return the hardest stop that anybody asks for, and why."""
        if self.emergency:
            return Stop.EMERGENCY, self.emergency
        if stop >= Stop.FULL:
            return stop, cause
        if wanted is None:
            return Stop.FULL, "queue exhausted"
        speed = abs(self.speed_mps)
        freed = _FREED_MPS if self.state == "braking" else 0.0
        if bound <= 0.0 or (speed > STANDING_MPS and speed > bound - freed):
            return Stop.FULL, "a brake would end after the queue"
        return stop, cause

    def _drive(self, now_ns: int, wanted: Setpoint, period_s: float, bound: float, *, held: bool) -> Command:
        """Follow the queue within the limits."""
        limiter, model, speed = self._limiter, self.model, self.speed_mps
        self._goes("driving", "held" if held else "queue")
        target, slope = wanted.speed_mps, self.queue.slope_mps2(now_ns)
        bound *= _RESERVE
        if held:
            bound = min(bound, abs(limiter.speed_mps))
        if abs(target) > bound:
            target, slope = math.copysign(bound, target), 0.0
        if target * speed < 0.0 and abs(speed) > _SHIFT_MPS:
            target, slope = 0.0, 0.0  # the other gear through standstill alone
        limits = model.acceleration_mps2, model.deceleration_mps2, self.settings.jerk_mps3
        limiter.follow(target, slope, limits, period_s)
        rate = self._steered(wanted.steering_rate_rps, period_s)
        if self._comes_to_rest(self.queue.rest_m(now_ns)):
            return self._given(now_ns, 0.0, rate, brake=True, speed_mps=0.0)
        return self._driven(now_ns, rate)

    def _comes_to_rest(self, left_m: float) -> bool:
        """Return whether the brake ends a planned stop, in `left_m`, and holds the machine there.

        The drive runs out with its lag: it cannot be fed forward to less than nothing, and would go on for decimetres and
        seconds. The brake takes over when its way is what the plan has left.
        """
        limiter, model = self._limiter, self.model
        pace, slope = abs(limiter.speed_mps), math.copysign(limiter.slope_mps2, limiter.speed_mps * limiter.slope_mps2)
        if abs(self.speed_mps) > _PARKS_MPS:
            self._resting = False
            return False
        brakes_m = model.stopping_m(pace) - pace * model.dead_time_s
        runs_out = pace + model.drive_lag_s * slope <= 0.0
        self._resting = left_m <= (2.0 * brakes_m + _STAYS_M if self._resting else brakes_m if runs_out else -1.0)
        return self._resting

    def _service(self, now_ns: int, cause: str, period_s: float) -> Command:
        """Come to rest by the drive, along the path, then brake."""
        if self.standing and self._limiter.speed_mps == 0.0:
            return self._brake(now_ns, cause, period_s)
        self._goes("stopping", cause)
        limits = self.model.acceleration_mps2, self.model.deceleration_mps2, self.settings.jerk_mps3
        self._limiter.follow(0.0, 0.0, limits, period_s)
        rate = self._steered(self.keeper.steering(now_ns), period_s)
        if self._comes_to_rest(0.5 * self._limiter.speed_mps**2 / self.model.deceleration_mps2):
            return self._given(now_ns, 0.0, rate, brake=True, speed_mps=0.0)
        return self._driven(now_ns, rate)

    def _driven(self, now_ns: int, rate_rps: float) -> Command:
        """Return the command for the limiter's speed: the lag of the drive is fed forward."""
        speed, slope = self._limiter.speed_mps, self._limiter.slope_mps2
        propel = (speed + self.model.drive_lag_s * slope) / self.model.top_speed_mps
        if propel * speed < 0.0:
            propel = 0.0  # against the motion: the drive's own limit
        return self._given(now_ns, min(max(propel, -1.0), 1.0), rate_rps, brake=False, speed_mps=speed)

    def _brake(self, now_ns: int, cause: str, period_s: float) -> Command:
        """Brake fully, and steer along the path by distance until standstill."""
        self._goes("standing" if self.standing else "braking", cause)
        self._limiter.restart(self.speed_mps)
        rate = 0.0 if self.standing else self._steered(self.keeper.steering(now_ns), period_s)
        self._rate_rps = rate
        return self._given(now_ns, 0.0, rate, brake=True, speed_mps=0.0)

    def _steered(self, rate_rps: float, period_s: float) -> float:
        """Return a steering command within the rate of the joint, its change, and the dead zone (Eq. (21))."""
        most, settings = self.model.max_rate_rps, self.settings
        wanted = min(max(rate_rps, -most), most)
        self._rate_rps = changed(self._rate_rps, wanted, math.radians(settings.steering_jerk_dps2) * period_s)
        return dead_zone(self._rate_rps, math.radians(settings.steering_dead_zone_dps))

    def _given(self, now_ns: int, propel: float, rate_rps: float, *, brake: bool, speed_mps: float) -> Command:
        self.keeper.gave(Sent(now_ns, speed_mps, rate_rps, brake))
        return Command(now_ns, propel, rate_rps, 0.0, 0.0, full_rpm=False, brake=brake)

    def _goes(self, state: str, cause: str) -> None:
        if state != self.state:
            self.notes.add("state", self.state, state, cause, speed_mps=self.speed_mps)
            self.state = state
