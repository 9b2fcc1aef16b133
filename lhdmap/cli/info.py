"""`lhdmap info PATH`: what is in a map or run folder, in ten lines."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lhdmap.cli.console import Console

_SETTINGS_SHOWN = 4
_WHAT = {
    "pile": "ore pile",
    "plan": "rockbreaker's plan",
    "workspace": "rockbreaker's workspace",
    "suite": "suite of scenes",
    "replay": "replay",
    "localization": "localization",
    "navigation": "tables of drives",
    "production": "production of replays",
    "batch": "batch of logs",
    "live": "live run",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap info`."""
    parser.add_argument("path", type=Path, metavar="PATH", help="map folder, or that of another run of lhdmap")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Read the folder's description and print it."""
    values = folder_values(arguments.path)
    console.result(values, "\n".join(folder_lines(values)))
    return 0


def folder_values(path: Path) -> dict[str, Any]:
    """Return what `--json` prints of a folder.

    Raises:
        InputError: it is none of lhdmap, or not complete.
    """
    from lhdmap.runfolder import RunFolder

    folder = RunFolder.open(path)
    info = folder.info
    return {
        "path": str(path),
        "kind": folder.kind,
        "software": info.get("software"),
        "format_version": info.get("format_version"),
        "sources": [source | {"there": Path(source["path"]).exists()} for source in info.get("sources", [])],
        "counts": info.get("counts", {}),
        "frames": info.get("frames", {}),
        "settings": _changed_settings(info.get("options", {})),
        "files": {one.name: one.stat().st_size for one in sorted(path.iterdir()) if one.is_file()},
        "changed": folder.changed_files(by_size=True),
        "warnings": folder.warnings,
        **({"scenario": info["options"]["scenario"]} if "scenario" in info.get("options", {}) else {}),
        **({"map": folder_values(path / info["map"])} if "map" in info else {}),
    }


def _changed_settings(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings that are not the defaults of this version, by `section.key`."""
    from lhdmap.config import Settings, settings_table

    defaults = settings_table(Settings())
    found = {}
    for section, values in options.items():
        for key, value in values.items() if section in defaults and isinstance(values, dict) else ():
            default = defaults[section].get(key)
            if value != (list(default) if isinstance(default, tuple) else default):
                found[f"{section}.{key}"] = value
    return found


def folder_lines(values: Mapping[str, Any]) -> list[str]:
    """Return the folder in ten lines at most; of a run with a map in it, what is in the map."""
    inner = values.get("map")
    if inner:
        return [f"{values['kind']:<12} {values['path']}", *folder_lines(inner)]
    software = values["software"]
    lines = [f"{_WHAT.get(values['kind'], values['kind']):<12} {values['path']}, made by lhdmap {software['version']}"]
    for source in values["sources"][:1]:
        more = f" and {len(values['sources']) - 1} more" if len(values["sources"]) > 1 else ""
        lines.append(f"made from    {source['path']}{'' if source['there'] else ' (not found from here)'}{more}")
    if "scenario" in values:
        lines.append(_scenario_line(values["scenario"]))
    lines += _drive_lines(values["counts"])
    lines += _tracked_lines(values["counts"])
    lines += _result_lines(Path(values["path"]))
    settings = [f"{name} = {value}" for name, value in values["settings"].items()]
    more = " …" if len(settings) > _SETTINGS_SHOWN else ""
    lines.append(f"settings     {', '.join(settings[:_SETTINGS_SHOWN]) or 'the defaults'}{more}")
    lines.append(f"files        {', '.join(f'{name} {_size(size)}' for name, size in values['files'].items())}")
    if values["changed"]:
        lines.append(f"changed      {', '.join(values['changed'])}: not as they were written")
    if values["warnings"]:
        lines.append(f"warnings     {len(values['warnings'])}, the first: {values['warnings'][0]}")
    return lines


def _drive_lines(counts: Mapping[str, Any]) -> list[str]:
    if "distance_m" not in counts:
        return []
    drive = f"drive        {counts['distance_m']:.0f} m in {counts['duration_s']:.0f} s"
    if "scans" not in counts:
        return [drive]
    if counts.get("poses"):
        return [drive, f"scans        {counts['scans']}, poses given: {counts['poses']}"]
    from lhdmap.report.text import trust_line

    weak = 100.0 * (counts.get("degenerate_share") or 0.0)
    scans = (
        f"scans        {counts['scans']} ({counts['scans_processed']} processed), weak {weak:.0f} %, "
        f"lost stretches {counts.get('lost_stretches', 0)}, closed loops {counts.get('closures', 0)}"
    )
    trust = trust_line(counts)
    return [*([] if trust is None else [f"may be off   {trust}"]), drive, scans]


def _tracked_lines(counts: Mapping[str, Any]) -> list[str]:
    if "tracking_share" not in counts:
        return []
    at_m = counts.get("first_fix_m")
    first = "no fix" if at_m is None else f"first fix after {at_m:.1f} m"
    share = f"{100.0 * counts['tracking_share']:.1f} % of {counts['scans']} scans"
    return [f"tracked      {share}, {first}, lost {counts.get('lost_stretches', 0)} time(s)"]


def _result_lines(folder: Path) -> list[str]:
    """Return what the run found, of its own JSON files."""
    import json

    lines = _topology_lines(folder)
    for name, line_of in _RESULTS.items():
        if not (folder / name).is_file():
            continue
        try:
            found = json.loads((folder / name).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            lines.append(f"{name:<12} not readable")
            continue
        lines.append(line_of(found))
    return lines


def _topology_lines(folder: Path) -> list[str]:
    from lhdmap.errors import InputError
    from lhdmap.report.topology_levels import summary
    from lhdmap.topology.files import NAME, read_topology
    from lhdmap.topology.sheet import read_sheets

    if not (folder / NAME).is_file():
        return []
    sheets = folder / "free_space.npz"
    try:
        return [f"topology     {summary(read_topology(folder), read_sheets(sheets) if sheets.is_file() else ())}"]
    except InputError:
        return ["topology     not readable"]


def _pile_line(found: Mapping[str, Any]) -> str:
    status = found.get("status") or f"unknown: {found.get('reason')}"
    width = "" if found.get("width_m") is None else f", {found['width_m']:.2f} m wide"
    slope = "" if found.get("inclination_deg") is None else f", inclination {found['inclination_deg']:.1f}°"
    return f"pile         {status}{width}{slope}"


def _plan_line(found: Mapping[str, Any]) -> str:
    if not found.get("feasible"):
        return f"plan         not feasible: {(found.get('reason') or {}).get('text', 'no reason given')}"
    return f"plan         {str(found['path']).upper()}, {found['timing']}: {found['duration_s']:.2f} s"


def _scenario_line(told: Mapping[str, Any]) -> str:
    """Say who drove where, what was hauled, or what lay on the grizzly."""
    if told.get("kind") == "grizzly":
        return f"scenario     rockbreaker, {told.get('rocks')} rocks on the grizzly, seed {told.get('seed')}"
    if told.get("kind") == "haulage":
        site = Path(str(told.get("site"))).stem
        return f"scenario     haulage, {told.get('cycles')} loads; site {site}, seed {told.get('seed')}"
    who = told.get("driver") or ("autonomous" if told.get("goal") else "operator")
    way = f"route {told['route']}" if told.get("route") else f"to {told['goal']}" if told.get("goal") else "all drifts"
    start = f"from {told['start']} " if told.get("start") else ""
    load = f", {told['load']:.1f} t" if told.get("load") else ""
    return f"scenario     {who}, {start}{way}{load}; mine {Path(str(told.get('mine'))).stem}, seed {told.get('seed')}"


def _verdict_line(found: Mapping[str, Any]) -> str:
    contacts, near = len(found.get("contacts", [])), found.get("min_clearance_m")
    parts = [f"{contacts} contacts" + ("" if near is None else f", clearance {near:.2f} m")]
    for name, words in (("stops", "stops"), ("assists", "requests for assistance")):
        parts += [f"{found[name]} {words}"] if found.get(name) else []
    parts += [f"{len(found['faults'])} faults"] if found.get("faults") else []
    return f"verdict      {'ok' if found.get('ok') else 'not ok'}: {found.get('reason')}; {', '.join(parts)}"


_RESULTS = {"pile.json": _pile_line, "plan.json": _plan_line, "verdict.json": _verdict_line}


def _size(size: int) -> str:
    return f"{size / 1e6:.1f} MB" if size >= 1e5 else f"{size / 1e3:.0f} kB"
