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
LOGS = {
    "intel": "Intel Research Lab, 513 m",
    "aces": "ACES building, 333 m",
    "csail": "MIT CSAIL, 383 m (the one in `datasets/`)",
}


def main() -> int:
    rows = json.loads((ROOT / "evaluation" / "odometry.json").read_text(encoding="utf-8"))
    real = (ROOT / "evaluation" / "real_logs.md").read_text(encoding="utf-8")
    readme = ROOT / "README.md"
    text = readme.read_text(encoding="utf-8")
    head, tail = text.split(BEGIN)[0], text.split(END)[1]
    readme.write_text(f"{head}{BEGIN}\n{_figures(rows, real, _demo())}\n{END}{tail}", encoding="utf-8")
    return 0


def _figures(rows: list[dict[str, Any]], real: str, demo: dict[str, Any]) -> str:
    judged = [row for row in rows if row["target"] is not None]
    met = sum(bool(row["ok"]) for row in judged)
    ten = next(segment for segment in demo["evaluation"]["segments"] if segment["length_m"] == 10.0)
    wheels = _value(rows, WALLS, "smooth, tachometer", ": 10 m")
    cloud = (ROOT / "evaluation" / "integration.md").read_text(encoding="utf-8")
    height = _cell(cloud, "largest error over the distance driven")
    exact, own, own_most = (
        _cell(cloud, row) for row in ("exact poses: median", "own odometry: median", "own odometry: p95")
    )
    return f"""\
**Simulated drifts, odometry alone** ([all figures](evaluation/odometry.md)): planar worlds with bends and a cross drift, 150 m
driven at 12 km/h, 25 scans a second, 381 beams over 190°, 12 mm range noise; three worlds that no setting was chosen on.
Mean error of translation over segments of 10 m, beside two peers in the same run:

| walls | lhdmap | KISS-ICP 1.3 on flat scans | point-to-line ICP on key scans |
| --- | --- | --- | --- |
| rough (12 cm rms) | **{_value(rows, DEFAULT, "12 km/h, 25 Hz, 381 beams: 10 m")}** | {_value(rows, PEERS, KISS, "rough")} \
| {_value(rows, PEERS, LINES, "rough")} |
| moderate (3 cm) | **{_value(rows, WALLS, "moderate: 10 m")}** | | |
| smooth (5 mm) | **{_value(rows, WALLS, "smooth: 10 m")}** | {_value(rows, PEERS, KISS, "smooth")} \
| {_value(rows, PEERS, LINES, "smooth")} |
| smooth, with a tachometer (1 % scale error, slipping wheels) | **{wheels}** | | |

The project set itself targets for {len(judged)} of these figures; it meets {met}. The table says which it misses, and by how much.

**The sample drive** of `make demo` is harder: 3D, uneven floor, grades, roll and pitch from an inclinometer with 0.1° of noise and
0.1 s of lag. There the error over segments of 10 m is {ten["translation_pct"]:.2f} % (mean of {ten["n"]}), that of the end
point {demo["evaluation"]["end_pct"]:.2f} % of the {demo["evaluation"]["distance_m"]:.0f} m driven.

![Path and errors of the sample drive against its truth](docs/img/comparison.png)

**Clouds** of such drives against the true surface ([table](evaluation/integration.md)): median distance {exact} with
exact poses; with its own odometry over 60 m {own} (95 %: {own_most}); height error up to {height} of the distance.

**Real logs** ([table and pictures](evaluation/real_logs.md)), default settings. Mean error of relations at most 60 s apart, for
CSAIL of steps between corrected key scans:

| log | wheels alone | lhdmap |
| --- | --- | --- |
""" + "\n".join(_log_row(real, key, name) for key, name in LOGS.items())


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


def _log_row(real: str, key: str, name: str) -> str:
    """Return the row of a log: n, wheels, scans, fused, ..."""
    found = re.search(rf"^\| {key} \| \d+ \| ([^|]*m, [^|]*°) \| [^|]* \| ([^|]*m, [^|]*°) \|", real, re.MULTILINE)
    if found is None:
        raise SystemExit(f"evaluation/real_logs.md has no row of errors for {key}")
    return f"| {name} | {found[1]} | **{found[2]}** |"


def _demo() -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "lhdmap", "demo", "--json", "--quiet", "-o", f"{folder}/demo"]
        found: dict[str, Any] = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return found


if __name__ == "__main__":
    sys.exit(main())
