"""A run of `kind = "grizzly"`: look, decide, move, strike, look again, until the grizzly is free; no mine and no vehicle."""

from __future__ import annotations

from typing import Any

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.replay.grizzly_verdict import FREE, Counts, verdict_of
from lhdmap.replay.journal import Journal
from lhdmap.replay.scenario import Scenario
from lhdmap.replay.verdict import INTERRUPTED
from lhdmap.rockbreaker.check import check
from lhdmap.rockbreaker.collision import joint_positions
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.rockbreaker.orientation import nearest_vertical
from lhdmap.rockbreaker.plan import Plan
from lhdmap.rockbreaker.station import Decision, Pose, Station
from lhdmap.rockbreaker.story import Look, Move, Stop, Story
from lhdmap.rockbreaker.table import sampled
from lhdmap.settings import figure
from lhdmap.simulation.grizzly_world import GrizzlyWorld
from lhdmap.simulation.history import SECOND_NS, START_NS

PERCEPTION, PLANNER, BREAKER = "perception", "planner", "rockbreaker"
FILM_HZ = 20.0
_LEVEL_M = 0.01
_KEPT_POINTS = 20_000  # of a look


class GrizzlyRun:
    """Steps world and station; the station sees clouds alone, the truth goes to the world and the verdict."""

    def __init__(self, scenario: Scenario, world: GrizzlyWorld, station: Station, journal: Journal) -> None:
        self._scenario, self._world, self._station, self._journal = scenario, world, station, journal
        park_m = station.park_m
        self._at = Pose(park_m, nearest_vertical(station.machine, park_m))
        self.story, self.counts = Story(), Counts(len(world.oversize))
        self.ended, self.reason = False, "not ended"

    @property
    def machine(self) -> Rockbreaker:
        """The machine at work."""
        return self._station.machine

    @property
    def now_s(self) -> float:
        """Simulated seconds since the start."""
        return (self._journal.now_ns - START_NS) / SECOND_NS

    def step(self) -> None:
        """Look once, and do what the station decides."""
        points_m = self._looked()
        decision = self._station.decide(points_m, self._at)
        self._tell(decision, points_m)
        if decision.stuck:
            self._end(decision.stuck)
        elif not decision.moves:
            left = len(self._world.oversize)
            self._end(f"the station sees none, but {left} oversize rocks lie there" if left else FREE)
        else:
            self._do(decision)
            self._judge()

    def interrupt(self) -> None:
        """End the run because somebody wants it."""
        self._end(INTERRUPTED)

    def verdict(self, realtime_factor: float) -> dict[str, Any]:
        """Return what `verdict.json` says."""
        self.counts.left = len(self._world.oversize)
        found = verdict_of(self.reason, self.now_s, self.counts, self.story, self._station)
        return found | {"realtime_factor": realtime_factor, "journal_sha256": self._journal.sha256}

    def _judge(self) -> None:
        """End the run where something must not go on."""
        limits, counts = self._scenario.limits, self.counts
        if len(counts.contacts) > limits.contacts:
            self._end(f"contact: {counts.contacts[-1]['body']}")
        elif counts.problems:
            self._end(f"a plan that is not valid: {counts.problems[0]}")
        elif self.now_s > limits.time_s:
            self._end(f"time limit: not free after {figure(limits.time_s)} s")

    def _end(self, reason: str) -> None:
        self.ended, self.reason = True, reason

    def _looked(self) -> FloatArray:
        """Let the scanners see, the arm where it is, and return the cloud (N, 3)."""
        theta = self._at.theta(self.machine)
        points_m = self._world.look(joint_positions(self.machine, theta[None])[0])
        self._wait(self._scenario.grizzly.look_s)
        return points_m

    def _tell(self, decision: Decision, points_m: FloatArray) -> None:
        """Write what was seen and decided."""
        known = tuple(self._station.known)
        seen = [[*np.round(one.top_m, 3).tolist(), round(one.size_m, 3)] for one in known]
        self._journal.write(PERCEPTION, "rocks", values={"oversize": seen, "standing": len(decision.scene.rocks)})
        kept = points_m[:: max(1, len(points_m) // _KEPT_POINTS)]
        self.story.looks.append(Look(self.now_s, decision.scene, known, kept))
        if decision.rock is not None:
            if self.counts.first_order_s is None:
                self.counts.first_order_s = decision.order_s
            order = [np.round(one.top_m[:2], 2).tolist() for one in decision.order]
            self._journal.write(PLANNER, "order", values={"places_m": order, "time_s": decision.order_s})
        elif decision.moves:
            self._journal.write(PLANNER, "home", cause=decision.stuck or "no oversize rock is seen")

    def _do(self, decision: Decision) -> None:
        """Move, strike and lift."""
        struck_m = None if decision.rock is None else decision.rock.top_m
        for plan in decision.moves:
            self._move(plan, struck_m)
        if decision.rock is None or decision.lift is None:
            return
        self._wait(self._scenario.grizzly.blow_s)
        blow = self._world.strike(self._at.tip_m)
        values = {"tip_m": self._at.tip_m, "size_m": decision.rock.size_m, "left": blow.left}
        self._journal.write(BREAKER, "blow", cause=blow.outcome, values=values)
        self.story.stops.append(Stop(self.now_s, decision.rock, blow.outcome))
        self._move(decision.lift, self._at.tip_m)

    def _move(self, plan: Plan, struck_m: FloatArray | None) -> None:
        """Run a trajectory: check it without the planner's samples, and against the true surroundings."""
        trajectory, counts = plan.trajectory, self.counts
        if trajectory is None:
            return
        way_m, duration_s = trajectory.way_m(), trajectory.law.duration_s
        level = float(np.ptp(way_m[:, 2])) < _LEVEL_M
        problems = check(trajectory.path, trajectory.law).problems
        counts.problems += problems
        contact = self._world.obstacles(None if level else struck_m).first_contact(trajectory.path)
        counts.clearance_m = min(counts.clearance_m, contact.clearance_m)
        if contact.refusal is not None:
            point_m = trajectory.path.tip(np.array([contact.refusal.sigma]))[0].tolist()
            entry = {"t_s": self.now_s, "body": contact.refusal.limit, "point_m": point_m}
            counts.contacts.append(entry | {"depth_m": -contact.clearance_m})
        values = {"from_m": way_m[0], "to_m": way_m[-1], "path": plan.request.path, "time_s": duration_s}
        values |= {"valid": not problems, "clearance_m": trajectory.clearance_m}
        self._journal.write(BREAKER, "move", values=values)
        self.story.moves.append(Move(self.now_s, duration_s, way_m, level))
        self.story.rows.append(sampled(trajectory, FILM_HZ))
        self._pass(duration_s)
        self._at = Pose(plan.request.end_m, plan.phi_to)

    def _wait(self, duration_s: float) -> None:
        """Let time pass while the arm stands."""
        self.story.rests(duration_s)
        self._pass(duration_s)

    def _pass(self, duration_s: float) -> None:
        self._journal.now_ns += round(duration_s * SECOND_NS)
