"""Topologies of simulated mines and real logs against the truth: the table `evaluation/topology.md`.

python -m tools.evaluate.topology [--folder KEPT] [--plans NAME ...] [--seeds 1 2 ...] [--no-real]

Drives are simulated once and kept in a folder: a run that was stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from lhdmap.messages import FloatArray
from lhdmap.topology.build import topology_of
from lhdmap.topology.settings import TopologySettings

from tools.evaluate.topology_drives import OWN, ROUGHNESS_M, SHIPPED, drive_of
from tools.evaluate.topology_real import LOGS, RealScore, real_score
from tools.evaluate.topology_score import SAME, Score, placed, score

ROOT = Path(__file__).resolve().parents[2]
RESULT = ROOT / "evaluation" / "topology.md"
POSES = ("exact poses", "own poses")
WALLS = (("0.12 to 0.15", 0.0, 0.16), ("0.20", 0.16, 0.25), ("0.30", 0.25, 1.0))
HEADING = """\
# Topologies

Written by `python -m tools.evaluate.topology`; not edited by hand. Teaching drives through the plans that ship and those of
`tests/topology/plans`, 5 worlds each: other walls, roughness 0.12, 0.15, 0.15, 0.20, 0.30 m (`narrow`, which has no
intersection, keeps its own); two scanners at 12.5 Hz, inclinometer, tachometer, joint encoder. Exact poses:
the true ones; own poses: odometry and loop closure, the truth fitted onto the driven path. One setting for all, the default.
Constants were chosen with the worlds 1, 2, 3 and 5 in sight; world 4 (0.20 m) was not looked at before the last of these changes.

Access points: distance from the true one in the map, and with the node's own error taken out ("in node"); median / worst.
`tunnels`: those that join the right intersections or ends, as a multigraph.
"""
HEAD = """\
| plan | walls, m | drives | intersections | extra | degrees | tunnels | in map, m | in node, m | heading, ° |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""
REAL_HEAD = """\
## Real logs

Against what a person drew, own poses; doors and rooms that the drawing marks as optional do not count. The drawing is fitted
onto the map by its core intersections, as its README says. Intel has two of them, so that its fit is loose: in the column
"extra, all" the optional ones take part in the fit.

| log | intersections | degrees | extra | extra, all | distance, m |
| --- | --- | --- | --- | --- | --- |
"""


class Result(NamedTuple):
    """One drive's score."""

    plan: str
    roughness_m: float
    poses: str
    score: Score


def results(plans: Sequence[str], seeds: Sequence[int], folder: Path) -> list[Result]:
    """Return the scores of all drives along both kinds of poses."""
    found = []
    for plan in plans:
        for seed in seeds:
            drive = drive_of(plan, seed, folder)
            for poses, seen in zip(POSES, (drive.true, drive.own), strict=True):
                topology = topology_of(seen, TopologySettings()).map
                placement = SAME if seen is drive.true else placed(drive.true, drive.own)
                one = score(topology, drive.truth, placement)
                found.append(Result(plan, ROUGHNESS_M[seed - 1], poses, one))
                print(f"{plan} {seed} {poses}: {'right' if one.right else 'WRONG'} {pair(one.in_map_m)}", flush=True)
    return found


def pair(values: FloatArray) -> str:
    """Return median and worst."""
    return f"{np.median(values):.2f} / {values.max():.2f}" if len(values) else "-"


def row(name: str, walls: str, chosen: list[Result]) -> str:
    """Return a line of the table."""
    scores = [one.score for one in chosen]
    nodes, edges = sum(one.nodes for one in scores), sum(one.edges for one in scores)
    wrong = sum(len(one.missing) for one in scores)
    in_map, in_node, heading = (np.concatenate([getattr(one, key) for one in scores]) for key in Score._fields[8:11])
    cells = [
        name, walls, len(scores), f"{sum(one.found for one in scores)} / {nodes}", sum(one.extra for one in scores),
        sum(one.degrees for one in scores), f"{edges - wrong} / {edges}", pair(in_map), pair(in_node), pair(heading),
    ]  # fmt: skip
    return "| " + " | ".join(str(cell) for cell in cells) + " |\n"


def table(found: list[Result], poses: str) -> str:
    """Return the table of one kind of poses: each plan by roughness, then all plans."""
    text = f"## {poses.capitalize()}\n\n{HEAD}"
    for plan in [*dict.fromkeys(one.plan for one in found), ""]:
        for walls, low, high in WALLS:
            chosen = [
                one for one in found if one.poses == poses and low <= one.roughness_m < high and plan in ("", one.plan)
            ]
            if chosen:
                text += row(plan or "**all**", walls, chosen)
    return text + "\n"


def real_table(found: list[RealScore]) -> str:
    """Return the table of the real logs."""
    lines = [
        f"| {one.name} | {one.found} / {one.core} | {one.degrees} | {one.extra} | {one.extra_all} | {pair(one.apart_m)} |\n"
        for one in found
    ]
    return REAL_HEAD + "".join(lines)


def as_json(found: list[Result], real: list[RealScore]) -> dict[str, Any]:
    """Return all scores as JSON values."""
    plain = [
        {"plan": one.plan, "roughness_m": one.roughness_m, "poses": one.poses}
        | {key: _plain(value) for key, value in one.score._asdict().items()}
        for one in found
    ]
    return {"drives": plain, "real": [{key: _plain(value) for key, value in one._asdict().items()} for one in real]}


def _plain(value: Any) -> Any:
    return [round(float(one), 3) for one in value] if isinstance(value, np.ndarray) else value


def main(words: list[str] | None = None) -> int:
    """Measure and write; return 1 where a topology of a simulated drive is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "lhdmap_topology_drives")
    parser.add_argument("--plans", nargs="+", default=[*SHIPPED, *OWN], metavar="NAME")
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3, 4, 5], metavar="N")
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared", help="folder with data/ and truth/")
    parser.add_argument("--no-real", action="store_true", help="simulated drives alone")
    arguments = parser.parse_args(words)
    found = results(arguments.plans, arguments.seeds, arguments.folder)
    truth, data = arguments.data / "truth", arguments.data / "data"
    real = [
        real_score(name, data / log, truth / f"{name}.json", arguments.folder)
        for name, log in (() if arguments.no_real else LOGS)
        if (data / log).is_file()
    ]
    parts = [HEADING, "\n", *(table(found, poses) for poses in POSES), real_table(real) if real else ""]
    RESULT.write_text("".join(parts), encoding="utf-8")
    RESULT.with_suffix(".json").write_text(json.dumps(as_json(found, real), indent=1) + "\n", encoding="utf-8")
    return int(not all(one.score.right for one in found))


if __name__ == "__main__":
    sys.exit(main())
