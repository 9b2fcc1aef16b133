"""The rockbreaker as typed settings, read from a TOML file; the defaults are Table 1 as printed.

Joints 1 to 4 are swing, inner boom, outer boom and breaker; cylinders 0 and 1 both turn the swing post, 2 to 4 one joint each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from lhdmap.errors import ConfigError
from lhdmap.geometry import se3
from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.cylinders import beta_of_rho, rho_of_theta, theta_of_beta
from lhdmap.settings import check_corners, setting
from lhdmap.settings_tree import load_tree, part, tree_toml

PAPER = "rockbreaker_trajectories, Table 1"
TEXT = "rockbreaker_trajectories, section 4"
TABLE2 = "rockbreaker_trajectories, Table 2: corners of the work plane"
ASSUMED = "assumed, typical of stationary breaker booms"
JOINTS = ("swing", "inner_boom", "outer_boom", "breaker")
_LPM = 1.0 / 60_000.0  # litres a minute in m³/s
_SINGULAR = math.radians(1.0)  # how near to in line the two booms may come: there the arm is singular


@dataclass(frozen=True, slots=True)
class Base:
    """The swing post, the hydraulic supply, and where the machine stands."""

    height_m: float = setting(1.10, unit="m", source=TEXT, minimum=-20.0, maximum=20.0, doc="b: height of joint 2.")
    breaker_offset_deg: float = setting(
        5.20, unit="deg", source=TEXT, minimum=-180.0, maximum=180.0, doc="γ: from the line R4-P to the breaker's axis."
    )
    pump_flow_lpm: float = setting(
        170.0, unit="L/min", source=TEXT, minimum=0.1, maximum=1e5, doc="Q_p,max: flow that the pump delivers."
    )
    position_m: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0),
        unit="m",
        source=ASSUMED,
        minimum=-1e7,
        maximum=1e7,
        doc="Where the base's frame is in the frame of a cloud.",
    )
    yaw_deg: float = setting(
        0.0,
        unit="deg",
        source=ASSUMED,
        minimum=-360.0,
        maximum=360.0,
        doc="Heading of the base's x axis in the frame of a cloud.",
    )
    park_m: tuple[float, float, float] = setting(
        (3.0, 0.0, 0.5),
        unit="m",
        source=ASSUMED,
        minimum=-200.0,
        maximum=200.0,
        doc="Tip where the machine waits: start of a plan without --from.",
    )


@dataclass(frozen=True, slots=True)
class ArmJoint:
    """A revolute joint, the link that it carries, and its cylinder (for the swing: both cylinders alike)."""

    link_m: float = setting(1.0, unit="m", source=PAPER, minimum=0.01, maximum=50.0, doc="a: to the next joint (or P).")
    body_pin_m: float = setting(1.0, unit="m", source=PAPER, minimum=0.01, maximum=50.0, doc="u: joint to body pin A.")
    rod_pin_m: float = setting(1.0, unit="m", source=PAPER, minimum=0.01, maximum=50.0, doc="v: joint to rod pin B.")
    offset_deg: float = setting(0.0, unit="deg", source=PAPER, minimum=-360.0, maximum=360.0, doc="ε of Eq. (2).")
    flow_lpm: float = setting(60.0, unit="L/min", source=PAPER, minimum=0.01, maximum=1e5, doc="Q_max of the valve.")
    shortest_m: float = setting(1.54, unit="m", source=PAPER, minimum=0.01, maximum=50.0, doc="ρ_min of the cylinder.")
    longest_m: float = setting(2.65, unit="m", source=PAPER, minimum=0.01, maximum=50.0, doc="ρ_max of the cylinder.")
    blind_area_m2: float = setting(
        2.01e-2, unit="m²", source=PAPER, minimum=1e-6, maximum=10.0, doc="A_blind: fed when the cylinder extends."
    )
    rod_area_m2: float = setting(
        1.33e-2, unit="m²", source=PAPER, minimum=1e-6, maximum=10.0, doc="A_rod: fed when the cylinder retracts."
    )
    max_speed_mps: float = setting(
        0.0,
        unit="m/s",
        source=ASSUMED,
        minimum=0.0,
        maximum=10.0,
        doc="Largest cylinder speed; 0: what the valve gives.",
    )
    radius_m: float = setting(
        0.25, unit="m", source=ASSUMED, minimum=0.0, maximum=5.0, doc="Radius of the capsule around the link."
    )


@dataclass(frozen=True, slots=True)
class Grizzly:
    """The grizzly under the machine, in the base's frame."""

    min_m: tuple[float, float] = setting(
        (2.20, -2.15), unit="m", source=TABLE2, minimum=-200.0, maximum=200.0, doc="Corner with the least x and y."
    )
    max_m: tuple[float, float] = setting(
        (6.27, 2.15), unit="m", source=TABLE2, minimum=-200.0, maximum=200.0, doc="Corner with the largest x and y."
    )
    opening_m: float = setting(
        0.4,
        unit="m",
        source=ASSUMED,
        minimum=0.05,
        maximum=5.0,
        doc="Side of an opening: what does not pass is oversize.",
    )

    def __post_init__(self) -> None:
        """Raise ConfigError where it has no inside."""
        check_corners(self.min_m, self.max_m)


def _table1() -> tuple[ArmJoint, ...]:
    swing = {"shortest_m": 1.07, "longest_m": 1.5, "blind_area_m2": 1.03e-2, "rod_area_m2": 7.16e-3}
    return (
        ArmJoint(0.37, 1.28, 0.22, -89.04, 24.0, **swing, radius_m=0.40),
        ArmJoint(3.06, 0.70, 2.09, -57.63, 60.0, radius_m=0.30),
        ArmJoint(2.38, 2.07, 0.73, -7.60, 60.0),
        ArmJoint(2.57, 2.12, 0.63, 60.56, 38.0),
    )


@dataclass(frozen=True)
class Rockbreaker:
    """A machine: its base and its four joints; the arrays in SI units follow from them."""

    name: str = setting("rockbreaker_table1", doc="Name of the machine.")
    base: Base = part(Base)
    joints: tuple[ArmJoint, ...] = part(_table1, key="joint", names=JOINTS)
    grizzly: Grizzly = part(Grizzly)

    def per_joint(self, name: str) -> FloatArray:
        """Return one setting of the four joints, shape (4,)."""
        return np.array([getattr(joint, name) for joint in self.joints], dtype=float)

    @cached_property
    def links_m(self) -> FloatArray:
        """Lengths a_1 … a_4, shape (4,)."""
        return self.per_joint("link_m")

    @cached_property
    def flow_limits_m3ps(self) -> FloatArray:
        """Q_1,max … Q_4,max and Q_p,max, shape (5,), m³/s."""
        return np.append(self.per_joint("flow_lpm"), self.base.pump_flow_lpm) * _LPM

    @cached_property
    def theta_limits(self) -> FloatArray:
        """Limits of the joints that follow from the cylinders' (erratum 1), shape (2, 4): lowest and highest, rad.

        They are given in the turn around zero, whatever turn the offsets ε are in. The outer boom is kept a degree from in
        line with the inner one, straight or folded back, where the arm is singular, on the side where most of its range lies.
        """
        ends = np.array([[joint.shortest_m, joint.longest_m] for joint in self.joints]).T
        theta = np.sort(theta_of_beta(self, beta_of_rho(self, ends)), axis=0)
        theta -= 2.0 * np.pi * np.round(theta.mean(axis=0) / (2.0 * np.pi))
        half = min(theta[1, 0], -theta[0, 0])  # the second swing cylinder is the mirror image of the first (erratum 2)
        theta[:, 0] = -half, half
        one_side = np.array([_SINGULAR, math.pi - _SINGULAR])
        theta[:, 2] = np.clip(theta[:, 2], *(one_side if theta[:, 2].sum() > 0.0 else -one_side[::-1]))
        return theta

    @cached_property
    def elbow(self) -> float:
        """Sign of θ_3: of the two solutions of the inverse problem the one that the cylinders allow."""
        return -1.0 if self.theta_limits[:, 2].sum() < 0.0 else 1.0

    @cached_property
    def swing_rate_limit(self) -> float:
        """Lowest point of Fig. 6: swing rate that the valve allows at each angle, Eq. (17) with errata 3 and 8, rad/s."""
        theta = np.zeros((20_001, 4))
        theta[:, 0] = np.linspace(self.theta_limits[0, 0], self.theta_limits[1, 0], len(theta))
        rate = np.abs(np.gradient(rho_of_theta(self, theta)[:, :2], theta[:, 0], axis=0))
        swing = self.joints[0]
        return float(self.flow_limits_m3ps[0] / np.max(rate @ [swing.rod_area_m2, swing.blind_area_m2]))

    @cached_property
    def T_cloud_base(self) -> FloatArray:  # noqa: N802  # frames in the name
        """Pose of the base's frame in that of a cloud, shape (4, 4)."""
        return se3.from_rpy(0.0, 0.0, math.radians(self.base.yaw_deg), self.base.position_m)


def load_rockbreaker(path: Path | None = None) -> Rockbreaker:
    """Return the machine that a TOML file describes, or Table 1 where `path` is None.

    A file has `name`, `[base]`, `[grizzly]`, and `[joint.swing]`, `[joint.inner_boom]`, `[joint.outer_boom]`,
    `[joint.breaker]`; what is left out keeps the value of Table 1.

    Raises:
        InputError: the file cannot be read or is not TOML.
        ConfigError: a key or a value is wrong, or the cylinder of a joint cannot be mounted as stated.
    """
    if path is None:
        return Rockbreaker()
    machine = load_tree(Rockbreaker, path, "machine file", Rockbreaker(path.stem))
    try:
        _check(machine)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error
    return machine


def _check(machine: Rockbreaker) -> None:
    """Raise ConfigError where a joint cannot be mounted as stated, or cannot move."""
    for name, joint in zip(JOINTS, machine.joints, strict=True):
        _check_joint(f"joint.{name}", joint)
    for name, low, high in zip(JOINTS, *machine.theta_limits, strict=True):
        if low >= high:
            raise ConfigError(f"joint.{name}: its cylinder leaves it no angle to move in")


def _check_joint(name: str, joint: ArmJoint) -> None:
    """Raise ConfigError where the cylinder's range is empty or does not close the triangle of its pins."""
    nearest_m, farthest_m = abs(joint.body_pin_m - joint.rod_pin_m), joint.body_pin_m + joint.rod_pin_m
    if not nearest_m <= joint.shortest_m < joint.longest_m <= farthest_m + 1e-9:
        raise ConfigError(
            f"{name}: the cylinder's range {joint.shortest_m:g} to {joint.longest_m:g} m must lie between "
            f"{nearest_m:.3f} and {farthest_m:.3f} m, what its pins allow"
        )


def rockbreaker_toml(machine: Rockbreaker) -> str:
    """Print `machine` as a TOML file that `load_rockbreaker` reads back, each value with meaning, unit and source."""
    return tree_toml(machine)
