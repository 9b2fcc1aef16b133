"""All settings of the pipeline: one typed section a stage, read from TOML over the defaults, single values overridden."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lhdmap.console.settings import ConsoleSettings
from lhdmap.docking.settings import DockingSettings
from lhdmap.errors import ConfigError
from lhdmap.executor.settings import ExecutorSettings
from lhdmap.guidance.settings import GuidanceSettings
from lhdmap.haulage.settings import HaulageSettings
from lhdmap.integration.integrator import IntegrationSettings
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.loading.digging_settings import ChargingSettings, ExcavationSettings, PaperDigSettings, TunedDigSettings
from lhdmap.loading.task_settings import LoadingSettings
from lhdmap.loading.weighing_settings import AttemptSettings, WeighingSettings
from lhdmap.localization.settings import LocalizationSettings
from lhdmap.movement.settings import MovementSettings
from lhdmap.navigation.settings import NavigationSettings
from lhdmap.odometry.cloud.settings import CloudOdometrySettings
from lhdmap.odometry.settings import AnchorSettings, OdometrySettings, RangeFlowSettings, SearchSettings
from lhdmap.odometry.trust_settings import TrustSettings
from lhdmap.pile.figure9.settings import Figure9Constants, RepairedConstants
from lhdmap.pile.settings import PileSettings
from lhdmap.proprioception.attitude import AttitudeSettings
from lhdmap.proprioception.gyro import GyroSettings
from lhdmap.proprioception.slip import SlipSettings
from lhdmap.proprioception.wheels import WheelSettings
from lhdmap.report.recording_settings import RecordingSettings
from lhdmap.rockbreaker.settings import RockbreakerSettings
from lhdmap.settings import load_section, nearest, section_toml
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.topology.settings import TopologySettings
from lhdmap.tracking.settings import TrackingSettings
from lhdmap.traffic.settings import TrafficSettings

_HEADER = """\
# Settings of the lhdmap pipeline: the defaults. Copy this file, change what you need and pass it with --config; keys that
# are left out keep their defaults, unknown keys are refused. `lhdmap config` prints it.
"""


@dataclass(frozen=True, slots=True)
class Settings:
    """One section for each stage."""

    odometry: OdometrySettings = field(default_factory=OdometrySettings)
    anchor: AnchorSettings = field(default_factory=AnchorSettings)
    search: SearchSettings = field(default_factory=SearchSettings)
    range_flow: RangeFlowSettings = field(default_factory=RangeFlowSettings)
    trust: TrustSettings = field(default_factory=TrustSettings)
    cloud_odometry: CloudOdometrySettings = field(default_factory=CloudOdometrySettings)
    attitude: AttitudeSettings = field(default_factory=AttitudeSettings)
    gyro: GyroSettings = field(default_factory=GyroSettings)
    wheels: WheelSettings = field(default_factory=WheelSettings)
    slip: SlipSettings = field(default_factory=SlipSettings)
    integration: IntegrationSettings = field(default_factory=IntegrationSettings)
    smoothing: SmoothingSettings = field(default_factory=SmoothingSettings)
    topology: TopologySettings = field(default_factory=TopologySettings)
    landmarks: LandmarkSettings = field(default_factory=LandmarkSettings)
    localization: LocalizationSettings = field(default_factory=LocalizationSettings)
    navigation: NavigationSettings = field(default_factory=NavigationSettings)
    guidance: GuidanceSettings = field(default_factory=GuidanceSettings)
    tracking: TrackingSettings = field(default_factory=TrackingSettings)
    docking: DockingSettings = field(default_factory=DockingSettings)
    executor: ExecutorSettings = field(default_factory=ExecutorSettings)
    loading: LoadingSettings = field(default_factory=LoadingSettings)
    pile: PileSettings = field(default_factory=PileSettings)
    figure9: Figure9Constants = field(default_factory=Figure9Constants)
    figure9_repaired: RepairedConstants = field(default_factory=RepairedConstants)
    charging: ChargingSettings = field(default_factory=ChargingSettings)
    excavation: ExcavationSettings = field(default_factory=ExcavationSettings)
    excavation_paper: PaperDigSettings = field(default_factory=PaperDigSettings)
    excavation_tuned: TunedDigSettings = field(default_factory=TunedDigSettings)
    weighing: WeighingSettings = field(default_factory=WeighingSettings)
    attempts: AttemptSettings = field(default_factory=AttemptSettings)
    movement: MovementSettings = field(default_factory=MovementSettings)
    haulage: HaulageSettings = field(default_factory=HaulageSettings)
    traffic: TrafficSettings = field(default_factory=TrafficSettings)
    recording: RecordingSettings = field(default_factory=RecordingSettings)
    rockbreaker: RockbreakerSettings = field(default_factory=RockbreakerSettings)
    console: ConsoleSettings = field(default_factory=ConsoleSettings)


SECTIONS: dict[str, Any] = {section.name: section.default_factory for section in dataclasses.fields(Settings)}


def load_settings(path: Path | None = None, assignments: Iterable[str] = ()) -> Settings:
    """Return the defaults with the values of a TOML file and of `section.key=value` assignments over them.

    Raises:
        ConfigError: the file cannot be read, or a section, key or value is wrong.
    """
    table: dict[str, dict[str, Any]] = {}
    for name, values in (_read(path) if path is not None else {}).items():
        _check(name, values, f"{path}: ")
        table[name] = values
    for assignment in assignments:
        section, key, value = _parsed(assignment)
        _check(section, {key: value}, "")
        table.setdefault(section, {})[key] = value
    return Settings(**{name: load_section(SECTIONS[name], name, values) for name, values in table.items()})


def section_names(sections: Iterable[str]) -> list[str]:
    """Return the names of sections, each checked.

    Raises:
        ConfigError: one is unknown.
    """
    for name in sections:
        if name not in SECTIONS:
            raise ConfigError(f"unknown section '{name}'{nearest(name, SECTIONS)}")
    return list(dict.fromkeys(sections))


def setting_names() -> list[str]:
    """Return all settings as `section.key`."""
    return [f"{name}.{key}" for name, section in SECTIONS.items() for key in _keys(section)]


def settings_toml(settings: Settings | None = None, sections: Iterable[str] = ()) -> str:
    """Print settings as TOML, each with meaning, unit and source; of some sections alone, where they are named."""
    chosen = settings or Settings()
    named = list(sections)
    texts = [section_toml(name, getattr(chosen, name)) for name in named or SECTIONS]
    return "\n".join(texts if named else [_HEADER, *texts])


def settings_from(values: Mapping[str, Any]) -> Settings:
    """Return the defaults with these over them: `{"odometry.method": "range_flow"}` or `{"odometry": {"method": …}}`.

    Raises:
        ConfigError: a section, key or value is wrong.
    """
    table: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        section, dot, key = str(name).partition(".")
        if not (dot or isinstance(value, Mapping)):
            near = [one for one in setting_names() if one.endswith(f".{name}")]
            raise ConfigError(f"settings: '{name}' is in no section{nearest(section, near or SECTIONS)}")
        part = {key: value} if dot else dict(value)
        _check(section, part, "settings: ")
        table.setdefault(section, {}).update(part)
    return Settings(**{name: load_section(SECTIONS[name], name, part) for name, part in table.items()})


def settings_table(settings: Settings) -> dict[str, dict[str, Any]]:
    """Return the settings as plain values, for `map.json`."""
    return {
        name: {f.name: getattr(getattr(settings, name), f.name) for f in dataclasses.fields(getattr(settings, name))}
        for name in SECTIONS
    }


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror or error}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: no valid TOML: {error}") from error


def _parsed(assignment: str) -> tuple[str, str, Any]:
    """Return section, key and value of `section.key=value`; a value that is no TOML is taken as text."""
    name, equals, text = assignment.partition("=")
    section, dot, key = name.strip().partition(".")
    if not (equals and dot and section and key):
        near = [one for one in setting_names() if name.strip() and one.endswith(f".{name.strip()}")]
        example = f"did you mean {near[0]}={text or '…'}?" if near else "e.g. odometry.method=range_flow"
        raise ConfigError(f"--set {assignment}: section.key=value was wanted, {example}")
    try:
        return section, key, tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return section, key, text.strip()


def _check(name: str, values: Any, origin: str) -> None:
    """Refuse a section that is unknown or wrong in itself; `origin` says where it stands.

    Raises:
        ConfigError: it is; where the key is known in another section, that one is named.
    """
    if name not in SECTIONS:
        raise ConfigError(f"{origin}unknown section '{name}'{nearest(name, SECTIONS)}")
    if not isinstance(values, dict):
        raise ConfigError(f"{origin}'{name}' is a section: [{name}] with its settings below was wanted")
    for key in values:
        elsewhere = [f"{other}.{key}" for other, section in SECTIONS.items() if key in _keys(section)]
        if elsewhere and f"{name}.{key}" not in elsewhere:
            raise ConfigError(f"{origin}unknown setting '{name}.{key}'{nearest(key, elsewhere)}")
    try:
        load_section(SECTIONS[name], name, values)
    except ConfigError as error:
        raise ConfigError(f"{origin}{error}") from error


def _keys(section: Any) -> list[str]:
    return [field.name for field in dataclasses.fields(section)]
