"""Write the figures of README.md from the tables in evaluation/ and from a run of the demo, between the two marks.

python -m tools.readme_figures
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
BEGIN, END = "<!-- figures: python -m tools.readme_figures -->", "<!-- end of figures -->"
DEFAULT, WALLS, PEERS = (
    "Default (anchored), rough walls",
    "Moderate (3 cm) and smooth (5 mm) walls, 12 km/h, 25 Hz",
    "Peers",
)
KISS, LINES = "KISS-ICP", "point-to-line ICP"
LOGS = {"intel": "Intel Research Lab", "aces": "ACES building", "csail": "MIT CSAIL"}
# From evaluation/pile.md and evaluation/rockbreaker.md, by hand.
PILE = (
    (
        "simulated drifts that end in a pile, from the log alone, 15 m before the toe (40 scenes a kind); and 66 of a second "
        "generator, written independently"
    ),
    (
        "width and inclination wrong by **0.06 m, 1.2°** on the mean (the loading paper, six real piles: 0.58 m, 1.7°), before a "
        "stope 0.09 m, 1.3°; second generator 0.07 m, 1.3°; 78 of 80 boulders found; no wall or hang-up called loadable"
    ),
)
# From evaluation/topology.md, closures.md, localization.md, guidance.md, faults.md and docs/routes.md, by hand.
TOPOLOGY = (
    "55 simulated teaching drives through 11 mines, walls rough by 0.12 to 0.30 m, own odometry; three office buildings",
    (
        "intersections, degrees and tunnels **all right, none too many**; in the buildings 12 of 12 core nodes, none too many; "
        "access points 0.30 m off in the median, at walls of 0.15 m 1.6 m at worst; headings 3.8° at worst"
    ),
)
ROUTES = (
    "a level of 8 streets with 19 intersections each: 5,376 states, two cores that others used as well",
    "0.4 to 0.7 ms",
)
LOCALIZATION = (
    (
        "planar tunnels of 100 m, 10 worlds a class, three drives each, on the own map of another drive; a second drive"
        " through a simulated mine in space"
    ),
    (
        "along the tunnel **3 mm** in rough walls, 6 mm in moderate ones, 13 mm in smooth ones with niches (one drive "
        "1.2 m off); featureless smooth walls 54 mm in the median, metres where wheels slip unnoticed; in space 9 mm "
        "along, 4 mm across, found after 9 m"
    ),
)
GUIDANCE = (
    (
        "replays through tunnels made to measure, bends of 5.5 to 15 m radius, least room c beside the bodies; "
        "simulated scanners, own odometry, map and localization"
    ),
    (
        "c 0.25 m: **10 of 10** drives without a contact, 8.4 km/h on the mean, least room 0.20 m; c 0.15 m: **10 of "
        "10**, 7.5 km/h, 0.065 m; 43 drives with 85 random faults: no contact"
    ),
)
LOADING = (
    "a model of machine and ground fitted to the paper's tables: 200 loads that nothing was tuned on; 500 charges",
    (
        "first fill **0.76** (the paper's controller 0.59, tuned alike 0.68), **2.0** attempts to 90 % (3.0, 2.2); the pile "
        "felt in 99.4 % of the charges, 0.12 s after 40 kN; weighed to 3.3 %; in closed loop two buckets from draw point to dump"
    ),
)
ROCKBREAKER = (
    "the paper's machine and its trajectory T1, 20.5 s there",
    "its profile 20.3 s, `--timing smooth` **14.1 s** under the same limits, the bound of any is 12.6 s; 8 ms to plan",
)


def main() -> int:
    rows = json.loads((ROOT / "evaluation" / "odometry.json").read_text(encoding="utf-8"))
    real = (ROOT / "evaluation" / "real_logs.md").read_text(encoding="utf-8")
    readme = ROOT / "README.md"
    text = readme.read_text(encoding="utf-8")
    head, tail = text.split(BEGIN)[0], text.split(END)[1]
    readme.write_text(f"{head}{BEGIN}\n{_figures(rows, real, _demo())}\n{END}{tail}", encoding="utf-8")
    return 0


def _figures(rows: list[dict[str, Any]], real: str, demo: dict[str, Any]) -> str:
    """Return the table."""
    judged = [row for row in rows if row["target"] is not None]
    met = sum(bool(row["ok"]) for row in judged)
    ten = next(segment for segment in demo["evaluation"]["segments"] if segment["length_m"] == 10.0)
    cloud = (ROOT / "evaluation" / "integration.md").read_text(encoding="utf-8")
    exact, own, own_most = (
        _cell(cloud, row) for row in ("exact poses: median", "own odometry: median", "own odometry: p95")
    )
    rough, smooth = _value(rows, DEFAULT, "12 km/h, 25 Hz, 381 beams: 10 m"), _value(rows, WALLS, "smooth: 10 m")
    wheels = _value(rows, WALLS, "smooth, tachometer", ": 10 m")
    kiss, lines = _value(rows, PEERS, KISS, "rough"), _value(rows, PEERS, LINES, "rough")
    table = [
        ("what", "measured on", "figures"),
        ("---", "---", "---"),
        (
            "[odometry](evaluation/odometry.md)",
            "planar drifts, 12 km/h, 25 Hz, 381 beams; mean error over 10 m",
            (
                f"rough walls **{rough}** (KISS-ICP {kiss}, point-to-line ICP {lines}), smooth walls **{smooth}**, with a "
                f"tachometer **{wheels}**; {met} of {len(judged)} targets met"
            ),
        ),
        (
            "the sample drive",
            "`make demo`: 3D, uneven floor, grades, a noisy and late inclinometer",
            (
                f"**{ten['translation_pct']:.2f} %** over 10 m; the end is {demo['evaluation']['end_pct']:.2f} % of "
                f"{demo['evaluation']['distance_m']:.0f} m off"
            ),
        ),
        (
            "[cloud](evaluation/integration.md)",
            "such drives against the true surface; median distance",
            f"**{own}** (95 %: {own_most}); with exact poses {exact}",
        ),
        (
            "[real logs](evaluation/real_logs.md)",
            "mean error of relations at most 60 s apart, CSAIL: of steps between key scans",
            "; ".join(_log(real, key, name) for key, name in LOGS.items()),
        ),
        ("[topology](evaluation/topology.md)", *TOPOLOGY),
        ("[routes](docs/routes.md)", *ROUTES),
        ("[localization](evaluation/localization.md)", *LOCALIZATION),
        ("[guidance](evaluation/guidance.md)", *GUIDANCE),
        ("[ore pile](evaluation/pile.md)", *PILE),
        ("[loading](evaluation/loading.md)", *LOADING),
        ("[rockbreaker](evaluation/rockbreaker.md)", *ROCKBREAKER),
    ]
    return "\n".join(f"| {' | '.join(row)} |" for row in table)


def _value(rows: list[dict[str, Any]], group: str, *words: str) -> str:
    """Return the first figure of a group whose name holds all words, with its unit."""
    for row in rows:
        if row["group"].startswith(group) and all(word in row["name"] for word in words):
            digits = 1 if row["measured"] >= 10 else 2 if row["measured"] >= 0.1 else 3
            return f"{row['measured']:.{digits}f} {row['unit']}"
    raise SystemExit(f"evaluation/odometry.json has no figure {' '.join(words)} under {group}")


def _cell(table: str, row: str) -> str:
    """Return the measured figure of a row, as it is printed."""
    found = re.search(rf"^\| {re.escape(row)} \| ([^|]*) \|", table, re.MULTILINE)
    if found is None:
        raise SystemExit(f"evaluation/integration.md has no row {row}")
    return found[1].strip()


def _log(real: str, key: str, name: str) -> str:
    """Return the errors of a log in words; its row: n, wheels, scans, fused, ..."""
    found = re.search(rf"^\| {key} \| \d+ \| ([^|]*m, [^|]*°) \| [^|]* \| ([^|]*m, [^|]*°) \|", real, re.MULTILINE)
    if found is None:
        raise SystemExit(f"evaluation/real_logs.md has no row of errors for {key}")
    return f"{name} **{found[2]}** (wheels alone {found[1]})"


def _demo() -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "lhdmap", "demo", "--json", "--quiet", "-o", f"{folder}/demo"]
        found: dict[str, Any] = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return found


if __name__ == "__main__":
    sys.exit(main())
