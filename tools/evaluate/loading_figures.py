"""What `tools.evaluate.loading` measures, part by part: plain dictionaries."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from lhdmap.evaluation.loading.loads import Attempt, Load
from lhdmap.evaluation.loading.tables import tables_of
from lhdmap.loading.attempts import Attempts, fit_gains
from lhdmap.loading.digging_settings import ChargingSettings
from lhdmap.loading.weighing_settings import AttemptSettings, WeighingSettings
from lhdmap.resources import resource
from lhdmap.simulation.ground.sections import load_ground
from tests.loading.digging.charges import MIX, Charges, charge_all
from tests.loading.digging.loads import Dug, Plan, run_load, with_common, with_paper

from tools.evaluate.loading_bounds import bounds
from tools.evaluate.loading_weighed import weigh_in_loop
from tools.evaluate.loading_weighing import Found, weigh_all

METHODS = ("paper", "paper-tuned", "adaptive")
HAULS_S = (60.0, 180.0, 600.0)
OVERHEAD_S = 20.0
_TABLES, _METHODS, _OTHERS, _ERRATA, _CHARGES, _REATTEMPT, _WEIGHED = (
    1000,
    2000,
    3000,
    4000,
    5000,
    6000,
    7000,
)  # first seeds
Digs = list[list[Dug]]


def mines() -> list[str]:
    """Return the grounds that ship, the default one first."""
    names = sorted(path.stem for path in resource("datasets/grounds").glob("*.toml"))
    return ["default", *(name for name in names if name != "default")]


def loads_of(plan: Plan, first: int, count: int) -> Digs:
    """Return the attempts of loads of consecutive seeds."""
    return [run_load(plan, first + k) for k in range(count)]


def operator_plan(ground: str, **more: Any) -> Plan:
    """Return the paper's experiment: its law and detector, the operator who stops as published in the mine's file."""
    operator = load_ground(ground).operator
    return Plan(
        "paper", "paper", ground=ground, stop_fill=operator.stop_fill, stop_std=operator.stop_sigma,
        most=operator.most_attempts, **more,
    )  # fmt: skip


def tables(count: int = 0) -> dict[str, Any]:
    """Return Tables 3, 4 and 5 of the paper's method in each mine."""
    found = {}
    for number, ground in enumerate(mines()):
        loads = loads_of(operator_plan(ground), _TABLES, count or (200 if number == 0 else 60))
        found[ground] = tables_of([as_load(load) for load in loads]).to_json()
    return found


def as_load(digs: Sequence[Dug]) -> Load:
    """Return a load as the tables take it; each early trigger as an attempt of its own."""
    attempts: list[Attempt] = []
    for dig in digs:
        attempts += [Attempt(0.0, math.nan, early=True)] * dig.charge.early
        attempts.append(Attempt(0.0, dig.duration_s, dig.fill))
    return Load("", tuple(attempts))


def methods(count: int = 0) -> dict[str, Any]:
    """Return the methods on the same piles, until 90 % or six attempts, in each mine."""
    found: dict[str, Any] = {}
    for number, ground in enumerate(mines()):
        first, many = (_METHODS, count or 200) if number == 0 else (_OTHERS, count or 100)
        runs = {method: loads_of(Plan(method, _detector(method), ground=ground), first, many) for method in METHODS}
        found[ground] = {
            "rows": {method: summary(loads) for method, loads in runs.items()},
            "paired": {method: paired(runs[method], runs["paper"]) for method in METHODS[1:]},
            "over tuned": paired(runs["adaptive"], runs["paper-tuned"]),
        }
    return found


def _detector(method: str) -> str:
    return "paper" if method == "paper" else "fused"


def summary(loads: Digs) -> dict[str, Any]:
    """Return the figures of loads, with 95 % intervals of means."""
    digs = [dig for load in loads for dig in load]
    per_load = columns(loads)
    return {
        "n": len(loads),
        **{name: mean_95(values) for name, values in per_load.items()},
        "first_std": float(per_load["first"].std(ddof=1)),
        "time_outs": sum(not dig.ended for dig in digs) / len(digs),
        "early": sum(dig.charge.early for dig in digs) / len(digs),
        "ends": {end: sum(dig.ended == end for dig in digs) / len(digs) for end in ("racked", "boom", "advance")},
        "lifts": float(np.mean([dig.lifts for dig in digs])),
        "back_offs": float(np.mean([dig.back_offs for dig in digs])),
        "within": float(np.mean([6.0 <= dig.duration_s <= 20.0 for dig in digs])),
        "p99_s": float(np.quantile([dig.duration_s for dig in digs], 0.99)),
    }


def columns(loads: Digs) -> dict[str, np.ndarray]:
    """Return per load: first fill, attempts, times of the first dig and of all, slip, final fill."""
    return {
        "first": np.array([load[0].fill for load in loads]),
        "attempts": np.array([float(len(load)) for load in loads]),
        "first_dig_s": np.array([load[0].duration_s for load in loads]),
        "dig_s": np.array([sum(dig.duration_s for dig in load) for load in loads]),
        "racked_s": np.array([sum(dig.duration_s + dig.rack_s for dig in load) for load in loads]),
        "slip_s": np.array([sum(dig.slip_s for dig in load) for load in loads]),
        "final": np.array([load[-1].fill for load in loads]),
    }


def mean_95(values: np.ndarray) -> list[float]:
    """Return a mean and the ends of its 95 % interval."""
    half = 1.96 * float(values.std(ddof=1)) / math.sqrt(len(values))
    return [float(values.mean()), float(values.mean()) - half, float(values.mean()) + half]


def paired(loads: Digs, base: Digs) -> dict[str, list[float]]:
    """Return differences on the same piles, with intervals."""
    ours, theirs = columns(loads), columns(base)
    return {name: mean_95(ours[name] - theirs[name]) for name in ours}


def errata(count: int = 0) -> dict[str, Any]:
    """Return the paper's law with each step as printed, or as another reading has it, on the default mine."""
    base, many = operator_plan("default", approach_m=5.0), count or 30
    late = replace(base, charging=replace(base.charging, launch_s=0.0))
    variants = {
        "base: with the errata, Table 1": base,
        "E1 as printed: S_push with S_tilt's time": with_paper(base, time_read_again=False),
        "E2 as printed: no guard at the launch": late,
        "E2 lag matched instead of the guard": replace(late, charging=replace(late.charging, lag_matched=True)),
        "E3 skid matched to the scan's time": with_paper(base, lag_matched=True),
        "E4 hysteresis 0.05, lifts of 0.3 s": with_paper(base, hysteresis=0.05, lift_least_s=0.3),
        "E5 zero at the level floor": with_common(base, racked_rad=-0.83),
        "E6 no tolerance, the stop read as -0.02": with_common(base, alpha_tolerance_rad=0.0, racked_rad=0.02),
        "E7 d_max 3.0 m": with_paper(base, advance_max_m=3.0),
        "E8 S_tilt with a lower bound": with_paper(base, tilt_ends_early=True),
        "E9 S_push ends by pressure alone": with_paper(base, pressure_needed=True),
        "no lift at all": with_paper(base, skid_max=5.0),
        "Δt_max 0.6 s": with_paper(base, phase_max_s=0.6),
    }
    found = {}
    for name, plan in variants.items():
        loads = loads_of(plan, _ERRATA, many)
        fills = [[load[k].fill for load in loads if len(load) > k] for k in range(4)]
        found[name] = summary(loads) | {"fills": [float(np.mean(row)) if row else None for row in fills]}
    return found


def detection(count: int = 0) -> dict[str, Any]:
    """Return what detectors make of the same 500 mixed charges; the lesser ones of each fourth."""
    many, settings = count or 500, ChargingSettings()
    seeds = range(_CHARGES, _CHARGES + many)
    found = {}
    for name, detector, chosen, step in (
        ("fused", "fused", settings, 1),
        ("paper, guard of 1.5 s", "paper", settings, 1),
        ("paper as printed, no launch guard", "paper", replace(settings, launch_s=0.0), 4),
        ("fused without press relief", "fused", replace(settings, relief_s=0.0), 4),
        ("fused without the range", "fused", replace(settings, gate_std=10.0, gate_m=5.0, relief_s=0.0), 4),
    ):
        found[name] = _detected(charge_all(name, detector, chosen, seeds[::step]))
    for toe_m in (0.3, 0.5):
        name = f"fused, toe perceived with {toe_m:g} m"
        found[name] = _detected(charge_all(name, "fused", settings, seeds[::4], toe_m))
    return found


def _detected(charges: Charges) -> dict[str, Any]:
    delays = {since: charges.delays_s(since) for since in ("touch_s", "force_s")}
    return {
        "n": len(charges.rows),
        **{what: charges.share(what) for what in ("right", "early", "none")},
        "by": {kind: charges.share("right", kind) for kind in MIX},
        **{since: [float(np.quantile(each, q)) for q in (0.5, 0.95)] for since, each in delays.items() if len(each)},
    }


def weighing(count: int = 0) -> dict[str, Any]:
    """Return errors of weighings by both methods, with and without tare, with and without static errors."""
    settings = WeighingSettings()
    found = {}
    for name, method, static, tare in (
        ("sinusoid", "sinusoid", True, False),
        ("sinusoid with a tare", "sinusoid", True, True),
        ("sinusoid, noise and swings alone", "sinusoid", False, False),
        ("mean", "mean", True, False),
        ("mean, noise and swings alone", "mean", False, False),
    ):
        found[name] = _weighed(weigh_all(replace(settings, method=method), count or 600, 7, static=static, tare=tare))
    plan = Plan("adaptive", "fused")
    for name, tare in (("in the loop, with a tare", True), ("in the loop, without", False)):
        found[name] = _weighed(weigh_in_loop(plan, _WEIGHED, count or 60, tare=tare))
    return found


def _weighed(one: Found) -> dict[str, Any]:
    return {
        "n": len(one.error), "bias": float(one.error.mean()), "std": float(one.error.std()), "told": float(one.told.mean()),
        "rms": float(np.sqrt((one.error**2).mean())), "unsettled": one.unsettled,
        "settling_s": [float(np.quantile(one.settling_s, q)) for q in (0.5, 0.95)],
    }  # fmt: skip


def attempts(count: int = 0) -> dict[str, Any]:
    """Return fills per hour by the rule and by all thresholds: half of the loads to fit the gains, half to judge."""
    many, found = count or 120, {}
    for method in ("paper", "adaptive"):
        plan = Plan(method, _detector(method), most=5, forced=True, approach_m=3.0)
        loads = loads_of(plan, _REATTEMPT, many)
        fit, test = loads[: many // 2], loads[many // 2 :]
        found[method] = {f"{haul_s:.0f}": _hauled(fit, test, haul_s) for haul_s in HAULS_S}
    return found


def _hauled(fit: Digs, test: Digs, haul_s: float) -> dict[str, Any]:
    """Return loads per hour, in full buckets, of the rule and of the thresholds; fills are weighed with 4 %."""
    rng = np.random.default_rng(9)
    seen = [[dig.fill + 0.04 * float(rng.standard_normal()) for dig in load] for load in (*fit, *test)]
    dig_s = float(np.mean([dig.duration_s for load in fit for dig in load]))
    settings = AttemptSettings(haul_s=haul_s, attempt_s=OVERHEAD_S + dig_s, most=5)
    rule = Attempts(settings, 11.0, fit_gains(seen[: len(fit)]))
    shown = seen[len(fit) :]
    stops = [_stop(lambda f, k: rule.decide(f, 0.04, k).go_on, row) for row in shown]
    by_threshold = {
        round(full, 2): _rate(test, [_stop(functools.partial(_below, full), row) for row in shown], haul_s)
        for full in np.arange(0.4, 1.16, 0.05)
    }
    ours = _rate(test, stops, haul_s)
    best = max(by_threshold, key=lambda full: by_threshold[full][0])
    return {
        "rule": ours, "stops_at": rule_stop(rule), "best_threshold": best, "best": by_threshold[best],
        "one": _rate(test, [1] * len(test), haul_s), "at 0.90": by_threshold[0.9], "ratio": ours[0] / by_threshold[best][0],
        "mean_attempts": float(np.mean(stops)),
    }  # fmt: skip


def rule_stop(rule: Attempts) -> float:
    """Return the fill from which on the rule stops after a first attempt."""
    return next((float(fill) for fill in np.arange(0.0, 1.5, 0.01) if not rule.decide(fill, 0.0, 1).go_on), 1.5)


def _below(full: float, fill: float, _: int) -> bool:
    return fill < full


def _stop(go_on: Callable[[float, int], bool], row: Sequence[float]) -> int:
    return next((k for k, fill in enumerate(row, start=1) if k == len(row) or not go_on(fill, k)), len(row))


def _rate(loads: Digs, stops: Sequence[int], haul_s: float) -> list[float]:
    """Return full buckets per hour and the deviation of that mean, by the ratio of sums."""
    fills = np.array([load[k - 1].fill for load, k in zip(loads, stops, strict=True)])
    times = np.array([
        haul_s + sum(OVERHEAD_S + dig.duration_s for dig in load[:k]) for load, k in zip(loads, stops, strict=True)
    ])  # fmt: skip
    rate = float(fills.sum() / times.sum())
    spread = float((fills - rate * times).std(ddof=1)) / math.sqrt(len(fills)) / float(times.mean())
    return [3600.0 * rate, 3600.0 * spread]


PARTS: dict[str, Callable[[int], dict[str, Any]]] = {
    "weighing": weighing, "detection": detection, "tables": tables, "methods": methods, "errata": errata, "attempts": attempts,
    "bounds": bounds,
}  # fmt: skip
