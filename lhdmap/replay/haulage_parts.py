"""The parts of a replay on a surface site: the layout, a machine that slips, and a receiver that tells where it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lhdmap.config import Settings
from lhdmap.driving.bodies import bodies_of
from lhdmap.driving.model import drive_model
from lhdmap.errors import UsageError
from lhdmap.haulage.layout import Layout, checked
from lhdmap.haulage.site import Site, find_site, load_site
from lhdmap.haulage.site_layout import layout_of_site
from lhdmap.haulage.ways import LANES, apron_of, pose_at_end
from lhdmap.machine import Machine, load_machine
from lhdmap.messages import FloatArray, Joints, Tachometer, WheelPose
from lhdmap.replay.faults import THINGS
from lhdmap.replay.haulage_plan import HaulagePlan
from lhdmap.replay.parts import Haulage, Parts
from lhdmap.replay.process import SITE_POSE
from lhdmap.replay.scenario import Scenario
from lhdmap.replay.site_drive import APRON_M, SiteGround
from lhdmap.replay.yard_parts import Eyes, YardBumper
from lhdmap.resources import resource
from lhdmap.settings import nearest
from lhdmap.simulation.history import Column
from lhdmap.simulation.sensing.encoders import true_pose
from lhdmap.simulation.sensing.sensor import Beat, Sampled, Sensor
from lhdmap.simulation.vehicle.kinematic import KinematicVehicle, Loader
from lhdmap.simulation.yard import Yard

_MACHINE, _MACHINES = "truck_28t", "pipelines/machines"
_RATE_HZ = 20.0
_SPEED_NOISE = 0.005  # of the speed, as in the evaluation of path tracking
_CYCLE_S = 400.0
_EYES_HZ = 10.0


def haulage_parts(scenario: Scenario, settings: Settings) -> Parts:
    """Return the parts of a machine that hauls on a surface site; it stands parked at first.

    Raises:
        InputError: a file cannot be read, or a machine could be stranded on the site.
        ConfigError: a value in it is wrong.
        UsageError: there is no such site, machine or park.
    """
    machine = find_machine(scenario.machine or _MACHINE)
    plan, site = scenario.haulage, site_of(scenario)
    layout = checked(layout_of_site(site))
    full_kg = machine.drive.payload_kg
    parks = layout.of("park")
    park = scenario.start or parks[0]
    if park not in parks:
        raise UsageError(f"start = '{park}': no place to park of site '{site.name}'{nearest(park, parks)}")
    places = {point.name: pose_at_end(layout, layout.entering[point.name][0]) for point in layout.points}
    loads_m = np.array([places[name][:2] for name in layout.of("load")])
    vehicle = KinematicVehicle(machine, Loader(loads_m, full_kg, plan.load_s, plan.dump_s), plan.slip_rad_per_g)
    ground = SiteGround(
        layout, bodies_of(machine), (drive_model(machine), drive_model(machine, full_kg)), settings.docking
    )
    x, y, heading = places[park].tolist()
    yard, things = Yard(), any(one.kind in THINGS for one in scenario.faults)
    eyes = [Sampled("points", Beat(_EYES_HZ), Eyes(yard), scenario.seed)] if things else []
    return Parts(
        machine=machine,
        world=yard,
        vehicle=vehicle,
        start=vehicle.at_rest(x, y, heading),
        sensors=_sensors(plan, scenario.seed, eyes),
        operator=None,
        bumper=YardBumper(ground, yard) if things else None,
        changing=yard,
        places={name: (float(pose[0]), float(pose[1]), 0.0) for name, pose in places.items()},
        goal_m=(x, y, 0.0),
        lines_m=_lines(layout, 0.5 * site.road.lane_m),
        expected_s=_CYCLE_S * scenario.cycles,
        settings=settings,
        haulage=Haulage(ground, park, 0.5 * site.road.lane_m),
    )


def site_of(scenario: Scenario) -> Site:
    """Return the site of a scenario, with the side that its traffic keeps to.

    Raises:
        InputError: the file cannot be read.
        UsageError: there is no such site.
    """
    site, keeps = load_site(find_site(scenario.site)), scenario.haulage.keeps
    return replace(site, keeps=keeps) if keeps else site


def find_machine(word: str) -> Machine:
    """Return a machine: of a file, or of the name of one that ships.

    Raises:
        UsageError: there is no such machine.
    """
    if Path(word).is_file():
        return load_machine(Path(word))
    shipped = {path.stem: path for path in sorted(resource(_MACHINES).glob("*.toml"))}
    if word not in shipped:
        raise UsageError(f"'{word}': a machine file or the name of one that ships was wanted{nearest(word, shipped)}")
    return load_machine(shipped[word])


def _lines(layout: Layout, half_lane_m: float) -> list[FloatArray]:
    """Return lines (N, 3) to draw: both sides of lanes, ways in areas, aprons."""
    flat: list[FloatArray] = []
    for edge in layout.edges:
        if edge.line_m is not None:
            line = edge.line_m[:, :2]
            step = np.gradient(line, axis=0)
            aside = np.column_stack([-step[:, 1], step[:, 0]]) / np.hypot(*step.T)[:, None]
            flat += [line + side * half_lane_m * aside for side in (-1, 1)] if edge.kind in LANES else [line]
    for area in layout.roles:
        corners = apron_of(layout, area, APRON_M)
        flat.append(np.vstack([corners, corners[:1]]))
    return [np.column_stack([line, np.zeros(len(line))]) for line in flat]


class SiteSenses(NamedTuple):
    """What the sensors add: the findings' noise."""

    plan: HaulagePlan

    def pose(self, stamp_ns: int, state: FloatArray, rng: np.random.Generator) -> WheelPose:
        """Return the pose of `base_link`, as the receiver tells it."""
        aside, turned = self.plan.pose_m * rng.standard_normal(2), math.radians(self.plan.heading_deg)
        heading = float(state[Column.YAW]) + turned * float(rng.standard_normal())
        x, y = (state[:2] + aside).tolist()
        return WheelPose(stamp_ns, x, y, heading)

    def joints(self, stamp_ns: int, state: FloatArray, rng: np.random.Generator) -> Joints:
        """Return the joint's angle and rate."""
        noise = np.radians(self.plan.joint_deg) * rng.standard_normal(2)
        bend = float(state[Column.ARTICULATION]) + math.radians(self.plan.joint_offset_deg) + float(noise[0])
        rate = float(state[Column.ARTICULATION_RATE]) + float(noise[1])
        return Joints(stamp_ns, {"articulation": bend}, {"articulation": rate})

    def speed(self, stamp_ns: int, state: FloatArray, rng: np.random.Generator) -> Tachometer:
        """Return the speed of the front axle."""
        return Tachometer(
            stamp_ns, float(state[Column.WHEEL_SPEED]) * (1.0 + _SPEED_NOISE * float(rng.standard_normal()))
        )


def _sensors(plan: HaulagePlan, seed: int, more: Sequence[Sensor]) -> list[Sensor]:
    """Return the sensors, all read at the same stamps: the pose last, so that joint and speed of its time are there."""
    senses = SiteSenses(plan)
    return [
        Sampled("joints", Beat(_RATE_HZ), senses.joints, seed),
        Sampled("tachometer", Beat(_RATE_HZ), senses.speed, seed),
        Sampled("site_pose", Beat(_RATE_HZ), senses.pose, seed, topic=SITE_POSE),
        Sampled("ground_truth", Beat(_RATE_HZ), true_pose, seed),
        *more,
    ]
