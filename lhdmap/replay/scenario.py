"""What a replay is: a typed file (`load_tree`). Those that ship are in `pipelines/scenarios/` and are found by their name."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from lhdmap.errors import ConfigError, InputError, UsageError
from lhdmap.replay.haulage_plan import HaulagePlan
from lhdmap.replay.link import LINK, LinkSettings
from lhdmap.replay.process import SITE_POSE
from lhdmap.resources import resource
from lhdmap.roles import ROLES
from lhdmap.settings import REQUIRED, nearest, setting
from lhdmap.settings_tree import load_tree, part, tree_toml
from lhdmap.simulation.sensing.faults import FaultSettings

GRIZZLY, HAULAGE = "grizzly", "haulage"
KINDS = ("tram", "loading", "mission", HAULAGE, GRIZZLY)
AUTONOMOUS, OPERATOR, TELEOPERATOR = "autonomous", "operator", "teleoperator"
MODES = ("idle", "autonomous", "assisted", "teleoperated", "manual")
FOLDER = "pipelines/scenarios"
MOST_MACHINES = 3
_NO_MEASUREMENTS = ("/tf_static", "/ground_truth/odometry")


@dataclass(frozen=True, slots=True)
class Errand:
    """A part of a mission: so many buckets from a draw point to a dump."""

    source: str = setting(REQUIRED, key="from", doc="Draw point.")
    to: str = setting(REQUIRED, doc="Dump.")
    buckets: int = setting(1, minimum=1, maximum=10_000, doc="How many.")
    machine: int = setting(1, minimum=1, maximum=MOST_MACHINES, doc="Which of several machines hauls them.")


@dataclass(frozen=True, slots=True)
class ModeAt:
    """A mode that the station wants from a time on, and what its operator does then."""

    at_s: float = setting(0.0, unit="s", minimum=0.0, doc="When, after the start.")
    mode: str = setting("autonomous", choices=MODES, doc="Mode of /operation/mode.")
    speed_kmh: float = setting(
        0.0,
        unit="km/h",
        minimum=-40.0,
        maximum=40.0,
        doc="His speed: a limit in assisted, in teleoperated and manual the speed itself, negative in reverse.",
    )
    steering_dps: float = setting(
        0.0, unit="deg/s", minimum=-30.0, maximum=30.0, doc="How he bends the joint in teleoperated and manual."
    )
    goal: str = setting("", doc="Another goal from then on: the branch that he wants.")

    @property
    def steering_rps(self) -> float:
        """How he bends the joint, rad/s."""
        return math.radians(self.steering_dps)


@dataclass(frozen=True, slots=True)
class Limits:
    """When a replay ends, and what it must not do."""

    time_s: float = setting(3600.0, unit="s", minimum=1.0, doc="Simulated time that it may take.")
    no_progress_s: float = setting(
        120.0, unit="s", minimum=1.0, doc="How long the machine may stay within no_progress_m of a point."
    )
    no_progress_m: float = setting(0.5, unit="m", minimum=0.01, doc="What counts as not moving on.")
    arrival_m: float = setting(1.0, unit="m", minimum=0.01, doc="How near the goal the machine must end.")
    contacts: int = setting(0, minimum=0, doc="How many contacts with walls are borne; one more ends the run.")


@dataclass(frozen=True, slots=True)
class LoadingPlan:
    """How a machine loads, how far before the pile it begins, on what ground, and when the operator has enough."""

    method: str = setting(
        "adaptive", choices=("paper", "paper-tuned", "adaptive"), doc="Excavation: docs/loading_control.md."
    )
    detector: str = setting("fused", choices=("paper", "fused"), doc="How the touch of the pile is noticed.")
    ground: str = setting("default", doc="Ground: a file, or the name of one that ships.")
    approach_m: float = setting(
        18.0,
        unit="m",
        minimum=0.0,
        maximum=500.0,
        doc="Way to the draw point at the start, as far as the drive has it.",
    )
    offset_m: float = setting(0.0, unit="m", minimum=-3.0, maximum=3.0, doc="The machine begins so far to the left.")
    turned_deg: float = setting(0.0, unit="deg", minimum=-45.0, maximum=45.0, doc="... and turned to the left by this.")
    buckets: int = setting(1, minimum=1, maximum=1000, doc="How many; between two of them the bucket is emptied.")


@dataclass(frozen=True, slots=True)
class GrizzlyPlan:
    """How the rockbreaker works on a grizzly, and the pile that its boulders come from."""

    pile: str = setting("", doc="A pile.json or the folder with it: each boulder in it lies on the grizzly.")
    timing: str = setting("smooth", choices=("paper", "paper-best", "smooth"), doc="Timing of the moves.")
    margin_m: float = setting(
        0.05,
        unit="m",
        minimum=0.0,
        maximum=1.0,
        doc="A rock is broken that is so much smaller than an opening as seen.",
    )
    look_s: float = setting(1.0, unit="s", minimum=0.0, maximum=60.0, doc="Time that the scanners take to look.")
    blow_s: float = setting(3.0, unit="s", minimum=0.0, maximum=60.0, doc="Time of hammering before the next look.")
    most_blows: int = setting(12, minimum=1, maximum=1000, doc="After so many at a rock in its place it is given up.")


@dataclass(frozen=True, slots=True)
class Scenario:
    """A replay: where, what machine, what it is to do, and what goes wrong."""

    kind: str = setting("tram", choices=KINDS, doc="What the machine does.")
    mine: str = setting("", doc="Mine plan: a file, or the name of one that ships; a grizzly alone has none.")
    seed: int = setting(0, minimum=0, doc="Seed of all chance; same seed, same journal to the bit.")
    machine: str = setting("", doc="Machine file (grizzly: the rockbreaker's); empty for the default.")
    map: str = setting("", doc="Map folder; built from a teaching drive first where it is absent.")
    start: str = setting("", doc="Place or drift where it stands at first; empty: where the plan parks.")
    goal: str = setting("", doc="Place to drive to.")
    load: float = setting(0.0, unit="t", minimum=0.0, maximum=100.0, doc="What is in the bucket at the start.")
    driver: str = setting(
        "",
        choices=("", AUTONOMOUS, OPERATOR, TELEOPERATOR),
        doc="Who drives: lhdmap itself (autonomous), or a scripted operator who sees the truth, in the cabin (operator) or at the "
        "station behind the link (teleoperator). Empty: autonomous to a goal, the operator along a route.",
    )
    route: str = setting("", doc="Drifts and places in order, - for reverse gear: T1,T2,-T3,DP1; empty: all drifts.")
    speed_kmh: float = setting(10.0, unit="km/h", minimum=0.5, maximum=40.0, doc="The operator's speed on straights.")
    wander_m: float = setting(0.0, unit="m", minimum=0.0, maximum=1.0, doc="The operator's lateral wandering, rms.")
    perception: bool = setting(True, doc="Whether odometry runs on what the sensors say.")
    mission: tuple[Errand, ...] = part(tuple)
    machines: int = setting(
        1,
        minimum=1,
        maximum=MOST_MACHINES,
        doc="Machines in the mine, each with a place to park; one without errands has those of the first. Only of kind mission.",
    )
    rocks: int = setting(
        0, minimum=0, maximum=100, doc="Rocks on the grizzly that do not fall through, besides the pile's."
    )
    grizzly: GrizzlyPlan = part(GrizzlyPlan)
    site: str = setting("", doc="Surface site: a file, or the name of one that ships; only of kind haulage.")
    cycles: int = setting(1, minimum=1, maximum=10_000, doc="Loads that are hauled on a site.")
    haulage: HaulagePlan = part(HaulagePlan)
    rearm_s: float = setting(
        5.0,
        unit="s",
        minimum=0.0,
        maximum=3600.0,
        doc="How long the station looks at a stop before it arms the machine again.",
    )
    assist_s: float = setting(
        10.0, unit="s", minimum=0.0, maximum=3600.0, doc="How long the station takes to answer a request for help."
    )
    assists: int = setting(
        5, minimum=0, maximum=1000, doc="How many requests for help the station answers; at one more it gives up."
    )
    modes: tuple[ModeAt, ...] = part(tuple, key="mode")
    loading: LoadingPlan = part(LoadingPlan)
    limits: Limits = part(Limits)
    link: LinkSettings = part(LinkSettings)
    faults: tuple[FaultSettings, ...] = part(tuple, key="fault")

    def __post_init__(self) -> None:
        """Check what a key alone cannot; raises ConfigError."""
        _check_site(self)
        if self.kind not in (GRIZZLY, HAULAGE) and not self.mine:
            raise ConfigError("mine is missing: the name of a plan that ships or a file was wanted")
        _check_grizzly(self)
        if self.machines > 1 and self.kind != "mission":
            raise ConfigError(f"machines = {self.machines} and kind = '{self.kind}': several have a mission")
        if self.goal and self.mission:
            raise ConfigError(f"goal = '{self.goal}' and mission: one of them was wanted")
        if self.driver == AUTONOMOUS and not self.goal:
            raise ConfigError("driver = 'autonomous': a goal was wanted")
        if self.goal and self.route:
            raise ConfigError(f"goal = '{self.goal}' and route = '{self.route}': one of them was wanted")
        if any(one.at_s > other.at_s for one, other in pairwise(self.modes)):
            raise ConfigError("[[mode]]: in order of at_s was wanted")
        for number, fault in enumerate(self.faults, start=1):
            try:
                _check_target(fault)
            except ConfigError as error:
                raise ConfigError(f"[[fault]] {number}: {error}") from error

    @property
    def wanted_modes(self) -> tuple[ModeAt, ...]:
        """The modes that the station wants, the first one from the start on."""
        begin = () if self.modes and self.modes[0].at_s == 0.0 else (ModeAt(),)
        return (*begin, *self.modes)

    @property
    def who(self) -> str:
        """Who drives."""
        return self.driver or (AUTONOMOUS if self.goal or self.kind != "tram" else OPERATOR)


def _check_grizzly(scenario: Scenario) -> None:
    """Refuse a grizzly without rocks, rocks elsewhere, and what a machine that stands does not do."""
    if (scenario.kind == GRIZZLY) != bool(scenario.rocks or scenario.grizzly.pile):
        raise ConfigError(
            f"kind = '{scenario.kind}' and rocks = {scenario.rocks}: a grizzly wants rocks, and nothing else does"
        )
    if scenario.kind == GRIZZLY:
        for key in ("mine", "map", "start", "goal", "route", "driver", "mission", "modes", "faults"):
            if getattr(scenario, key):
                raise ConfigError(f"{key} is given: a grizzly has none")


def _check_site(told: Scenario) -> None:
    """Refuse haulage without a site, a site with anything else, and what a site does not have."""
    if (told.kind == HAULAGE) != bool(told.site):
        raise ConfigError(f"kind = '{told.kind}' and site = '{told.site}': haulage wants a site, and nothing else does")
    if told.kind == HAULAGE:
        for key in ("mine", "map", "goal", "route", "driver"):
            if value := getattr(told, key):
                raise ConfigError(f"{key} = '{value}': a site has none, of kind haulage are site and cycles")


def _check_target(fault: FaultSettings) -> None:
    """Refuse a fault without something that could have it; names of processes are known later."""
    topics = [role.topic for role in ROLES.values()]
    if fault.of_sensor:
        topics = [topic for topic in topics if topic not in _NO_MEASUREMENTS and topic != ROLES["command"].topic]
        topics.append(SITE_POSE)
    elif fault.kind in ("link_lost", "link_degraded"):
        topics = [LINK, *topics]
    elif fault.kind == "overrun":
        if not fault.target:
            raise ConfigError("target is missing: 'overrun' wants the name of a process")
        return
    else:
        if fault.target:
            raise ConfigError(f"target = '{fault.target}': '{fault.kind}' has none")
        return
    if fault.target not in topics:
        raise ConfigError(f"target = '{fault.target}': '{fault.kind}' wants a topic{nearest(fault.target, topics)}")
    if fault.kind == "link_degraded" and not 0.0 <= fault.size <= 1.0:
        raise ConfigError(f"size = {fault.size:g}: 'link_degraded' wants a share, 0 to 1")


def find_scenario(word: str) -> Path:
    """Return the file of a scenario: a path, or the name of one that ships.

    Raises:
        InputError: there is no such file.
        UsageError: there is no such name.
    """
    path = Path(word)
    if path.is_file():
        return path
    shipped = shipped_scenarios()
    if word in shipped:
        return shipped[word]
    if path.suffix == ".toml":
        raise InputError(f"{path}: no such file; a scenario file was wanted")
    raise UsageError(f"'{word}': a scenario file or the name of one that ships was wanted{nearest(word, shipped)}")


def shipped_scenarios() -> Mapping[str, Path]:
    """Return the scenarios that ship, by name."""
    return {path.stem: path for path in sorted(resource(FOLDER).glob("*.toml"))}


def load_scenario(path: Path, **over: Any) -> Scenario:
    """Read a scenario file; `over` replaces keys. Files that it names are looked for beside it.

    Raises:
        InputError: the file cannot be read or is not TOML.
        ConfigError: a key or a value in it is wrong.
    """
    scenario = load_tree(Scenario, path, "scenario file")
    beside: dict[str, Any] = {key: _beside(path, getattr(scenario, key)) for key in ("mine", "machine", "site")}
    beside["map"] = _beside(path, scenario.map, folder=True)
    beside["loading"] = replace(scenario.loading, ground=_beside(path, scenario.loading.ground))
    if scenario.grizzly.pile:
        beside["grizzly"] = replace(scenario.grizzly, pile=str(path.parent / scenario.grizzly.pile))
    return replace(scenario, **(beside | over))


def _beside(path: Path, name: str, *, folder: bool = False) -> str:
    """Return a name, or the path of the file (or folder) that is beside the scenario under it."""
    there = path.parent / name
    if folder:  # one that is not there yet is built beside the scenario
        return str(there) if name and not Path(name).is_dir() else name
    return str(there) if name and there.is_file() else name


def scenario_toml(scenario: Scenario) -> str:
    """Print a scenario as a file that `load_scenario` reads back, each value with meaning and unit."""
    return tree_toml(scenario)
