"""Each fault against the readings of the same sensor without it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.errors import ConfigError, InputError
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, Inclination, Joints, LaserScan, PointCloud, Pressure, Record, Tachometer
from lhdmap.roles import ROLES
from lhdmap.simulation.history import START_NS
from lhdmap.simulation.sensing.faults import FaultSettings, load_faults, with_faults
from lhdmap.simulation.sensing.sections import CloudSettings, InclinometerSettings, ScannerSettings, SensorSettings
from lhdmap.simulation.sensing.sensor import Sensor
from lhdmap.simulation.sensing.suite import sensors_of

from tests.simulation.sensing.machines import history, readings

SETTINGS = SensorSettings(
    scanner=ScannerSettings(beams=41, noise_m=0.01, sweep=True),
    inclinometer=InclinometerSettings(noise_deg=0.0),
    cloud=CloudSettings(enabled=True, rings=4, columns=20),
)
MEASURED = ("front", "points", "inclinometer", "joints", "tachometer", "transmission_pressure")
PAST = history(
    8.0,
    SPEED=lambda t: 2.0 + 0.0 * t,
    WHEEL_SPEED=lambda t: 2.0 + 0.1 * t,
    PITCH=lambda t: 0.01 * t,
    ARTICULATION=lambda t: 0.05 * t,
)


def sensors() -> list[Sensor]:
    return sensors_of(Machine(), SETTINGS, seed=1)


def said(role: str, *faults: FaultSettings) -> list[Record]:
    topic = ROLES[role].topic
    return [r for r in readings(with_faults(sensors(), faults, seed=1), PAST) if r.topic == topic]


def fault(kind: str, role: str, size: float = 0.0, at_s: float = 2.0, duration_s: float = 3.0) -> FaultSettings:
    return FaultSettings(at_s=at_s, kind=kind, target=ROLES[role].topic, duration_s=duration_s, size=size)


def figures(message: Any) -> FloatArray:
    match message:
        case LaserScan():
            return message.ranges_m.astype(float)
        case PointCloud():
            return np.linalg.norm(message.points_m.astype(float), axis=1)
        case Inclination():
            return np.array([message.roll_rad, message.pitch_rad])
        case Joints():
            return np.array(list(message.positions_rad.values()))
        case Tachometer():
            return np.array([message.speed_mps])
        case Pressure():
            return np.array([message.pressure_pa])
    raise AssertionError(message)


def halves(role: str, faulty: list[Record]) -> tuple[list[tuple[Record, Record]], list[tuple[Record, Record]]]:
    """Return pairs of readings without and with a fault: those while it holds (2 s to 5 s), and the others."""
    pairs = list(zip(said(role), faulty, strict=True))
    within = [pair for pair in pairs if 2e9 <= pair[0].log_time_ns - START_NS < 5e9]
    return within, [pair for pair in pairs if pair not in within]


def same(pairs: list[tuple[Record, Record]]) -> bool:
    return all(repr(good) == repr(bad) for good, bad in pairs)


@pytest.mark.parametrize("role", [*MEASURED, "mode", "rear"])
def test_a_dead_sensor_says_nothing_and_then_goes_on_as_if_nothing_had_been(role: str) -> None:
    good = said(role)
    left = [one for one in good if not 2e9 <= one.log_time_ns - START_NS < 5e9]
    assert [repr(one) for one in said(role, fault("dead", role))] == [repr(one) for one in left]
    assert len(left) < len(good)
    for_good = said(role, fault("dead", role, duration_s=0.0))
    assert [repr(one) for one in for_good] == [repr(one) for one in good if one.log_time_ns - START_NS < 2e9]


@pytest.mark.parametrize("role", MEASURED)
def test_a_frozen_sensor_repeats_its_last_reading_with_new_stamps(role: str) -> None:
    within, others = halves(role, said(role, fault("frozen", role)))
    assert same(others)
    last = max((good for good, _ in others if good.log_time_ns - START_NS < 2e9), key=lambda one: one.log_time_ns)
    for good, bad in within:
        assert (bad.log_time_ns, bad.message.stamp_ns) == (good.log_time_ns, good.message.stamp_ns)
        assert figures(bad.message) == pytest.approx(figures(last.message), abs=0.0)


@pytest.mark.parametrize("role", MEASURED)
def test_a_delayed_sensor_comes_late_with_right_stamps(role: str) -> None:
    good, bad = said(role), said(role, fault("delayed", role, 0.25))
    assert [one.log_time_ns for one in bad] == sorted(one.log_time_ns for one in bad)
    late = {one.message.stamp_ns: one for one in bad}
    for one in good:
        delay = 250_000_000 if 2e9 <= one.log_time_ns - START_NS < 5e9 else 0
        assert late[one.message.stamp_ns].log_time_ns == one.log_time_ns + delay
        assert figures(late[one.message.stamp_ns].message).tolist() == figures(one.message).tolist()


@pytest.mark.parametrize(("role", "size"), list(zip(MEASURED, (0.3, 0.3, 0.02, -0.03, 0.2, 3e5), strict=True)))
def test_a_biased_sensor_is_off_by_the_size(role: str, size: float) -> None:
    within, others = halves(role, said(role, fault("biased", role, size)))
    assert same(others)
    for good, bad in within:
        assert figures(bad.message) - figures(good.message) == pytest.approx(size, rel=1e-4)


@pytest.mark.parametrize(("role", "size"), list(zip(MEASURED, (0.3, 0.3, 0.02, 0.03, 0.2, 3e5), strict=True)))
def test_a_noisy_sensor_has_that_much_more_noise(role: str, size: float) -> None:
    within, others = halves(role, said(role, fault("noisy", role, size)))
    assert same(others)
    error = np.concatenate([figures(bad.message) - figures(good.message) for good, bad in within])
    assert error.std() == pytest.approx(size, rel=0.25)
    assert error.mean() == pytest.approx(0.0, abs=4.0 * size / math.sqrt(error.size))


@pytest.mark.parametrize("role", MEASURED)
def test_nan_is_in_every_figure(role: str) -> None:
    within, others = halves(role, said(role, fault("nan", role)))
    assert same(others)
    assert all(np.isnan(figures(bad.message)).all() for _, bad in within)


@pytest.mark.parametrize("role", ["inclinometer", "joints"])
def test_a_share_of_messages_is_dropped_at_chance(role: str) -> None:
    good = said(role)
    kept = {one.log_time_ns: one for one in said(role, fault("dropped", role, 0.3, at_s=0.0, duration_s=0.0))}
    assert 1.0 - len(kept) / len(good) == pytest.approx(0.3, abs=0.06)
    assert all(repr(kept[one.log_time_ns]) == repr(one) for one in good if one.log_time_ns in kept)


def test_a_clock_that_jumps_shifts_the_stamps_from_then_on() -> None:
    good, bad = said("front"), said("front", fault("jump", "front", -0.5, duration_s=0.0))
    steps = [b.message.stamp_ns - g.message.stamp_ns for g, b in zip(good, bad, strict=True)]
    times = [g.log_time_ns - START_NS for g in good]
    assert steps == [-500_000_000 if time >= 2e9 else 0 for time in times]
    assert [g.log_time_ns for g in good] == [b.log_time_ns for b in bad]


def test_faults_of_one_sensor_come_one_after_the_other_or_together() -> None:
    both = said("tachometer", fault("biased", "tachometer", 0.5), fault("delayed", "tachometer", 0.1))
    alone = said("tachometer", fault("biased", "tachometer", 0.5))
    assert sorted(one.message.stamp_ns for one in both) == [one.message.stamp_ns for one in alone]
    by_stamp = {one.message.stamp_ns: figures(one.message)[0] for one in both}
    assert all(by_stamp[one.message.stamp_ns] == figures(one.message)[0] for one in alone)


def test_a_file_of_faults_is_read(tmp_path: Path) -> None:
    file = tmp_path / "faults.toml"
    file.write_text('[[fault]]\nat_s = 3\nkind = "biased"\ntarget = "/inclinometer"\nduration_s = 5.0\nsize = 0.01\n')
    assert load_faults(file) == (FaultSettings(3.0, "", "biased", "/inclinometer", 5.0, 0.01),)
    with pytest.raises(InputError, match=r"none\.toml"):
        load_faults(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('kind = "frosen"', r"\[\[fault\]\] 1: unknown kind 'frosen'; did you mean 'frozen'"),
        ('kind = "dead"\nsise = 1.0', "unknown setting 'sise'; did you mean 'size'"),
        ('target = "/inclinometer"', "kind is missing"),
        ('kind = "biased"', "size is missing"),
        ('kind = "dropped"\nsize = 1.5', "share, 0 to 1"),
        ('kind = "delayed"\nsize = -1.0', "more than 0"),
        ('kind = "dead"\nat_s = -1.0', "at_s"),
    ],
)
def test_wrong_faults_are_refused(tmp_path: Path, text: str, told: str) -> None:
    file = tmp_path / "faults.toml"
    file.write_text(f"[[fault]]\n{text}\n")
    with pytest.raises(ConfigError, match=told):
        load_faults(file)


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (FaultSettings(kind="dead", target="/inclinometr"), "did you mean '/inclinometer'"),
        (FaultSettings(kind="overrun", target="odometry"), "belongs to 'lhdmap replay'"),
        (FaultSettings(at="DP1", kind="dead", target="/inclinometer"), "at = 'DP1' belongs to"),
        (FaultSettings(kind="biased", target="/operation/mode", size=1.0), "no figures"),
    ],
)
def test_faults_that_no_sensor_can_have_are_refused(settings: FaultSettings, told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        with_faults(sensors(), [settings], seed=1)
