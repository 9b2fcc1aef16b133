"""Faults: when they begin by time and by place, what the simulator does with them, and what followed."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
from lhdmap.errors import ConfigError
from lhdmap.replay.assemble import Watchers, assemble
from lhdmap.replay.journal import Journal
from lhdmap.replay.process import MISSION, Outgoing, Process, Received
from lhdmap.replay.processes.film import Film
from lhdmap.replay.processes.plant import COMMAND_LIMIT_NS
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.history import START_NS
from lhdmap.simulation.sensing.faults import FaultSettings

from tests.replay.doubles import Corridor, Straight, parts
from tests.replay.runs import go, scenario

S = 1_000_000_000


class Listener(Process):
    """Keeps what comes on some topics."""

    name, period_ns, inbox_size = "listener", 100_000_000, 100_000

    def __init__(self, *topics: str, name: str = "listener") -> None:
        self.reads, self.name = topics, name
        self.got: list[Received] = []

    def step(self, now_ns: int, inbox: Sequence[Received]) -> list[Outgoing]:
        self.got += inbox
        return []


def fault(**table: object) -> dict[str, object]:
    return {"fault": [table]}


def test_a_fault_begins_at_its_place() -> None:
    told = scenario(**fault(kind="dead", at="gate", target="/inclinometer"))
    listener = Listener("/inclinometer")
    run, _ = go(told, parts(Straight(20.0), scans=False, places={"gate": (12.0, 0.0, 0.0)}), more=[listener])
    began = run.faults.all[0].told()["began_s"]
    assert began == pytest.approx((12.0 - 3.0) / 2.0 + 1.0, abs=0.05)  # 2 m/s after 2 s at 1 m/s²; 3 m before it
    assert (listener.got[-1].sent_ns - START_NS) / S == pytest.approx(began, abs=0.02)


def test_a_fault_begun_in_a_run_under_way_is_that_of_a_scenario_at_this_time() -> None:
    """Until it begins, and after it has ended, all is as without it; the verdict tells it like the others."""
    listener, whole = Listener("/inclinometer"), parts(Straight(10.0), scans=False)
    journal = Journal()
    run = assemble(scenario(), whole, journal, Watchers(Film(whole.machine), more=[listener]))
    for now_ns in run.engine.run(START_NS + 5 * S):
        if now_ns >= START_NS + 2 * S and not run.faults.all:
            run.faults.inject(FaultSettings(kind="dead", target="/inclinometer", duration_s=1.5), now_ns)
    run.engine.finish()
    began_s = run.faults.all[0].told()["began_s"]
    assert began_s == pytest.approx(2.0, abs=0.1)
    assert run.faults.all[0].told()["ended_s"] == pytest.approx(began_s + 1.5)
    sent_s = [(one.sent_ns - START_NS) / S for one in listener.got]
    assert [at for at in sent_s if at < began_s - 0.02]
    assert not [at for at in sent_s if began_s + 0.02 <= at < began_s + 1.48]
    assert [at for at in sent_s if at >= began_s + 1.52]


def test_a_fault_of_a_sensor_by_time_is_that_of_a_log() -> None:
    told = scenario(**fault(kind="dead", at_s=2.0, duration_s=1.5, target="/inclinometer"))
    listener = Listener("/inclinometer")
    go(told, parts(Straight(10.0), scans=False), more=[listener])
    sent_s = [(one.sent_ns - START_NS) / S for one in listener.got]
    assert not [at for at in sent_s if 2.0 <= at < 3.5]
    assert [at for at in sent_s if at >= 3.5]


def test_sensor_messages_appear_at_their_own_time() -> None:
    listener = Listener("/machine/tachometer")
    go(scenario(), parts(Straight(5.0), scans=False), more=[listener])
    stamps = [one.sent_ns for one in listener.got]
    assert stamps == [one.message.stamp_ns for one in listener.got]
    assert (stamps[0] - START_NS) % 10_000_000 == 3_000_000  # between two steps of the machine


def test_a_stuck_steering_holds_the_course() -> None:
    told = scenario(**fault(kind="steering_stuck", at_s=1.0))
    whole = parts(Straight(20.0, steering_rps=0.02), scans=False)
    film = Film(whole.machine)
    run = assemble(told, whole, Journal(), Watchers(film))
    for _ in run.engine.run(START_NS + 4 * S):
        pass
    yaw = film.series.rows()[:, 4]
    assert yaw[-1] == pytest.approx(0.02, abs=0.002)  # one second of turning
    assert yaw[-1] == yaw[15]


def test_without_commands_the_machine_brakes_on_its_own() -> None:
    told = scenario(driver="teleoperator", **fault(kind="link_lost", at_s=4.0, duration_s=5.0, target="link"))
    whole = parts(Straight(30.0), scans=False)
    run, events = go(told, whole)
    plant = [((one.t_ns - START_NS) / S, one.after, one.cause) for one in events if one.process == "plant"]
    assert [state for _, state, _ in plant][:4] == ["braking", "commanded", "braking", "commanded"]
    assert plant[2][0] == pytest.approx(4.0 + COMMAND_LIMIT_NS / S, abs=0.12)
    assert plant[2][2] == "no command"
    followed = run.faults.all[0].told()["followed"]
    assert ("plant", "braking") in [(one["process"], one["to"]) for one in followed]
    assert run.monitor.tally.drive.stops == 1


def test_an_obstacle_stands_where_it_should_and_goes() -> None:
    seen: list[tuple[float, float]] = []

    class Noted(Corridor):
        def appear(self, name: str, mesh: Mesh) -> None:
            middle = mesh.vertices_m.mean(axis=0)
            seen.append((float(middle[0]), float(mesh.vertices_m.max(axis=0)[2] - mesh.vertices_m.min(axis=0)[2])))
            super().appear(name, mesh)

    told = scenario(
        fault=[
            {"kind": "obstacle", "at_s": 3.0, "duration_s": 1.0, "size": 1.5},
            {"kind": "person", "at": "gate", "duration_s": 2.0},
        ]
    )
    world = Noted()
    go(told, parts(Straight(20.0), scans=False, world=world, places={"gate": (30.0, 1.0, 0.0)}))
    assert seen[0][0] == pytest.approx(30.0)  # there from the beginning on
    assert seen[0][1] == pytest.approx(1.8)
    x_after_3_s = 0.5 * 2.0**2 + 2.0 * 1.0
    assert seen[1][0] == pytest.approx(x_after_3_s + 12.0, abs=0.15)
    assert not world.appeared


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ({"kind": "overrun", "target": "perceptio"}, "no such process"),
        ({"kind": "overrun", "target": "plant"}, "no such process"),
        ({"kind": "person", "at": "gat"}, "no such place; did you mean 'gate'"),
        ({"kind": "dead", "target": "/lidar/points"}, "no sensor writes to target"),
    ],
)
def test_faults_without_a_target_here_are_refused(table: dict[str, object], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        go(scenario(**fault(**table)), parts(scans=False, places={"gate": (1.0, 0.0, 0.0)}))


def test_the_mission_is_told_on_the_bus() -> None:
    listener = Listener(MISSION)
    go(scenario(), parts(Straight(5.0), scans=False), more=[listener])
    assert [one.message.text for one in listener.got][:1] == ["driving"]
    assert math.isfinite(listener.got[0].sent_ns)
