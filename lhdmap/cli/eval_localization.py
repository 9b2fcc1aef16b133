"""`lhdmap eval localization RUN --truth T.tum --map-truth TEACHING.tum`: along, across, heading, nodes, first fix, consistency."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lhdmap.cli.console import Console


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the subject `localization`."""
    parser.add_argument("run_folder", type=Path, metavar="RUN", help="folder of lhdmap localize")
    parser.add_argument(
        "--truth", type=Path, required=True, metavar="T.tum", help="truth of the drive that was localized"
    )
    parser.add_argument(
        "--map-truth",
        type=Path,
        required=True,
        metavar="TEACHING.tum",
        help="truth of the drive that the map was built from",
    )
    parser.add_argument(
        "--map", type=Path, metavar="MAP", help="the map's folder (default: the one that the run was made with)"
    )
    parser.add_argument(
        "--nodes", type=Path, metavar="CSV", help="true nodes of the drive, as simulate mine writes them"
    )
    parser.add_argument(
        "--global",
        dest="globally",
        action="store_true",
        help="align truth and map once at the start, so that the map's own drift counts",
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Evaluate and print the figures."""
    from lhdmap.evaluation.localization import LocalizationTable, MapTruth, evaluated, names_of, read_nodes
    from lhdmap.localization.rows import LocalizationRow
    from lhdmap.mapfolder import MapFolder
    from lhdmap.runfolder import RunFolder
    from lhdmap.topology.files import read_topology
    from lhdmap.trajectory import read_tum

    folder = RunFolder.open(arguments.run_folder, ["localization"])
    map_folder = MapFolder.open(arguments.map or Path(folder.info["options"]["request"]["map"]))
    columns = folder.table("localization.parquet", LocalizationRow._fields)
    topology = map_folder.file("topology.geojson")
    columns["node"] = _named(columns["node"], names_of(topology, "tunnel", "intersection"))
    teaching = MapTruth(read_tum(arguments.map_truth), map_folder.trajectory(), globally=arguments.globally)
    places = set(names_of(topology, "waypoint").values())
    nodes = read_nodes(arguments.nodes, places) if arguments.nodes else None
    found = evaluated(
        LocalizationTable.of(columns), read_tum(arguments.truth), teaching, nodes, read_topology(map_folder.path)
    )
    console.result(found, _text(found))
    return 0


def _named(ids: Any, names: dict[str, str]) -> Any:
    import numpy as np

    return np.array([names.get(str(one), str(one)) for one in ids], dtype=object)


def _text(found: dict[str, Any]) -> str:
    """Return the figures as a table."""
    lines = [f"tracked      {100 * found['tracking_share']:.1f} % of {found['scans']} scans"]
    for key, scale, unit in (
        ("along_m", 1e3, "mm"),
        ("across_m", 1e3, "mm"),
        ("height_m", 1e3, "mm"),
        ("heading_deg", 1.0, "°"),
    ):
        one = found[key]
        if one["rmse"] is not None:
            texts = [f"{name} {scale * one[name]:.3g}" for name in ("rmse", "median", "p95", "max")]
            lines.append(f"{key.split('_')[0]:<12} {', '.join(texts)} {unit}")
    inside = found["within_2_sigma"]
    if inside["along"] is not None:
        lines.append("within 2 σ   " + ", ".join(f"{name} {100 * value:.0f} %" for name, value in inside.items()))
    first = "none"
    if found["first_fix_s"] is not None:
        first = f"after {found['first_fix_s']:.1f} s and {found['first_fix_m']:.1f} m"
    lines.append(f"first fix    {first}; false fixes {found['false_fixes']}")
    if found["node_accuracy"] is not None:
        lines.append(f"node right   {100 * found['node_accuracy']:.2f} %")
    return "\n".join(lines)
