"""Files about the truth of simulated piles: one JSON a drive, and a table in the style of the paper's Table 6."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lhdmap.errors import InputError
from lhdmap.simulation.pile_facts import PileTruth
from lhdmap.trajectory import Trajectory

COLUMNS = ("attempt", "log", "gt_width_m", "gt_inclination_deg", "gt_status")


class Row(NamedTuple):
    """One row of the table: the drive's name, its log (relative to the table), and its truth; None where it has none."""

    attempt: str
    log: str
    width_m: float | None
    inclination_deg: float | None
    status: str


def write_pile_truth(path: Path, truth: PileTruth, drive: Trajectory) -> None:
    """Write the truth as JSON; `drive` are the exact poses whose distance to the toe is told.

    Raises:
        OSError: the file exists or cannot be written.
    """
    with path.open("x", encoding="utf-8") as file:
        lines = (f'"{key}": {json.dumps(value, allow_nan=False)}' for key, value in pile_json(truth, drive).items())
        file.write("{\n" + ",\n".join(lines) + "\n}\n")


def pile_json(truth: PileTruth, drive: Trajectory) -> dict[str, Any]:
    """Return the truth as JSON values; null where a scene has no such thing. Points are in `map`, metres."""
    plane = truth.plane
    return {
        "frame": "map",
        "variant": truth.variant,
        "status": truth.status,
        "width_m": _number(truth.width_m),
        "inclination_deg": _number(truth.inclination_deg),
        "left_m": _number(truth.left_m),
        "right_m": _number(truth.right_m),
        "end_heading_rad": math.remainder(truth.end_heading_rad, 2 * math.pi),
        "center_m": truth.center_m.tolist(),
        "floor_at_toe_m": truth.floor_m,
        "toe_m": np.round(truth.toe_m, 4).tolist(),
        "plane": None if plane is None else {"offset_m": plane.offset_m, "by_y": plane.by_y, "by_z": plane.by_z},
        "volume_m3": truth.volumes_m3.get(1.6),
        "volume_to_height_m3": {f"{height:g}": volume for height, volume in truth.volumes_m3.items()},
        "boulders": [
            {
                "center_m": boulder.center_m.tolist(),
                "size_m": boulder.size_m,
                "visible_center_m": boulder.visible_center_m.tolist(),
                "visible_size_m": boulder.visible_size_m,
            }
            for boulder in truth.boulders
        ],
        "stamps_ns": drive.stamps_ns.tolist(),
        "distance_to_toe_m": np.round(truth.distances_m(drive.positions_m), 4).tolist(),
    }


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def row_of(path: Path, folder: Path) -> Row:
    """Return the row of the drive whose truth lies at `path` (`NAME.pile.json`) for a table in `folder`.

    Raises:
        InputError: the file is not the truth about a pile.
    """
    name = path.name.removesuffix(".pile.json")
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        width, inclination, status = table["width_m"], table["inclination_deg"], str(table["status"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: not the truth about a simulated pile ({error})") from error
    log = path.with_name(name + ".mcap").resolve().relative_to(folder.resolve())
    return Row(name, log.as_posix(), width, inclination, status)


def write_table(path: Path, rows: Iterable[Row]) -> None:
    """Write rows as CSV with the columns of Table 6 (`COLUMNS`); a value that a scene does not have stays empty.

    Raises:
        OSError: the file cannot be written.
    """
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for row in rows:
            numbers = [
                "" if value is None else f"{value:.{digits}f}"
                for value, digits in ((row.width_m, 4), (row.inclination_deg, 3))
            ]
            writer.writerow([row.attempt, row.log, *numbers, row.status])
