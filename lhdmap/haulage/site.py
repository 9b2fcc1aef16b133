"""A site as in the load-haul-dump paper, Section 2.1: areas beside a road, T-junctions, waypoints and checkpoints; a TOML file.

The road is given by its centre line; each area by where its mouth joins the road, and by places in it. Waypoints of each direction
follow: lanes lie beside the centre line, on the side that traffic keeps to, and each way begins and ends at a checkpoint.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from lhdmap.errors import ConfigError, InputError, UsageError
from lhdmap.resources import resource
from lhdmap.settings import REQUIRED, nearest, setting
from lhdmap.settings_tree import load_tree, part

FOLDER = "pipelines/sites"
Poses = tuple[tuple[float, float, float], ...]
_FRAME = "in the frame of the mouth: x from the road into the area, y to the left"


@dataclass(frozen=True, slots=True)
class SitePlace:
    """A place in an area where something is done; poses (x, y, heading)."""

    name: str = setting(REQUIRED, doc="Name of the place.")
    purpose: str = setting(REQUIRED, choices=("load", "dump", "park"), doc="What is done there.")
    pose: tuple[float, float, float] = setting(REQUIRED, unit="m, m, deg", doc=f"Where the machine stands, {_FRAME}.")
    backup: tuple[float, float, float] | None = setting(
        None, unit="m, m, deg", doc="Where it changes gear (E15 of the paper); none: it drives in forward."
    )
    joins: str = setting(
        "mouth", choices=("mouth", "queue"), doc="Where the way from there leads: of a park to the queue."
    )
    out: tuple[tuple[float, float], ...] = setting((), unit="m", doc="Waypoints of that way.")


@dataclass(frozen=True, slots=True)
class SiteArea:
    """An area: A1, where is loaded, A3, where is dumped, or another."""

    name: str = setting(REQUIRED, doc="Name of the area.")
    role: str = setting(REQUIRED, choices=("load", "dump", "park"), doc="What is done in it.")
    at_m: float = setting(REQUIRED, unit="m", minimum=0.0, doc="Where along the road its mouth is.")
    side: str = setting("left", choices=("left", "right"), doc="Side of the road, seen along its line.")
    queue: tuple[float, float, float] = setting(
        REQUIRED, unit="m, m, deg", doc=f"Where a machine waits for its place, {_FRAME}."
    )
    exit: bool = setting(True, doc="Whether a way leads from the queue point back to the mouth, past the places.")
    exit_by: tuple[tuple[float, float], ...] = setting((), unit="m", doc="Waypoints of that way.")
    speed_kmh: float = setting(10.0, unit="km/h", minimum=1.0, maximum=40.0, doc="Speed in it.")
    apron: tuple[tuple[float, float], ...] = setting(
        (),
        unit="m",
        doc=f"Corners of the ground that bounds it, in order, {_FRAME}; none: 12 m around all ways in it.",
    )
    places: tuple[SitePlace, ...] = part(tuple, key="place")


@dataclass(frozen=True, slots=True)
class Road:
    """The roadway A2 between the areas."""

    line_m: tuple[tuple[float, float], ...] = setting(REQUIRED, unit="m", doc="Centre line, at least two points.")
    bend_radius_m: float = setting(60.0, unit="m", minimum=5.0, doc="Radius of its bends.")
    lane_m: float = setting(
        4.0,
        unit="m",
        minimum=2.0,
        maximum=12.0,
        source="haulage findings: half a lane used 1.94 m",
        doc="Width of a lane.",
    )
    speed_kmh: float = setting(30.0, unit="km/h", minimum=1.0, maximum=60.0, doc="Speed on it.")
    checkpoint_m: float = setting(
        0.0, unit="m", minimum=0.0, doc="A checkpoint each so many metres, where another machine may follow; 0: none."
    )


@dataclass(frozen=True, slots=True)
class Site:
    """A site."""

    name: str = setting(REQUIRED, doc="Name of the site.")
    keeps: str = setting("left", choices=("left", "right"), doc="Side of the road that traffic keeps to.")
    turn_radius_m: float = setting(12.0, unit="m", minimum=4.0, doc="Radius of turns at T-junctions.")
    turn_kmh: float = setting(10.0, unit="km/h", minimum=1.0, maximum=40.0, doc="Speed in them.")
    road: Road = part(Road)
    areas: tuple[SiteArea, ...] = part(tuple, key="area")

    def __post_init__(self) -> None:
        """Check what a key alone cannot; raises ConfigError."""
        few = next((one for one in self.areas if 0 < len(one.apron) < 3), None)
        if few is not None:
            raise ConfigError(f"area '{few.name}': apron has {len(few.apron)} corners: three or more were wanted")
        names = [one.name for one in self.areas] + [place.name for one in self.areas for place in one.places]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ConfigError(f"the name '{twice}' stands twice")
        if len(self.road.line_m) < 2:
            raise ConfigError("[road] line_m: two points or more were wanted")


def load_site(path: Path) -> Site:
    """Read a site file.

    Raises:
        InputError: the file cannot be read or is not TOML.
        ConfigError: a key or a value in it is wrong.
    """
    return load_tree(Site, path, "site file")


def shipped_sites() -> Mapping[str, Path]:
    """Return the sites that ship, by name."""
    return {path.stem: path for path in sorted(resource(FOLDER).glob("*.toml"))}


def find_site(word: str) -> Path:
    """Return the file of a site: a path, or the name of one that ships.

    Raises:
        InputError: there is no such file.
        UsageError: there is no such name.
    """
    path, shipped = Path(word), shipped_sites()
    if path.is_file():
        return path
    if word in shipped:
        return shipped[word]
    if path.suffix == ".toml":
        raise InputError(f"{path}: no such file; a site file was wanted")
    raise UsageError(f"'{word}': a site file or the name of one that ships was wanted{nearest(word, shipped)}")
