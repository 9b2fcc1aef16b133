"""The pile stage on drives through drifts made of planes: what is found is what stands there."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.messages import FloatArray
from lhdmap.pile.approach import Approaches
from lhdmap.pile.face import FaceRegistration
from lhdmap.pile.result import PileApproach, PileEstimate, PileReport, Snapshot, estimate_json
from lhdmap.pile.settings import PileSettings
from lhdmap.pile.stage import PileStage

from tests.pile.cast_drift import EXACT, STEP_M, TILT_RAD, TOE_M, Box, CastDrift, Segments, drive, last_of

KEYS = {
    *("status", "center_m", "left_limit_m", "right_limit_m", "width_m", "inclination_deg", "width_std_m"),
    *("inclination_std_deg", "frame", "decided_at_ns", "distance_at_decision_m", "points", "boulders"),
}


@cache
def driven(drift: CastDrift, to_m: float = 28.0) -> PileReport:
    return drive(drift, to_m)


def _found(drift: CastDrift) -> Snapshot:
    return last_of(driven(drift))


@pytest.mark.parametrize(
    "drift",
    [
        CastDrift(35.0),
        CastDrift(45.0),
        CastDrift(55.0),
        CastDrift(45.0, width_m=3.4, grade=0.05, turn_rad=2.0, shift_m=(100.0, -50.0, 7.0)),
        CastDrift(40.0, width_m=4.4, grade=-0.05, turn_rad=-3.0, shift_m=(-20.0, 300.0, -400.0)),
    ],
    ids=["35", "45", "55", "uphill", "downhill"],
)
def test_plane_face_is_measured(drift: CastDrift) -> None:
    last = _found(drift)
    pile = last.estimate
    assert drift.slope_deg is not None
    assert pile.status == "loadable"
    assert pile.probabilities["loadable"] > 0.95
    assert pile.width_m == pytest.approx(drift.width_m, abs=0.05)
    assert pile.inclination_deg == pytest.approx(-drift.slope_deg, abs=1.0)
    assert abs(pile.inclination_deg + drift.slope_deg) < 2.0 * pile.inclination_std_deg
    for limit_m, side in ((pile.left_limit_m, 1.0), (pile.right_limit_m, -1.0)):
        assert drift.in_drift(limit_m) == pytest.approx([TOE_M, side * drift.width_m / 2, drift.grade * TOE_M], abs=0.1)
    machine_x_m = last.stamp_ns / 100_000_000 * STEP_M
    assert last.distance_m == pytest.approx(math.hypot(1.0, drift.grade) * (TOE_M - machine_x_m), abs=0.1)
    assert not pile.boulders


def test_plane_face_is_decided_before_the_deadline() -> None:
    decision = driven(CastDrift(45.0)).decision
    assert decision is not None
    assert decision.estimate.status == "loadable"
    assert decision.distance_m >= PileSettings().deadline_m
    assert decision.estimate.inclination_deg == pytest.approx(-45.0, abs=3.0 * decision.estimate.inclination_std_deg)


@pytest.mark.parametrize(
    ("slope_deg", "status"), [(90.0, "wall"), (15.0, "too_shallow"), (70.0, "hang_up"), (105.0, "hang_up")]
)
def test_what_is_not_to_be_loaded_is_named(slope_deg: float, status: str) -> None:
    report = driven(CastDrift(slope_deg))
    pile = last_of(report).estimate
    assert pile.status == status
    assert pile.inclination_deg == pytest.approx(-slope_deg, abs=1.0)
    assert pile.probabilities["loadable"] < 0.01
    assert report.decision is not None
    assert report.decision.estimate.status == status


def test_open_drift_is_none() -> None:
    report = driven(CastDrift(None))
    assert report.decision is None
    assert all(one.estimate.probabilities.get("loadable", 0.0) < 0.01 for one in report.history)
    assert report.to_json()["status"] == "none"
    assert report.to_json()["identified"] is False


def _arc(centre: tuple[float, float], radius: float) -> Segments:
    angles = np.linspace(-0.5 * math.pi, 0.0, 25)
    x, y = centre[0] + radius * np.cos(angles), centre[1] + radius * np.sin(angles)
    return tuple((float(x[i]), float(y[i]), float(x[i + 1]), float(y[i + 1])) for i in range(24))


CORNER: Segments = (
    *((-20.0, -2.0, 32.0, -2.0), (32.0, -2.0, 32.0, 60.0)),
    *((-20.0, 2.0, 28.0, 2.0), (28.0, 2.0, 28.0, 60.0)),
)
BEND: Segments = (
    *((-20.0, -2.0, 20.0, -2.0), *_arc((20.0, 15.0), 17.0)),
    *((-20.0, 2.0, 20.0, 2.0), *_arc((20.0, 15.0), 13.0)),
)


@pytest.mark.parametrize(("walls", "to_m"), [(CORNER, 24.0), (BEND, 19.0)], ids=["corner", "bend"])
def test_outer_wall_of_a_bend_is_none(walls: Segments, to_m: float) -> None:
    report = driven(CastDrift(None, walls=walls), to_m)
    assert report.decision is None
    assert report.to_json()["status"] == "none"


def test_rock_that_stands_out_is_one_boulder() -> None:
    lower, upper = (TOE_M - 0.2, -0.9, 0.2), (TOE_M + 1.0, 0.3, 1.4)
    drift = CastDrift(45.0, rocks=(Box(lower, upper),))
    pile = _found(drift).estimate
    assert len(pile.boulders) == 1
    found = pile.boulders[0]
    assert drift.in_drift(found.center_m) == pytest.approx(0.5 * (np.array(lower) + upper), abs=0.3)
    assert 1.2 * 0.9 < found.size_m < 1.2 * math.sqrt(3.0)  # between an edge and the diagonal in space
    assert pile.status == "loadable"
    assert pile.inclination_deg == pytest.approx(-45.0, abs=1.0)  # the rock does not tilt the face


def test_the_true_surface_is_the_residual_zero() -> None:
    drift = CastDrift(45.0)
    pile = _found(drift).estimate
    rows = np.array([drift.in_drift(point) for point in pile.face_m])
    out = (TOE_M + rows[:, 2] - rows[:, 0]) / math.sqrt(2.0)
    assert pile.residuals_m == pytest.approx(out, abs=0.04)
    assert np.std(pile.residuals_m) < 0.02


def test_attack_point_is_on_the_toe_and_clear_of_the_walls() -> None:
    drift = CastDrift(45.0, turn_rad=1.0)
    attack = _found(drift).estimate.attack
    assert attack is not None
    x, y, _ = drift.in_drift(attack.point_m)
    assert x == pytest.approx(TOE_M, abs=0.1)
    assert abs(y) < 0.5 * drift.width_m - 1.3
    assert math.remainder(attack.heading_rad - 1.0, 2.0 * math.pi) == pytest.approx(0.0, abs=0.03)


@settings(max_examples=4, deadline=None)
@given(st.floats(-math.pi, math.pi), st.floats(-500.0, 500.0))
def test_result_does_not_depend_on_where_north_is(turn_rad: float, shift_m: float) -> None:
    here = _found(CastDrift(45.0)).estimate
    there = last_of(drive(CastDrift(45.0, turn_rad=turn_rad, shift_m=(shift_m, -shift_m, 0.1 * shift_m)))).estimate
    assert there.status == here.status
    assert there.width_m == pytest.approx(here.width_m, abs=0.01)
    assert there.inclination_deg == pytest.approx(here.inclination_deg, abs=0.2)


def test_tilt_error_is_found_and_undone() -> None:
    """The scanner looks 0.3 deg lower than its mount says: the floor tells, once the machine drives over what it saw."""
    drift = CastDrift(45.0, tilt_error_rad=math.radians(0.3))
    stage = PileStage(PileSettings(), FaceRegistration(2e-4, math.radians(0.3)))
    for scan in drift.scans(from_m=-28.0):
        stage.update(scan)
    pile = last_of(stage.report()).estimate
    assert pile.inclination_deg == pytest.approx(-45.0, abs=1.0)
    assert drift.in_drift(pile.left_limit_m) == pytest.approx([TOE_M, 2.0, 0.0], abs=0.05)
    assert len(pile.warnings) == 1
    assert "lower" in pile.warnings[0]


def _grow(values: FloatArray) -> float:
    return float(np.median(values[-len(values) // 4 :]) / np.median(values[: len(values) // 4]))


def test_deviations_shrink_on_the_way() -> None:
    found = [one.estimate.inclination_std_deg for one in driven(CastDrift(45.0)).history if one.estimate.found]
    assert _grow(np.array(found)) < 0.6


def test_it_says_which_heights_of_the_face_were_seen() -> None:
    """A scanner 1.8 m high that looks down by 2.5° climbs a face of 45° from 0.28 m at 36 m to 1.16 m at 15 m."""
    drift = CastDrift(45.0, wave_rad=0.0)
    found = [one for one in driven(drift).history if one.estimate.found]
    near = min(found, key=lambda one: abs(one.distance_m - 15.0))
    low, high = near.estimate.heights_m
    tilt = math.tan(TILT_RAD)
    for height, distance_m in ((low, TOE_M), (high, near.distance_m)):
        assert height == pytest.approx((1.8 - (distance_m - 1.5) * tilt) / (1.0 + tilt), abs=0.06)
    assert estimate_json(near.estimate)["inclination_heights_m"] == [low, high]


def test_json_holds_the_contract() -> None:
    table = driven(CastDrift(45.0)).to_json()
    assert set(table) >= KEYS
    assert json.loads(json.dumps(table, allow_nan=False)) == table
    assert table["frame"] == "map"
    assert table["distance_at_decision_m"] > 10.0
    assert isinstance(table["decided_at_ns"], int)
    assert sum(table["probabilities"].values()) == pytest.approx(1.0)


def test_json_of_what_was_not_looked_for_has_the_reason_alone() -> None:
    table = PileReport(None, None, reason="it was off").to_json()
    assert set(table) >= KEYS
    assert (table["status"], table["probabilities"], table["reason"]) == (None, None, "it was off")
    assert not table["identified"]


def test_a_warning_is_said_once_in_json() -> None:
    """The last estimate, the decision and each of the piles hold it."""
    estimate = PileEstimate(
        status="loadable", probabilities={"loadable": 1.0}, width_m=4.0, inclination_deg=-40.0, warnings=("w",)
    )
    last = Snapshot(0, 12.0, estimate)
    report = PileReport(last, last, (last,), warnings=("w", "log"), piles=(PileApproach(last, last),))
    assert json.dumps(report.to_json()).count('"w"') == 1
    assert report.to_json()["warnings"] == ["w", "log"]


def test_json_of_nothing_is_null() -> None:
    table = PileReport(None, None).to_json()
    assert set(table) >= KEYS
    assert json.loads(json.dumps(table, allow_nan=False)) == table
    for key in ("center_m", "left_limit_m", "width_m", "inclination_deg", "decided_at_ns", "distance_at_decision_m"):
        assert table[key] is None
    assert table["probabilities"]["none"] == 1.0
    assert estimate_json(_found(CastDrift(45.0)).estimate)["width_m"] == pytest.approx(4.0, abs=0.05)


def test_what_does_not_close_the_drift_is_not_measured_as_a_pile() -> None:
    """A surface that was looked at and is none has a width and a slope, but no pile has them."""
    seen = PileEstimate("none", {"none": 0.9, "wall": 0.1}, width_m=3.0, inclination_deg=-60.0, warnings=("said",))
    table = PileReport(None, Snapshot(1, 12.0, seen)).to_json()
    assert table["width_m"] is None
    assert table["inclination_deg"] is None
    assert table["center_m"] is None
    assert table["boulders"] == []
    assert table["probabilities"]["wall"] == 0.1
    assert table["warnings"] == ["said"]


DRIFTING = FaceRegistration(0.01, math.radians(0.2))
LOST = FaceRegistration(0.015, math.radians(0.3))


@pytest.mark.parametrize("short_m", [0.0, 0.1, 0.2, 0.3, 0.4])
def test_drive_that_ends_at_the_deadline_is_decided(short_m: float) -> None:
    """An estimate comes each half metre: the last one before a true 15 m must do."""
    report = drive(CastDrift(45.0, wave_rad=0.0), TOE_M - PileSettings().deadline_m - short_m, DRIFTING)
    assert last_of(report).estimate.inclination_std_deg > 2.5  # not sure enough to decide earlier
    assert report.decision is not None
    assert report.decision.estimate.status == "loadable"


def test_slope_that_is_too_unsure_is_not_said() -> None:
    table = drive(CastDrift(56.0, wave_rad=0.0), 21.0, LOST).to_json()
    assert table["status"] == "none"
    assert table["identified"] is False
    assert table["inclination_deg"] is None
    assert table["probabilities"]["none"] < 0.5  # that something closes the drift is sure
    assert table["probabilities"]["loadable"] > 0.2


def _fed(*found: Snapshot) -> PileReport:
    """Return the report of an approach that came to these estimates, half a metre apart."""
    approaches = Approaches(PileSettings())
    for number, one in enumerate(found):
        approaches.take(one, 0.5 * number)
    return approaches.report(np.zeros((0, 3)))


def test_decision_falls_with_what_it_was_on() -> None:
    seen = driven(CastDrift(90.0)).last
    assert seen is not None
    nothing = seen._replace(estimate=replace(seen.estimate, status="none", probabilities={"none": 1.0}))
    assert _fed(seen).to_json()["identified"] is True
    table = _fed(seen, nothing).to_json()
    assert (table["status"], table["identified"], table["decision"]) == ("none", False, None)


def test_a_log_that_begins_near_the_pile_reports_what_it_decided() -> None:
    """Too near for an estimate to improve one, but the only one: it was identified, with status none."""
    seen = driven(CastDrift(90.0)).last
    assert seen is not None
    table = _fed(seen._replace(distance_m=PileSettings().closest_m - 1.0)).to_json()
    assert (table["status"], table["identified"], len(table["piles"])) == ("wall", True, 1)


def test_what_is_not_seen_any_more_is_forgotten() -> None:
    seen = driven(CastDrift(90.0), 20.0).last
    assert seen is not None
    blind = Snapshot(seen.stamp_ns, math.nan, PileEstimate())
    assert _fed(seen, blind).to_json()["status"] == "wall"  # a look that fails is not yet a change
    table = _fed(seen, *[blind] * 6).to_json()
    assert (table["status"], table["identified"]) == ("none", False)


def test_a_pile_that_was_decided_stays_when_the_machine_backs_out() -> None:
    """Beyond the window's 45 m nothing of it was left: status none, not identified."""
    drift = CastDrift(45.0)
    scans = list(drift.scans(to_m=28.0))
    stage = PileStage(PileSettings(reach_m=20.0), EXACT)
    for scan in scans:
        stage.update(scan)
    before = stage.report()
    for k, scan in enumerate(reversed(scans)):
        stage.update(scan._replace(stamp_ns=scans[-1].stamp_ns + k))
    after = stage.report()
    assert before.decision is not None
    assert after.decision is before.decision
    assert last_of(after).estimate.width_m == last_of(before).estimate.width_m


def _cycle(*legs: tuple[CastDrift, float, float]) -> PileReport:
    """Return the report of legs driven one after the other: a drift, from x to x; in reverse where x falls."""
    stage, stamp_ns = PileStage(PileSettings(), EXACT), 0
    for drift, from_m, to_m in legs:
        scans = list(drift.scans(min(from_m, to_m), max(from_m, to_m)))
        for scan in scans if to_m > from_m else reversed(scans):
            stamp_ns += 100_000_000
            stage.update(scan._replace(stamp_ns=stamp_ns))
    return stage.report()


def _other(slope_deg: float | None, width_m: float = 4.0) -> CastDrift:
    return CastDrift(slope_deg, width_m, turn_rad=1.8, shift_m=(-60.0, 40.0, 0.5))


@pytest.mark.parametrize("slope_deg", [None, 90.0])
def test_a_whole_loading_cycle_keeps_the_pile(slope_deg: float | None) -> None:
    """To the pile, back, and forward into another drift, to its end or not: what lay ahead last took the pile's place."""
    pile = CastDrift(45.0)
    alone = _cycle((pile, 0.0, 32.0))
    whole = _cycle((pile, 0.0, 32.0), (pile, 32.0, 4.0), (_other(slope_deg), 0.0, 26.0))
    assert alone.decision is not None
    assert whole.decision is not None
    assert whole.decision.stamp_ns == alone.decision.stamp_ns
    assert last_of(whole).estimate.width_m == last_of(alone).estimate.width_m
    assert len(whole.around_m) > 1000
    statuses = [last.estimate.status for _, last in whole.piles if last is not None]
    assert statuses == ["loadable"] + ([] if slope_deg is None else ["wall"])


def test_the_pile_that_was_loaded_last_is_reported() -> None:
    first, second = CastDrift(45.0), _other(38.0, 4.6)
    report = _cycle((first, 0.0, 30.0), (first, 30.0, 10.0), (second, 0.0, 28.0))
    assert last_of(report).estimate.inclination_deg == pytest.approx(-38.0, abs=1.0)
    assert last_of(report).estimate.width_m == pytest.approx(4.6, abs=0.1)
    table = report.to_json()
    assert [pile["status"] for pile in table["piles"]] == ["loadable", "loadable"]
    assert [pile["width_m"] for pile in table["piles"]] == pytest.approx([4.0, 4.6], abs=0.1)
    assert table["piles"][1]["decided_at_ns"] == table["decided_at_ns"]


def test_a_pile_that_was_loaded_from_is_looked_at_anew() -> None:
    """The second time its face is steeper: hits of the first time would blur it."""
    before, after = CastDrift(38.0), CastDrift(50.0)
    report = _cycle((before, 0.0, 32.0), (after, 32.0, 8.0), (after, 8.0, 28.0))
    assert last_of(report).estimate.inclination_deg == pytest.approx(-50.0, abs=1.0)
    assert len(report.piles) == 1


def test_a_short_second_approach_to_the_same_face_does_not_make_it_less_known() -> None:
    drift = CastDrift(45.0)
    once = _cycle((drift, 0.0, 32.0), (drift, 32.0, 24.0))
    twice = _cycle((drift, 0.0, 32.0), (drift, 32.0, 20.0), (drift, 20.0, 26.0))
    first, second = last_of(once).estimate, last_of(twice).estimate
    assert second.inclination_std_deg <= first.inclination_std_deg
    assert second.inclination_deg == pytest.approx(-45.0, abs=2.0 * second.inclination_std_deg)
    assert len(twice.piles) == 1


def test_a_short_way_back_keeps_the_pile_too() -> None:
    """10 m are far less than the window holds: its hits would still be there, and nothing ahead contradicts them."""
    drift = CastDrift(45.0)
    once = _cycle((drift, 0.0, 30.0), (drift, 30.0, 20.0))
    twice = _cycle((drift, 0.0, 30.0), (drift, 30.0, 20.0), (_other(None), 0.0, 20.0))
    assert last_of(twice).estimate.width_m == last_of(once).estimate.width_m
    assert len(twice.piles) == len(once.piles) == 1


@pytest.mark.parametrize("fall", [0.04, 0.08, 0.12])
def test_floor_that_falls_away_is_no_overhang(fall: float) -> None:
    """The scanner paints the far floor line by line, the farther the lower: that is a plane, and no face."""
    report = driven(CastDrift(None, grade=-fall, wave_rad=math.radians(1.0)))
    assert report.decision is None
    assert all(not one.estimate.inclination_deg < -130.0 for one in report.history)


def test_rock_that_stands_out_does_not_tilt_the_face() -> None:
    """A boulder low on the face and one high on it draw the slope to opposite sides, unless they are left out."""
    for z in (0.1, 0.7):
        rock = Box((TOE_M + z - 0.5, -0.6, z), (TOE_M + z + 1.0, 0.6, z + 0.8))
        pile = _found(CastDrift(45.0, rocks=(rock,))).estimate
        assert len(pile.boulders) == 1
        assert pile.inclination_deg == pytest.approx(-45.0, abs=0.5)
