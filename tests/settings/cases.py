"""For each setting: the scenario in which it acts, and a changed value where half as much again would not do."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from lhdmap.config import Settings


@dataclass(frozen=True, slots=True)
class Case:
    """Where a setting acts: the probe, settings that must be so for it to act, and the value that it is changed to."""

    probe: str
    value: Any = None
    base: Mapping[str, Any] = field(default_factory=dict)


_FLOW = {"odometry.method": "range_flow"}
_KISS = {"cloud_odometry.method": "kiss_icp"}
_FOUND = {  # with which Fig. 9 finds the pile
    "figure9.curvature_min": 0.0,
    "figure9.axes": "drift",
    "figure9.roughness": "steepness",
    "figure9.neighbours_in": "cloud",
    "figure9.neighbours_min": 40,
    "figure9.waits": True,
    "pile.method": "figure9",
}
_SECTIONS = {
    "odometry": Case("tilted"),
    "anchor": Case("tilted"),
    "search": Case("jump"),
    "range_flow": Case("level", base=_FLOW),
    "trust": Case("tilted"),
    "cloud_odometry": Case("clouds"),
    "attitude": Case("tilted"),
    "gyro": Case("turning"),
    "wheels": Case("tilted"),
    "slip": Case("tilted"),
    "integration": Case("tilted"),
    "smoothing": Case("lap"),
    "landmarks": Case("landmarks"),
    "executor": Case("driven"),
    "guidance": Case("guided"),
    "tracking": Case("tracked"),
    "docking": Case("docked"),
    "navigation": Case("navigated"),
    "charging": Case("charged"),
    "excavation": Case("dug"),
    "excavation_paper": Case("dug_as_printed"),
    "excavation_tuned": Case("dug_tuned"),
    "weighing": Case("weighed"),
    "attempts": Case("decided"),
    "loading": Case("loading_limits"),
    "pile": Case("pile"),
    "figure9": Case("pile", base=_FOUND),
    "figure9_repaired": Case("pile", base={"pile.method": "figure9_repaired"}),
    "haulage": Case("hauled"),
    "traffic": Case("shared"),
    "localization": Case("put_down"),
    "movement": Case("route"),
    "recording": Case("recording"),
    "rockbreaker": Case("plan"),
    "console": Case("attended"),
    "topology": Case("topology"),
}


_WITH_FLOOR = {"neighbours_min": 0, "slope_from": "normals", "cluster_gap_m": 0.0}


def _figure9(section: str, found: Mapping[str, Any]) -> dict[str, Case]:
    """Return the cases of the constants of Fig. 9, which are in two sections."""
    rough = {**found, f"{section}.roughness": "curvature", f"{section}.curvature_min": 0.0}
    with_floor = {**rough, **{f"{section}.{key}": value for key, value in _WITH_FLOOR.items()}}
    steep = {**found, f"{section}.steep_deg": 20.0}
    values = {
        "view_height_m": Case("pile", 0.0, with_floor),
        "curvature_min": Case("pile", 1e-4, rough),
        "curvature_max": Case("pile", 1e-4, rough),
        "cluster_gap_m": Case("pile", 0.15, found),
        "bound_share": Case("pile", 0.1, found),
        "points_min": Case("pile", 1000, found),
        "slope_radius_m": Case("pile", 0.5, {**found, f"{section}.slope_from": "normals"}),
        "shallow_deg": Case("pile", 40.0, found),
        "steep_deg": Case("pile", 20.0, found),
        "wall_deg": Case("pile", 25.0, steep),
        "overhang_deg": Case("pile", 26.0, {**steep, f"{section}.wall_deg": 25.0}),
    }
    return {f"{section}.{key}": case for key, case in values.items()}


def _dig_case(section: str, probe: str, least_s: float) -> dict[str, Case]:
    """Return the cases of the paper's law where half as much again does not show; pressure ends S_push before its time."""
    pressed = {f"{section}.phase_max_s": 2.0, f"{section}.phase_min_s": 0.2, f"{section}.pressure_max_bar": 300.0}
    return {
        f"{section}.hysteresis": Case(probe, 0.2),
        f"{section}.lift_least_s": Case(probe, least_s),
        f"{section}.boom_max_rad": Case(probe, -0.3),
        f"{section}.phase_min_s": Case(probe, 0.6, pressed),
        f"{section}.pressure_max_bar": Case(probe, 150.0, pressed),
        f"{section}.tilt_ends_early": Case(probe, True, pressed),
    }


_NOISY_SKID = {"excavation.skid_smooth_s": 0.0, "excavation.skid_max": 0.1, "excavation.lift_least_s": 0.0}
_WAITS = {"cloud_odometry.step_m": 5.0, "cloud_odometry.step_deg": 50.0, "cloud_odometry.step_s": 60.0}
_PRINTED = {"guidance.method": "paper", "guidance.samples": 16, "guidance.rounds": 2}
_LOADING_CYCLE = (
    "reach_m", "approach_kmh", "creep", "run_up_m", "lower", "press_bar", "pull_back_m",
    "back_kmh", "racked_rad",
)  # fmt: skip
_SETTINGS = {
    **{f"loading.{key}": Case("loading_cycle") for key in _LOADING_CYCLE},
    "loading.press_most_bar": Case("loading_cycle", 28.0),
    "loading.follows_s": Case("loading_cycle", 0.2),
    "loading.rack_s": Case("loading_cycle", 0.5),
    "loading.align_deg": Case("loading_limits", 5.0),
    "loading.landing_m": Case("loading_limits", 0.7),
    "odometry.max_beams": Case("tilted", 100),
    "odometry.max_rear_beams": Case("tilted", 65),
    "odometry.step_deg": Case("tilted", 0.05),
    "odometry.weak_sigma_m": Case("smooth"),
    "odometry.weak_ratio": Case("smooth"),
    "odometry.blind_sigma_m": Case("smooth", 0.001),
    "odometry.weak_inflation": Case("smooth"),
    "odometry.weak_sigma_deg": Case("tilted", 0.05),
    "anchor.insert_deg": Case("tilted", 0.1, {"anchor.insert_m": 5.0}),
    "anchor.hit_limit": Case("tilted", 5.0),
    "anchor.rounds": Case("tilted", 1),
    "anchor.min_support": Case("jump", 0.9),
    "search.beams": Case("jump", 60),
    "search.reach_m": Case("jump", 0.1),
    "search.turn_deg": Case("jump", 5.0),
    "range_flow.spacing_deg": Case("level", 2.0, _FLOW),
    "range_flow.min_support": Case("jump", 0.9, _FLOW),
    "range_flow.levels": Case("jump", 2, _FLOW),
    "range_flow.iterations": Case("level", 1, _FLOW),
    "cloud_odometry.kiss_voxel_m": Case("clouds", base=_KISS),
    "cloud_odometry.min_range_m": Case("clouds", 3.0),
    "cloud_odometry.max_range_m": Case("clouds", 8.0),
    "cloud_odometry.insert_deg": Case("clouds", 0.1, {"cloud_odometry.insert_m": 5.0}),
    "cloud_odometry.window_m": Case(
        "returning", 5.0, {"cloud_odometry.max_range_m": 4.0, "cloud_odometry.insert_m": 0.5}
    ),
    "cloud_odometry.step_m": Case("clouds", 1.0),
    "cloud_odometry.step_deg": Case("clouds", 0.05, _WAITS),
    "cloud_odometry.step_s": Case("clouds", 0.2, _WAITS),
    "cloud_odometry.weak_sigma_m": Case("clouds", 0.005),
    "cloud_odometry.weak_sigma_deg": Case("clouds", 0.001),
    "cloud_odometry.min_support": Case("clouds", 0.95),
    "cloud_odometry.max_speed_mps": Case("clouds", 0.5),
    "cloud_odometry.reach_m": Case("cut", 0.0, {"cloud_odometry.voxel_m": 0.2}),
    "gyro.enabled": Case("turning", False),
    "gyro.noise_deg_sqrt_h": Case("turning", 20.0),
    "gyro.max_gap_s": Case("turning", 0.3),
    "gyro.max_rate_dps": Case("turning", 200.0),
    "attitude.max_gap_s": Case("faulty"),
    "attitude.jump_deg": Case("faulty"),
    "attitude.frozen_s": Case("faulty", 0.3),
    "attitude.keep_s": Case("rare", 1.0),
    "wheels.unknown_articulation_deg": Case("clouds"),
    "wheels.pose_distance_std": Case("poses"),
    "wheels.pose_turn_std": Case("poses"),
    "wheels.pose_drift_deg": Case("poses"),
    "wheels.pose_time_std_s": Case("poses"),
    "wheels.max_gap_s": Case("faulty"),
    "wheels.max_hold_s": Case("faulty"),
    "wheels.max_speed_mps": Case("faulty"),
    "wheels.max_jump_m": Case("poses", 3.0),
    "wheels.max_pose_gap_s": Case("poses", 1.0),
    "wheels.keep_s": Case("rare", 1.0),
    "slip.window_s": Case("tilted", 1.0),
    "integration.range_min_m": Case("tilted", 3.0),
    "integration.range_max_m": Case("tilted", 5.0),
    "integration.min_hits": Case("tilted", 8),
    "integration.normal_min_neighbours": Case("tilted", 20),
    "trust.tilted_unlevelled_walk": Case("unlevelled"),
    "smoothing.realign": Case("tilted"),
    "smoothing.node_m": Case("tilted"),
    "smoothing.lag_m": Case("tilted", 2.0),
    "smoothing.lag_s": Case("tilted", 1.0),
    "smoothing.key_deg": Case("lap", 100.0, {"smoothing.key_m": 3.0}),
    "smoothing.apart_m": Case("lap", 70.0),
    "smoothing.drift": Case("lap", 0.0),
    "smoothing.reach_limit_m": Case("lap", 0.5),
    "smoothing.max_sigma_m": Case("lap", 0.001),
    "smoothing.agree_m": Case("lap", 0.01),
    "smoothing.agree_deg": Case("lap", 0.01),
    "landmarks.window_m": Case("landmarks", 20.0),
    "landmarks.ends": Case("landmarks", 2),
    "landmarks.key_spacing": Case("landmarks", 9),
    "landmarks.distinct_gap": Case("landmarks", 1000.0),
    "localization.range_m": Case("carried_off"),
    "localization.hits": Case("carried_off", 100),
    "localization.support_drop": Case("carried_off", 0.8),
    "localization.support_scans": Case("carried_off"),
    "localization.window_m": Case("put_down", 5.0),
    "localization.gap": Case("put_down", 900.0),
    "localization.search_every_m": Case("put_down", 4.0, {"localization.gap": 900.0}),
    "localization.check_every_m": Case("carried_off", 1.0),
    "localization.start_std_m": Case("carried_off"),
    "localization.start_std_deg": Case("carried_off"),
    "guidance.samples": Case("guided", base=_PRINTED),
    "guidance.lateral_mps2": Case("guided", 0.1),
    "guidance.rounds": Case("guided", base=_PRINTED),
    "navigation.standing_mps": Case("navigated", 0.4),
    "navigation.room_m": Case("navigated", 20.0),
    "navigation.reached_likelihood_pm2": Case("navigated", 1e-4),
    "navigation.reached_std_m": Case("navigated", 3.0),
    "navigation.arrived_m": Case("navigated", 0.02),
    "navigation.approach_mps": Case("navigated", 4.9),
    "navigation.heading_deg": Case("navigated", 1.0),
    "charging.pressure_bar": Case("charged_as_printed", 200.0),
    "charging.skid": Case("charged_as_printed", 0.05),
    "charging.slip_m": Case("charged", 0.005),
    "charging.gate_m": Case("charged", 1.0),
    "charging.launch_s": Case("charged", 0.0),
    "excavation.racked_rad": Case("dug_as_printed", -0.6),
    "excavation.alpha_max_rad": Case("dug_as_printed", -0.6),
    "excavation.alpha_tolerance_rad": Case("dug_as_printed", 0.5),
    "excavation.boom_max_rad": Case("dug", -0.3),
    "excavation.lift_most_rad": Case("dug", 0.02),
    "excavation.hysteresis": Case("dug", 0.5, _NOISY_SKID),
    "excavation.lift_least_s": Case("dug", 3.0, _NOISY_SKID),
    "excavation.stuck_rps": Case("dug", 1.0),
    **_dig_case("excavation_paper", "dug_as_printed", 0.4),
    **_dig_case("excavation_tuned", "dug_tuned", 0.0),
    "weighing.tare_bar": Case("weighed", 54.0),
    "attempts.gain_full": Case("decided", 0.2),
    "attempts.full": Case("decided", base={"attempts.rule": "threshold"}),
    "tracking.swerve_share": Case("tracked", 1.0),
    "docking.nodes": Case("docked", 100),
    "docking.cusps": Case("docked", 0),
    "tracking.method": Case("tracked", "paper"),
    "tracking.gate": Case("tracked", 20.0),
    "tracking.look_m": Case("tracked", base={"tracking.method": "circles"}),
    "pile.reach_m": Case("pile", 15.0),
    "pile.deadline_m": Case("pile", 20.0),
    "pile.sure": Case("pile", 0.9),
    "pile.likely": Case("pile", 0.99),
    "movement.turn_s": Case("route", 5.0),
    "traffic.section_m": Case("shared", 25.0),
    "traffic.pays": Case("shared", 3.0),
    "rockbreaker.clearance_m": Case("rock"),
    "topology.arms": Case("topology", "driven"),
    "topology.opening_machine": Case("topology", 1.0),
    "topology.radius_tunnel": Case("topology", 0.1),
    "topology.merge": Case("topology", 2.0),
    "topology.throat_margin_m": Case("topology", 1.6),
    "topology.level_gap_m": Case("levels", 20.0),
    **_figure9("figure9", _FOUND),
    **_figure9("figure9_repaired", {"pile.method": "figure9_repaired"}),
}


def case_of(name: str) -> Case:
    """Return the case of a setting, with the value that it is changed to."""
    case = _SETTINGS.get(name, _SECTIONS[name.partition(".")[0]])
    if case.value is None:
        return dataclasses.replace(case, value=_changed(name, case.base))
    return case


def _changed(name: str, base: Mapping[str, Any]) -> Any:
    """Return another value within the bounds of a setting: half as much again, the other choice, or not so."""
    section, _, key = name.partition(".")
    kind = type(getattr(Settings(), section))
    found = next(one for one in dataclasses.fields(kind) if one.name == key)
    value, meta = base.get(name, found.default), found.metadata
    if isinstance(value, bool):
        return not value
    if isinstance(value, str):
        return next(choice for choice in meta["choices"] if choice != value)
    if isinstance(value, tuple):
        return tuple(1.5 * one for one in value)
    most = meta["maximum"]
    more = value + max(value // 2, 1) if isinstance(value, int) else 1.5 * value
    return more if most is None or more <= most else type(value)(0.5 * value)
