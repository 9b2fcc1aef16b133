"""The scenario that a command line of `lhdmap simulate` asks for."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lhdmap.errors import UsageError
from lhdmap.settings import near_names, nearest

if TYPE_CHECKING:
    from lhdmap.simulation.scenario import DriftScenario

BUILT_IN = ("drift", "pile", "mine", "grizzly")
DUST_SHARE, MIXED_PIXEL_SHARE, DROP_OUT_SHARE = 0.03, 0.5, 0.01


def scenario_of(arguments: argparse.Namespace) -> DriftScenario:
    """Return the scenario that a command line asks for: the file's or the built-in one, with the options over it.

    Raises:
        UsageError: the scenario is neither built in nor a file, or an option's value is wrong.
        ConfigError: a value is out of its range.
    """
    from lhdmap.settings import load_section
    from lhdmap.simulation.scenario import SECTIONS, load_scenario
    from lhdmap.simulation.sensing.faults import load_faults

    path = Path(arguments.scenario)
    if arguments.scenario not in BUILT_IN and not path.is_file():
        raise UsageError(
            f"'{arguments.scenario}': a scenario file or one of {', '.join(BUILT_IN)} was wanted"
            f"{_meant(arguments.scenario)}"
        )
    scenario = _built_in(arguments) if arguments.scenario in BUILT_IN else load_scenario(path)
    top, sections = _overrides(arguments)
    for name, values in sections.items():
        current = getattr(scenario, name)
        checked = load_section(SECTIONS[name], name, values)
        scenario = replace(scenario, **{name: replace(current, **{key: getattr(checked, key) for key in values})})
    if arguments.faults is not None:
        top["faults"] = load_faults(arguments.faults)
    return replace(scenario, **top)


def _meant(word: str) -> str:
    return nearest(word, BUILT_IN) if near_names(word, BUILT_IN) else ""


def _built_in(arguments: argparse.Namespace) -> DriftScenario:
    """Return the drift, or the scene of a pile that variant and seed make."""
    from lhdmap.simulation.pile_scenes import scene
    from lhdmap.simulation.scenario import DriftScenario

    if arguments.scenario == "drift":
        return DriftScenario()
    return scene(arguments.variant or "normal", arguments.seed or 0, flat_floor=arguments.flat_floor)


def _overrides(arguments: argparse.Namespace) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Return what the options set: top-level keys, and the keys of each section."""
    top = {"seed": arguments.seed, "machine": arguments.machine}
    top |= {"planar": arguments.planar or None, "truth": False if arguments.no_truth else None}
    inclinometer = False if arguments.planar and arguments.inclinometer is None else arguments.inclinometer
    sections = {
        "drift": {
            "roughness_m": _roughness(arguments.roughness),
            "mesh_m": arguments.mesh_size,
            "cross_drifts": _tuples("--cross-drift", arguments.cross_drift, 3),
        },
        "drive": {
            "distance_m": arguments.length,
            "speed_kmh": arguments.speed_kmh,
            "stops": _tuples("--stop", arguments.stop, 2),
            "reversals": _tuples("--reverse", arguments.reverse, 2),
        },
        "scanner": scanner_values(arguments),
        "inclinometer": {"enabled": inclinometer},
        "wheels": {"enabled": arguments.wheels, "slip": arguments.slip or None},
    }
    return _given(top), {name: _given(values) for name, values in sections.items()}


def scanner_values(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return what the options say of the scanners; None where they do not."""
    dusty = arguments.dust
    return {
        "beams": arguments.beams,
        "rate_hz": arguments.rate_hz,
        "noise_m": None if arguments.noise_mm is None else arguments.noise_mm / 1000.0,
        "max_range_m": arguments.max_range_m,
        "sweep": arguments.sweep,
        "rear": arguments.rear,
        "dust_share": DUST_SHARE if dusty else None,
        "mixed_pixel_share": MIXED_PIXEL_SHARE if dusty else None,
        "drop_out_share": DROP_OUT_SHARE if dusty else None,
    }


def _given(values: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}


def _roughness(text: str | None) -> float | None:
    from lhdmap.simulation.scenario import ROUGHNESS_M

    if text is None:
        return None
    if text in ROUGHNESS_M:
        return ROUGHNESS_M[text]
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"--roughness {text}: {', '.join(ROUGHNESS_M)} or a number of metres was wanted") from None


def _tuples(option: str, texts: list[str] | None, count: int) -> tuple[tuple[float, ...], ...] | None:
    if texts is None:
        return None
    try:
        rows = tuple(tuple(float(part) for part in text.split(",")) for text in texts)
    except ValueError:
        rows = ((),)
    if any(len(row) != count for row in rows):
        raise UsageError(f"{option} {' '.join(texts)}: {count} numbers with commas between them were wanted")
    return rows
