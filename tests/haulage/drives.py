"""A machine that drives itself along the lines of a layout, and loads and dumps after a while: what a mission is tried with."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from lhdmap.haulage.layout import Layout
from lhdmap.haulage.mission import MissionTask
from lhdmap.haulage.mission_io import Buckets, MissionInput, MissionOutput, Navigation, Report
from lhdmap.haulage.records import Cycle
from lhdmap.haulage.states import MOVING, Event, State

TICK_NS = 100_000_000
SPEED_MPS = 4.0
LOAD_S, DUMP_S = 25.0, 18.0


@dataclass
class Drive:
    """`lateral_m`: how far it drives beside the lines."""

    layout: Layout
    lateral_m: float = 0.4
    task: MissionTask = field(init=False)
    now_ns: int = 1_000_000_000
    odometer_m: float = 0.0
    s_m: float = 0.0
    edge: int = -1
    begun_s: float = 0.0
    number: int = 0
    arrived: str = ""
    events: list[Event] = field(default_factory=list)
    states: list[State] = field(default_factory=list)
    stages: list[int] = field(default_factory=list)
    cycles: list[Cycle] = field(default_factory=list)
    fails: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.task = MissionTask(self.layout)

    def run(self, orders: tuple[Buckets, ...], seconds: float, **given: Any) -> MissionOutput:
        """Run until the machine is parked again, or for so long."""
        for _ in range(int(seconds * 1e9 / TICK_NS)):
            output = self.tick(orders, **given)
            if output.state == State.IDLE and not output.left and self.cycles:
                break
        return output

    def tick(self, orders: tuple[Buckets, ...], **given: Any) -> MissionOutput:
        output = self.task.update(self.inputs(orders, **given))
        self.follow(output)
        return output

    def inputs(self, orders: tuple[Buckets, ...], **given: Any) -> MissionInput:
        """Return what the mission is told a tick later."""
        self.now_ns += TICK_NS
        said = Navigation("arrived", self.arrived) if self.arrived else Navigation("driving")
        inputs: dict[str, Any] = {
            "pose_map": self._pose(), "odometer_m": self.odometer_m, "navigation": said, "orders": orders,
        }  # fmt: skip
        return MissionInput(self.now_ns, **(inputs | self._reports() | given))

    def _reports(self) -> dict[str, Report]:
        status, now_s = self.task.status, 1e-9 * self.now_ns
        reports = {}
        for state, name, lasts_s in ((State.LOAD, "loading", LOAD_S), (State.DUMP, "dumping", DUMP_S)):
            if status.state == state and now_s - self.begun_s >= lasts_s:
                end = self.fails.pop(0) if self.fails else "done"
                reports[name] = Report(self.number, end, 10.0, 0.91, 1, 0.05)  # type: ignore[arg-type]
        return reports

    def follow(self, output: MissionOutput) -> None:
        """Do what the mission asks for."""
        self.events += output.events
        if not self.states or self.states[-1] != output.state:
            self.states.append(output.state)
        if output.stage and (not self.stages or self.stages[-1] != output.stage):
            self.stages.append(output.stage)
        if output.cycle is not None:
            self.cycles.append(output.cycle)
        if output.task != self.number:
            self.number, self.begun_s = output.task, 1e-9 * self.now_ns
        status = self.task.status
        if status.edge != self.edge and status.state in MOVING:
            self.edge, self.arrived = status.edge, ""
            self.s_m = self.layout.edges[self.edge].length_m if status.ended else 0.0
        if output.motion != "stop" and status.state in MOVING and not status.ended:
            step_m = SPEED_MPS * 1e-9 * TICK_NS
            self.s_m += step_m
            self.odometer_m += step_m
            edge = self.layout.edges[self.edge]
            if edge.kind == State.DOCK and self.s_m >= edge.length_m:
                self.arrived = edge.end

    def _pose(self) -> tuple[float, float, float] | None:
        line = self.layout.edges[self.edge].line_m if self.edge >= 0 else None
        if line is None:
            return None
        at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T))])
        end = max(self.s_m - at[-1], 0.0)
        x, y = (float(np.interp(self.s_m, at, line[:, k])) for k in (0, 1))
        k = int(np.clip(np.searchsorted(at, self.s_m), 1, len(at) - 1))
        u = (line[k, :2] - line[k - 1, :2]) / (at[k] - at[k - 1])
        return (
            float(x + end * u[0] - self.lateral_m * u[1]),
            float(y + end * u[1] + self.lateral_m * u[0]),
            float(np.arctan2(u[1], u[0])),
        )
