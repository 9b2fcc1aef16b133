"""A mine's ground as a TOML file says it: rock, face, floor, filling, spread of the machine, operator, and the sensors' errors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lhdmap.errors import UsageError
from lhdmap.resources import resource
from lhdmap.settings import nearest, setting
from lhdmap.settings_tree import load_tree, part, tree_toml

_FITTED = "fitted to Tables 3 to 5 of autonomous_loading"
_FIELD = "field's textbooks, as in the loading prototype"
_ASSUMED = "assumed, as in the loading prototype"


@dataclass(frozen=True, slots=True)
class Rock:
    """What resists the bucket."""

    hardness: float = setting(
        2.7, source=_FITTED, minimum=0.05, doc="Hardness of the penetration law, median of the loads."
    )
    hardness_sigma: float = setting(
        0.56, source=_FITTED, minimum=0.0, doc="Standard deviation of its logarithm over loads."
    )
    attempt_sigma: float = setting(0.19, source=_FITTED, minimum=0.0, doc="The same over the attempts of a load.")
    loosened: float = setting(0.79, source=_FITTED, minimum=0.1, maximum=1.0, doc="Hardness factor of each attempt.")
    noise: float = setting(
        0.25, source=_ASSUMED, minimum=0.0, maximum=1.0, doc="Standard deviation of the penetration along the way."
    )
    noise_length_m: float = setting(0.12, unit="m", source=_ASSUMED, minimum=0.01, doc="Way over which it changes.")
    penetration: float = setting(0.165, source=_FIELD, minimum=0.0, doc="K of the penetration law.")
    rake_factor: float = setting(
        2.1, unit="1/rad", source=_FITTED, minimum=0.0, doc="k_u: growth of the penetration with the bucket's angle."
    )
    loosening: float = setting(
        4.2, unit="1/m", source=_FITTED, minimum=0.0, doc="k_rel: depth lost for each metre that the lip rises."
    )
    fee_scale: float = setting(0.54, source=_FITTED, minimum=0.0, doc="a_fee: share of the earth-moving equation.")
    tensile_kpa: float = setting(19.8, unit="kPa", source=_FITTED, minimum=0.0, doc="K_t: what a rising lip breaks.")
    tensile_sigma: float = setting(0.14, source=_FITTED, minimum=0.0, doc="Its relative standard deviation.")
    density_t_m3: float = setting(
        2.42, unit="t/m3", source="11 t in 5 m3 of loose ore", minimum=0.5, doc="Density in the pile."
    )
    density_spread: float = setting(0.03, source=_ASSUMED, minimum=0.0, maximum=0.5, doc="Its largest relative change.")
    internal_deg: tuple[float, float] = setting(
        (34.0, 44.0), unit="deg", source=_FIELD, minimum=5.0, maximum=60.0, doc="Internal friction, least and largest."
    )
    external_deg: tuple[float, float] = setting(
        (20.0, 27.0), unit="deg", source=_FIELD, minimum=1.0, maximum=45.0, doc="Friction on steel, least and largest."
    )
    cohesion_kpa: tuple[float, float] = setting(
        (0.0, 5.0), unit="kPa", source=_FIELD, minimum=0.0, doc="Cohesion, least and largest."
    )
    boulders_per_m: tuple[float, float] = setting(
        (0.3, 1.3), unit="1/m", source=_ASSUMED, minimum=0.0, doc="Boulders that the lip meets, least and largest."
    )
    boulder_kn: tuple[float, float] = setting(
        (30.0, 90.0), unit="kN", source=_ASSUMED, minimum=0.0, doc="What one resists, least and largest."
    )
    boulder_length_m: float = setting(0.08, unit="m", source=_ASSUMED, minimum=0.01, doc="Way over which it does.")


@dataclass(frozen=True, slots=True)
class Face:
    """Shape of the pile."""

    slope_deg: tuple[float, float] = setting(
        (42.0, 52.0),
        unit="deg",
        source="autonomous_loading, Table 6: 46 to 53",
        minimum=10.0,
        maximum=80.0,
        doc="At which the face stands, least and largest.",
    )
    crest_m: tuple[float, float] = setting(
        (2.0, 5.0), unit="m", source=_ASSUMED, minimum=0.2, doc="Height of the pile, least and largest."
    )
    slide_per_s: float = setting(
        9.8, unit="1/s", source=_FITTED, minimum=0.01, doc="Rate at which what is too steep slides."
    )
    lateral_share: float = setting(
        0.17,
        source=_FITTED,
        minimum=0.0,
        maximum=1.0,
        doc="Share of what was dug that comes from the sides between attempts.",
    )


@dataclass(frozen=True, slots=True)
class Filling:
    """What stays in the bucket."""

    swell: float = setting(1.1, source=_ASSUMED, minimum=1.0, maximum=2.0, doc="Loose volume over that in the pile.")
    entering: float = setting(
        0.89, source=_FITTED, minimum=0.0, maximum=1.0, doc="η: share of the swept rock that enters an empty bucket."
    )
    heap: float = setting(
        1.15, source=_ASSUMED, minimum=0.5, maximum=2.0, doc="Heap of a racked bucket over its nominal volume."
    )
    level_share: float = setting(
        0.82, source=_FITTED, minimum=0.1, maximum=1.0, doc="Share of the heap that a level floor holds."
    )
    boulder_chance: float = setting(
        0.048, source=_FITTED, minimum=0.0, maximum=1.0, doc="Chance of a boulder in the bucket in an attempt."
    )
    boulder_m3: tuple[float, float] = setting(
        (0.5, 1.5), unit="m3", source=_ASSUMED, minimum=0.0, doc="Its volume, least and largest."
    )


@dataclass(frozen=True, slots=True)
class Floor:
    """The floor before the pile, and how the bucket lies on it."""

    friction: tuple[float, float] = setting(
        (0.40, 0.62), source=_FIELD, minimum=0.05, maximum=1.5, doc="Friction of the tyres, least and largest."
    )
    wet_chance: float = setting(0.15, source=_ASSUMED, minimum=0.0, maximum=1.0, doc="Share of loads on a wet floor.")
    wet_friction: tuple[float, float] = setting(
        (0.30, 0.38), source=_ASSUMED, minimum=0.05, maximum=1.5, doc="Friction there."
    )
    press_bar: float = setting(
        23.0,
        unit="bar",
        source="autonomous_loading, section 3.3",
        minimum=0.0,
        doc="Tilt pressure at which lowering ends.",
    )
    high_chance: float = setting(
        0.2, source=_ASSUMED, minimum=0.0, maximum=1.0, doc="Chance that the lip does not touch the floor."
    )
    high_m: tuple[float, float] = setting(
        (0.05, 0.15), unit="m", source=_ASSUMED, minimum=0.0, doc="Its height then, least and largest."
    )
    bumps_per_m: float = setting(
        0.14, unit="1/m", source=_FITTED, minimum=0.0, doc="Spikes of the floor that a pressed lip meets."
    )
    bump_factor: float = setting(3.4, source=_FITTED, minimum=0.0, doc="Their mean force over the press force.")
    bump_length_m: float = setting(0.15, unit="m", source=_ASSUMED, minimum=0.01, doc="Their length.")


@dataclass(frozen=True, slots=True)
class Hydraulic:
    """How far the loading machine of this mine is from its file."""

    tilt_factor: float = setting(
        1.0, source=_FITTED, minimum=0.1, maximum=3.0, doc="Tilt rate over the file's, median."
    )
    tilt_spread: float = setting(
        0.2, source=_FITTED, minimum=0.0, maximum=0.9, doc="Its relative standard deviation over loads."
    )


@dataclass(frozen=True, slots=True)
class Operator:
    """Who watches and ends a load."""

    stop_fill: float = setting(0.84, source=_FITTED, minimum=0.0, maximum=2.0, doc="Fill from which on the load ends.")
    stop_sigma: float = setting(
        0.05, source=_FITTED, minimum=0.0, maximum=1.0, doc="Error of the operator's view of it."
    )
    most_attempts: int = setting(
        4, source="autonomous_loading, Table 3", minimum=1, maximum=20, doc="Attempts of a load at most."
    )


@dataclass(frozen=True, slots=True)
class Errors:
    """Errors of what is measured; the paper gives none of these."""

    tacho_mps: float = setting(0.01, unit="m/s", source=_ASSUMED, minimum=0.0, doc="Noise of the tachometer.")
    scan_mps: float = setting(0.03, unit="m/s", source=_ASSUMED, minimum=0.0, doc="Noise of the scan odometry's speed.")
    scan_lag_s: float = setting(0.1, unit="s", source=_ASSUMED, minimum=0.0, maximum=2.0, doc="Its lag.")
    scan_hz: float = setting(20.0, unit="Hz", source=_ASSUMED, minimum=1.0, maximum=100.0, doc="Its rate.")
    pressure_bar: float = setting(
        4.0,
        unit="bar",
        source=_ASSUMED,
        minimum=0.0,
        doc="Noise of the transmission's and the tilt cylinder's pressure.",
    )
    lift_bar: float = setting(
        1.5, unit="bar", source=_ASSUMED, minimum=0.0, doc="Noise of the lift cylinder's pressure."
    )
    joint_rad: float = setting(0.001, unit="rad", source=_ASSUMED, minimum=0.0, doc="Noise of the joints' angles.")
    toe_m: float = setting(
        0.15, unit="m", source=_ASSUMED, minimum=0.0, doc="Error of the perceived toe, constant over a charge."
    )


@dataclass(frozen=True, slots=True)
class Grounds:
    """A mine's ground: one point of many that reproduce the paper's tables; docs/ground.md says what they do not determine."""

    name: str = setting("default", doc="Name of the mine.")
    rock: Rock = part(Rock)
    face: Face = part(Face)
    filling: Filling = part(Filling)
    floor: Floor = part(Floor)
    hydraulic: Hydraulic = part(Hydraulic)
    operator: Operator = part(Operator)
    errors: Errors = part(Errors)


def load_ground(name: str | Path = "default") -> Grounds:
    """Return the ground of a mine: a file, or the name of one of `datasets/grounds`.

    Raises:
        InputError: the file cannot be read or is not TOML.
        ConfigError: a key or a value in it is wrong.
        UsageError: no ground of that name ships with lhdmap.
    """
    path = name if isinstance(name, Path) else _found(name)
    return load_tree(Grounds, path, "ground file", Grounds(path.stem))


def _found(name: str) -> Path:
    """Return the file of a name: one that is there, or one that ships."""
    if Path(name).is_file():
        return Path(name)
    shipped = {path.stem: path for path in sorted(resource("datasets/grounds").glob("*.toml"))}
    if name not in shipped:
        raise UsageError(
            f"ground = '{name}': a ground file or the name of one that ships was wanted{nearest(name, shipped)}"
        )
    return shipped[name]


def ground_toml(ground: Grounds) -> str:
    """Print a ground as a TOML file that `load_ground` reads back."""
    return tree_toml(ground)
