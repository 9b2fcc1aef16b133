"""Whether a map is ready to run on, and if not, why: `check_map(PATH)` for a map folder, or a `topology.geojson` alone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from lhdmap.json_files import read_json
from lhdmap.machine import Machine
from lhdmap.mapfolder import MapFolder
from lhdmap.movement.check_folder import content_findings, folder_findings, machine_of_map
from lhdmap.movement.check_moves import Reach, inversion_findings, reach_findings
from lhdmap.movement.check_parts import (
    connection_findings,
    limit_findings,
    room_findings,
    tunnel_findings,
    twin_findings,
)
from lhdmap.movement.findings import Finding, Verdict, verdict_of
from lhdmap.movement.routes import RoutePlanner
from lhdmap.movement.settings import MovementSettings
from lhdmap.topology.files import topology_file
from lhdmap.topology.geojson import from_geojson
from lhdmap.topology.model import TopologicalMap


def check_map(path: Path, settings: MovementSettings | None = None, machine: Machine | None = None) -> Verdict:
    """Return the verdict over a map folder or a topology file; `machine`: that which is to run, else the map's own.

    Raises:
        InputError: there is no map, or it cannot be read.
    """
    folder = MapFolder.open(path) if path.is_dir() else None
    file = topology_file(path)
    table = read_json(file, "the topological map", "build the map again")
    topology = from_geojson(table, str(file))
    own = machine or (machine_of_map(folder) if folder is not None else Machine())
    findings = [*content_findings(table), *topology_findings(topology, settings, own or Machine())]
    if own is None:
        text = f"built for another machine than {Machine().name}, which is checked: give its file with --machine"
        findings.append(Finding("warning", "machine", "map", text))
    findings += [] if folder is None else folder_findings(folder, topology)
    return verdict_of(findings)


def topology_findings(
    topology: TopologicalMap, settings: MovementSettings | None = None, machine: Machine | None = None
) -> Iterator[Finding]:
    """Yield what is wrong with a topological map for a machine: parts first, then movements."""
    chosen, runs = settings or MovementSettings(), machine or Machine()
    yield from twin_findings(topology, chosen)
    yield from limit_findings(topology, runs)
    yield from room_findings(topology, chosen, runs)
    yield from tunnel_findings(topology)
    yield from connection_findings(topology)
    if not topology.points:
        yield Finding("error", "reach", "map", "no access point and no waypoint: there is nowhere to go")
        return
    planner = RoutePlanner(topology, chosen)
    reach = Reach(planner)
    yield from reach_findings(planner, reach)
    yield from inversion_findings(topology, reach, runs)
