"""The mine plan: a TOML file of drifts, places and junctions (`docs/mines.md`), in the mine's own grid: x east, y north, z up."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from lhdmap.errors import ConfigError, InputError
from lhdmap.resources import resource
from lhdmap.settings import REQUIRED, Profile, nearest, setting
from lhdmap.settings_tree import load_tree, part

ASSUMED = "lhdmap: usual in drifts for 10-t loaders"
KINDS = ("draw_point", "dump", "park", "turning_bay", "passing_bay", "niche", "refuge")
PILES = ("normal", "skewed", "bulging", "asymmetric", "concave", "too_shallow", "wall", "hang_up", "boulder", "spill")
LENGTH_M = {
    "draw_point": 20.0,
    "dump": 12.0,
    "park": 13.0,
    "turning_bay": 15.0,
    "passing_bay": 25.0,
    "niche": 2.5,
    "refuge": 2.5,
}
"""How long a place is where the plan does not say, from the drift's wall, along its own axis (a passing bay: along the drift)."""
PASSING_M = 2.5
"""By how much a passing bay widens its drift where the plan does not say."""
BLIND = ("niche", "refuge")
"""Places too short to drive into: no branches of a junction."""


@dataclass(frozen=True, slots=True)
class WallPlan:
    """What walls and roofs look like: the default of all drifts."""

    profile: str = setting("arched", choices=("arched", "box"), doc="Shape of the cross-section.")
    roughness_m: float = setting(0.12, unit="m", minimum=0.0, maximum=0.5, doc="Roughness, standard deviation.")
    roughness_scale_m: float = setting(
        2.0, unit="m", minimum=0.2, maximum=20.0, doc="Knot spacing of the coarsest scale."
    )
    roughness_gain: float = setting(0.7, minimum=0.1, maximum=1.0, doc="Amplitude of each scale over the coarser one.")
    roughness_octaves: int = setting(5, minimum=1, maximum=10, doc="Scales of the roughness, each half as long.")
    blast_round_m: float = setting(3.5, unit="m", minimum=0.5, maximum=10.0, doc="Length of a blast round.")
    blast_flare_m: float = setting(
        0.06, unit="m", minimum=0.0, maximum=0.5, doc="How far walls flare over a round before they step back."
    )
    bolts_m: float = setting(
        0.0, unit="m", minimum=0.0, maximum=0.3, doc="How far plates of rock bolts and mesh stand out of the rock."
    )
    bolt_spacing_m: float = setting(1.2, unit="m", minimum=0.4, maximum=5.0, doc="Distance from bolt to bolt.")
    mesh_m: float = setting(0.12, unit="m", minimum=0.03, maximum=0.5, doc="Edge length of the mesh.")


@dataclass(frozen=True, slots=True)
class FloorPlan:
    """What the floors look like."""

    undulation_m: float = setting(
        0.035, unit="m", minimum=0.0, maximum=0.3, doc="Long waves (2 to 8 m), standard deviation."
    )
    roughness_m: float = setting(0.012, unit="m", minimum=0.0, maximum=0.2, doc="Fine roughness, standard deviation.")
    friction: float = setting(
        0.6, source="loading prototype: 0.40 to 0.62 dry", minimum=0.05, maximum=1.5, doc="Friction of tyres on it."
    )


@dataclass(frozen=True, slots=True)
class SurfacePlan:
    """A surveyed surface in place of the generated one; the drifts then say only where one drives."""

    file: str = setting(
        "", doc="Mesh (PLY, OBJ, DAE, STL) or survey cloud (PLY, PCD, LAS, LAZ), from the plan's folder."
    )
    kind: str = setting("auto", choices=("auto", "mesh", "cloud"), doc="What the file is; auto: by what is in it.")
    up: str = setting("z", choices=("z", "y"), doc="Axis of the file that points up.")
    scale: float = setting(1.0, minimum=1e-4, maximum=1e4, doc="Metres a unit of the file.")
    offset_m: tuple[float, float, float] = setting((0.0, 0.0, 0.0), unit="m", doc="Added to the file's coordinates.")
    cell_m: float = setting(0.15, unit="m", minimum=0.03, maximum=2.0, doc="Edge length of the mesh of a cloud.")


@dataclass(frozen=True, slots=True)
class DriftPlan:
    """A drift: its centre line on the floor and its cross-section along it."""

    name: str = setting(REQUIRED, doc="Name of the drift.")
    line_m: tuple[tuple[float, float, float], ...] = setting(
        REQUIRED, unit="m", doc="Centre line on the floor, [[x, y, z], …]; its corners are rounded."
    )
    bend_radius_m: float = setting(12.0, unit="m", minimum=1.0, maximum=1000.0, doc="Radius at the line's corners.")
    width_m: Profile = setting(
        4.5,
        unit="m",
        source=ASSUMED,
        minimum=2.5,
        maximum=30.0,
        doc="Width: one, or [[at_m, width], …] along the drift.",
    )
    height_m: Profile = setting(
        4.0, unit="m", source=ASSUMED, minimum=2.5, maximum=30.0, doc="Height: one, or [[at_m, height], …]."
    )
    roughness_m: float | None = setting(None, unit="m", minimum=0.0, maximum=0.5, doc="Its own roughness.")
    level: str = setting("", doc="Name of the level that it belongs to; by its height where it is left out.")

    def __post_init__(self) -> None:
        """Raise ConfigError where the line is none."""
        if len(self.line_m) < 2:
            raise ConfigError(f"line_m of drift '{self.name}' has {len(self.line_m)} points: two or more were wanted")
        if self.name.startswith("-") or "," in self.name or not self.name:
            raise ConfigError(f"name = '{self.name}': a name without comma, that does not begin with '-', was wanted")


@dataclass(frozen=True, slots=True)
class PlacePlan:
    """Something at a point of a drift: `end` is the end of its line, `left` and `right` make a short drift beside it."""

    drift: str = setting(REQUIRED, doc="Name of the drift.")
    at_m: float | None = setting(None, unit="m", doc="Distance along the drift's centre line; of an `end` not needed.")
    kind: str = setting(REQUIRED, choices=KINDS, doc="What is there.")
    side: str = setting(
        "left", choices=("left", "right", "end"), doc="Where: beside the drift, or at the end of its line."
    )
    name: str = setting(REQUIRED, doc="Name of the place.")
    pile: str = setting("normal", choices=PILES, doc="Of a draw point: the variant of its pile (lhdmap simulate pile).")
    angle_deg: float | None = setting(
        None,
        unit="deg",
        minimum=20.0,
        maximum=160.0,
        doc="Between the drift's direction and the place's; default 90, draw points 60.",
    )
    length_m: float | None = setting(
        None,
        unit="m",
        minimum=1.0,
        maximum=200.0,
        doc="How far it reaches from the drift's wall (a passing bay: how long it is).",
    )
    width_m: float | None = setting(
        None,
        unit="m",
        minimum=1.5,
        maximum=30.0,
        doc="Its width (a passing bay: by how much it widens the drift); default: the drift's.",
    )
    height_m: float | None = setting(None, unit="m", minimum=1.5, maximum=30.0, doc="Its height; default: the drift's.")


@dataclass(frozen=True, slots=True)
class JunctionPlan:
    """What the plan says of one junction."""

    at: tuple[float, float, float] = setting(REQUIRED, unit="m", doc="Where it is, [x, y, z], to 5 m.")
    corner_m: float = setting(
        6.0, unit="m", minimum=0.0, maximum=50.0, doc="Radius of the wall at its corners; 0: they are not cut."
    )
    name: str = setting("", doc="Its name.")


@dataclass(frozen=True, slots=True)
class WetPlan:
    """Water or mud on a stretch of floor."""

    drift: str = setting(REQUIRED, doc="Name of the drift.")
    from_m: float = setting(0.0, unit="m", minimum=0.0, doc="Where it begins on the drift's centre line.")
    to_m: float = setting(REQUIRED, unit="m", minimum=0.0, doc="Where it ends.")
    friction: float = setting(
        0.34, source="loading prototype: 0.30 to 0.38 wet", minimum=0.02, maximum=1.5, doc="Friction of tyres on it."
    )


@dataclass(frozen=True, slots=True)
class DustPlan:
    """A cloud of dust that hangs in a stretch of drift."""

    drift: str = setting(REQUIRED, doc="Name of the drift.")
    from_m: float = setting(0.0, unit="m", minimum=0.0, doc="Where it begins on the drift's centre line.")
    to_m: float = setting(REQUIRED, unit="m", minimum=0.0, doc="Where it ends.")
    share: float = setting(0.1, minimum=0.0, maximum=0.9, doc="Mean share of beams that it returns.")


@dataclass(frozen=True, slots=True)
class EquipmentPlan:
    """Something that stands in a drift: a parked machine, a person, a post, a box."""

    drift: str = setting(REQUIRED, doc="Name of the drift.")
    at_m: float = setting(REQUIRED, unit="m", minimum=0.0, doc="Where on the drift's centre line its middle is.")
    kind: str = setting("box", choices=("box", "machine", "person", "post"), doc="What it is.")
    lateral_m: float = setting(0.0, unit="m", minimum=-30.0, maximum=30.0, doc="Beside the centre line, left positive.")
    turn_deg: float = setting(0.0, unit="deg", minimum=-180.0, maximum=180.0, doc="Its heading over the drift's.")
    size_m: tuple[float, float, float] = setting((1.0, 1.0, 1.0), unit="m", doc="Of a box: length, width, height.")


@dataclass(frozen=True, slots=True)
class MinePlan:
    """A mine: drifts that join where their lines meet, and what is in them."""

    name: str = setting("mine", doc="Name of the mine.")
    seed: int = setting(0, minimum=0, maximum=2**31, doc="Seed of all that is random in its surface.")
    walls: WallPlan = part(WallPlan)
    floor: FloorPlan = part(FloorPlan)
    surface: SurfacePlan = part(SurfacePlan)
    drifts: tuple[DriftPlan, ...] = part(tuple, key="drift")
    places: tuple[PlacePlan, ...] = part(tuple, key="place")
    junctions: tuple[JunctionPlan, ...] = part(tuple, key="junction")
    wet: tuple[WetPlan, ...] = part(tuple)
    dust: tuple[DustPlan, ...] = part(tuple)
    equipment: tuple[EquipmentPlan, ...] = part(tuple)

    def __post_init__(self) -> None:
        """Raise ConfigError where names are missing, taken twice, or of drifts that are not in the plan."""
        if not self.drifts:
            raise ConfigError("at least one [[drift]] was wanted")
        names = [drift.name for drift in self.drifts]
        taken: set[str] = set()
        for name in (*names, *(place.name for place in self.places)):
            if name in taken:
                raise ConfigError(f"name = '{name}': two drifts or places have it, each wants its own")
            taken.add(name)
        parts = (("place", self.places), ("wet", self.wet), ("dust", self.dust), ("equipment", self.equipment))
        for key, things in parts:
            for thing in things:
                if thing.drift not in names:
                    raise ConfigError(
                        f"[[{key}]]: drift = '{thing.drift}' is not in the plan{nearest(thing.drift, names)}"
                    )

    def drift(self, name: str) -> DriftPlan:
        """Return the drift of that name."""
        return next(one for one in self.drifts if one.name == name)


def load_plan(path: Path) -> MinePlan:
    """Return the plan in a file; `surface.file` becomes a path from here.

    Raises:
        InputError: the file cannot be read or is not TOML.
        ConfigError: a key or a value in it is wrong.
    """
    plan = load_tree(MinePlan, path, "mine plan")
    if not plan.surface.file:
        return plan
    return replace(plan, surface=replace(plan.surface, file=str(path.parent / plan.surface.file)))


def shipped_plans() -> dict[str, Path]:
    """Return the plans that ship, by name."""
    folder = resource("pipelines/mines")
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def find_plan(name: str) -> Path:
    """Return the file of a plan: a path, or the name of one that ships.

    Raises:
        InputError: there is no such file.
        ConfigError: there is no such name.
    """
    path, known = Path(name), shipped_plans()
    if path.is_file():
        return path
    if name in known:
        return known[name]
    if path.suffix == ".toml":
        raise InputError(f"{path}: no such file; a mine plan was wanted")
    raise ConfigError(f"mine '{name}': no such file, and no plan of that name ships{nearest(name, known)}")
