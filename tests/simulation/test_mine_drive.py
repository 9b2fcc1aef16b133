"""Drives through mines: the operator follows his route and touches nothing, the log and what lies beside it say the same."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lhdmap.cli.main import main
from lhdmap.errors import LhdmapWarning, UsageError
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.messages import GroundTruth, LaserScan, Message, Tachometer, Text
from lhdmap.mine.make_network import make_network
from lhdmap.mine.network import Network
from lhdmap.mine.plan import find_plan, load_plan
from lhdmap.simulation.history import Column
from lhdmap.simulation.mine_drive import MineDrive, MineDriveSettings, SimulatedMineDrive, simulate_mine
from lhdmap.simulation.operator import OperatorSettings
from lhdmap.simulation.sensing.faults import FaultSettings
from lhdmap.simulation.vehicle.shaking import VIBRATION_DEG, Shaking
from lhdmap.trajectory import read_tum

from tests.mine.plans import TEE, lines, network_of

MACHINE = Machine()
DRAW_POINT = [{"drift": "B", "kind": "draw_point", "side": "end", "name": "DP"}]
SETTINGS = MineDriveSettings(route="A,DP,-A", seed=3, names=True, operator=OperatorSettings(speed_kmh=10.0))
SHORT = MineDriveSettings(route="A", seed=3, names=True, operator=OperatorSettings(speed_kmh=20.0))


@pytest.fixture(scope="module")
def network() -> Network:
    return network_of(TEE, place=DRAW_POINT, walls={"mesh_m": 0.15})


@pytest.fixture(scope="module")
def drive(network: Network, tmp_path_factory: pytest.TempPathFactory) -> SimulatedMineDrive:
    return simulate_mine(network, MACHINE, SETTINGS, tmp_path_factory.mktemp("drive") / "tee.mcap")


def read(log: Path, *roles: str) -> list[tuple[str, Message]]:
    with LogSource([log]) as source:
        return list(source.messages(roles))


def test_it_drives_in_and_comes_out_in_reverse(drive: SimulatedMineDrive) -> None:
    truth = read_tum(drive.truth_file)
    assert truth.positions_m[0] == pytest.approx([7.71, 0.0, 0.0], abs=0.15)
    deepest = truth.positions_m[np.argmax(truth.positions_m[:, 1])]
    assert deepest[:2] == pytest.approx([40.0, 50.0 - 8.0 - 2.2 - 3.2], abs=0.3)
    assert truth.positions_m[-1, 1] == pytest.approx(0.0, abs=0.3)
    assert drive.contacts == ()
    assert drive.min_clearance_m > 0.15
    way = np.linalg.norm(np.diff(truth.positions_m, axis=0), axis=1).sum()
    assert drive.distance_m == pytest.approx(way, rel=0.01)


def test_the_log_has_what_the_contract_says(drive: SimulatedMineDrive) -> None:
    seen: dict[str, list[object]] = {}
    for role, message in read(drive.log, "front", "rear", "ground_truth", "tachometer", "mode"):
        seen.setdefault(role, []).append(message)
    assert len(seen["front"]) == drive.scans
    assert abs(len(seen["rear"]) - drive.scans) <= 1
    scans = [one.stamp_ns for one in seen["front"] if isinstance(one, LaserScan)]
    assert scans == read_tum(drive.truth_file).stamps_ns.tolist()
    assert {one.text for one in seen["mode"] if isinstance(one, Text)} == {"manual"}
    speeds = [one.speed_mps for one in seen["tachometer"] if isinstance(one, Tachometer)]
    assert max(speeds) == pytest.approx(10.0 / 3.6, rel=0.1)
    assert min(speeds) < -1.5


def test_nodes_are_told_in_the_order_of_the_way(drive: SimulatedMineDrive) -> None:
    texts = [one.text for _, one in read(drive.log, "node") if isinstance(one, Text)]
    met = [name for k, name in enumerate(texts) if k == 0 or name != texts[k - 1]]
    assert met == ["A", "I1", "B", "DP", "B", "I1", "A"]
    with drive.nodes_file.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["stamp_ns"]) for row in rows] == read_tum(drive.truth_file).stamps_ns.tolist()
    inside = [row["node"] for k, row in enumerate(rows) if k == 0 or row["node"] != rows[k - 1]["node"]]
    assert inside == met
    names = {one["name"] for one in json.loads(drive.topology_file.read_text())["intersections"]}
    assert names == {"I1"}


@pytest.fixture(scope="module")
def short(network: Network, tmp_path_factory: pytest.TempPathFactory) -> SimulatedMineDrive:
    return simulate_mine(network, MACHINE, SHORT, tmp_path_factory.mktemp("short") / "tee.mcap")


def test_same_seed_same_bytes(network: Network, short: SimulatedMineDrive, tmp_path: Path) -> None:
    again = simulate_mine(network, MACHINE, SHORT, tmp_path / "tee.mcap")
    assert again.log.read_bytes() == short.log.read_bytes()
    other = simulate_mine(network, MACHINE, replace(SHORT, seed=4), tmp_path / "other.mcap")
    assert other.log.read_bytes() != short.log.read_bytes()


def test_without_truth_and_names_the_rest_is_the_same(
    network: Network, short: SimulatedMineDrive, tmp_path: Path
) -> None:
    bare = simulate_mine(network, MACHINE, replace(SHORT, names=False, truth=False), tmp_path / "bare.mcap")
    roles = ("front", "rear", "ground_truth", "node", "joints")
    whole, less = (read(log, *roles) for log in (short.log, bare.log))
    kept = [(role, one) for role, one in whole if role != "node" and not isinstance(one, GroundTruth)]
    assert [(role, one.stamp_ns) for role, one in less] == [(role, one.stamp_ns) for role, one in kept]
    for (_, a), (_, b) in zip(less, kept, strict=True):
        if isinstance(a, LaserScan):
            assert isinstance(b, LaserScan)
            assert np.array_equal(a.ranges_m, b.ranges_m)


def test_faults_are_those_of_the_sensors(network: Network, tmp_path: Path) -> None:
    dead = FaultSettings(at_s=5.0, kind="dead", target="/lidar/rear/scan")
    drive = simulate_mine(network, MACHINE, replace(SETTINGS, route="A", faults=(dead,)), tmp_path / "dead.mcap")
    rear = [one for _, one in read(drive.log, "rear")]
    assert rear[-1].stamp_ns - rear[0].stamp_ns < 5.1e9


@pytest.mark.parametrize(
    ("name", "route", "start", "speed_kmh"),
    [("narrow", "N,-N", "", 7.0), ("level", "-S1,OP1,-W,S2,TB1,-S2,DP9", "DP3", 10.0)],
)
def test_the_operator_touches_nothing(name: str, route: str, start: str, speed_kmh: float) -> None:
    settings = MineDriveSettings(route=route, start=start, operator=OperatorSettings(speed_kmh=speed_kmh))
    drive = MineDrive(make_network(load_plan(find_plan(name))), MACHINE, settings)
    drive.drive()
    assert drive.gauge.contacts == []
    assert drive.gauge.min_clearance_m > 0.09


def test_wandering_is_as_wide_as_asked(network: Network) -> None:
    settings = MineDriveSettings(route="A", operator=OperatorSettings(wander_m=0.2))
    drive = MineDrive(network, MACHINE, settings)
    lateral = [state.y_m for state in drive.drive() if 12.0 < state.x_m < 70.0]
    assert np.std(lateral) == pytest.approx(0.2, rel=0.5)


def test_speeds_are_kept(network: Network) -> None:
    settings = MineDriveSettings(route="A", operator=OperatorSettings(speed_kmh=6.0, speed_variation=0.0))
    states = MineDrive(network, MACHINE, settings).drive()
    speeds = np.array([state.speed_mps for state in states])
    assert speeds.max() * 3.6 == pytest.approx(6.0, abs=0.15)
    assert states[-1].x_m == pytest.approx(80.0 - 1.2 - 3.2, abs=0.2)
    assert math.degrees(max(abs(state.articulation_rad) for state in states)) < 5.0


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (["mine"], 2, "a plan file was wanted"),
        (["mine", "rign"], 2, "did you mean 'ring'"),
        (["mine", "ring", "--route", "T1,T9"], 2, "'T9' is no drift or place"),
        (["mine", "ring", "--start", "P9"], 2, "start 'P9' is no drift or place"),
        (["mine", "ring", "--length", "5"], 2, "--length: belongs not to a mine"),
        (["drift", "--route", "T1"], 2, "--route: belongs to 'lhdmap simulate mine PLAN'"),
        (["mine", "ring", "--speed-kmh", "90"], 2, "speed_kmh"),
    ],
)
def test_what_is_wrong_is_told(
    words: list[str], code: int, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", *words, "-o", str(tmp_path / "a.mcap")]) == code
    assert told in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_command_writes_log_truth_nodes_and_topology(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = tmp_path / "short.toml"
    plan.write_text(
        '[walls]\nmesh_m = 0.2\n[[drift]]\nname = "A"\nline_m = [[0, 0, 0], [30, 0, 1]]\n', encoding="utf-8"
    )
    log = tmp_path / "out.mcap"
    assert main(["simulate", "mine", str(plan), "--route", "A", "--names", "-o", str(log), "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["distance_m"] == pytest.approx(30.0 - 7.71 - 4.4, abs=0.5)
    assert values["contacts"] == []
    files = {path.name for path in tmp_path.iterdir()}
    assert files == {"short.toml", "out.mcap", "out.truth.tum", "out.topology.json", "out.nodes.csv"}


def test_drifts_that_no_way_leads_to_are_told() -> None:
    apart = lines(("A", [[0, 0, 0], [60, 0, 0]]), ("B", [[0, 40, 0], [60, 40, 0]]))
    with pytest.warns(LhdmapWarning, match="no way leads to B: not driven through"):
        MineDrive(network_of(apart, walls={"mesh_m": 0.3}), MACHINE, MineDriveSettings())


def test_a_drift_that_the_machine_fills_is_refused() -> None:
    with pytest.raises(UsageError, match="the machine fills the drift"):
        MineDrive(network_of(lines(("A", [[0, 0, 0], [9, 0, 0]]))), MACHINE, MineDriveSettings())


def test_the_mesh_goes_where_the_log_goes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = tmp_path / "short.toml"
    plan.write_text(
        '[walls]\nmesh_m = 0.3\n[[drift]]\nname = "A"\nline_m = [[0, 0, 0], [25, 0, 0]]\n', encoding="utf-8"
    )
    words = [
        "simulate",
        "mine",
        str(plan),
        "--route",
        "A",
        "-o",
        str(tmp_path / "a.mcap"),
        "--mesh",
        str(tmp_path / "a.ply"),
    ]
    assert main(words) == 0
    assert main(words) == 2
    assert main([*words, "--force"]) == 0
    assert (tmp_path / "a.ply").read_bytes().startswith(b"ply")
    assert "exists already" in capsys.readouterr().err


def test_vibration_has_its_size_and_its_band() -> None:
    shaking = Shaking(math.radians(VIBRATION_DEG), 3)
    rolls = np.array([shaking.onto(np.zeros(len(Column)), 0.01 * k)[Column.ROLL] for k in range(20_000)])
    assert np.degrees(rolls.std()) == pytest.approx(VIBRATION_DEG, rel=0.1)
    power = np.abs(np.fft.rfft(rolls)) ** 2
    frequency = np.fft.rfftfreq(len(rolls), 0.01)
    assert power[(frequency > 3.9) & (frequency < 9.1)].sum() > 0.99 * power.sum()
