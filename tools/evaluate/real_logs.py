"""Every real log of `../shared/data` through `doctor` and `build-map`: the table `evaluation/real_logs.md`, and pictures.

python -m tools.evaluate.real_logs [--data FOLDER] [--only NAME ...]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from lhdmap.evaluation.sources import load_estimate

from tools.evaluate import references
from tools.evaluate.pictures import top_view

ROOT = Path(__file__).resolve().parents[2]
RESULT = ROOT / "evaluation" / "real_logs.md"
PICTURES = ROOT / "evaluation" / "img"


@dataclass(frozen=True, slots=True)
class RealLog:
    """A log, its reference where there is one, and the targets (translation m, rotation °)."""

    name: str
    path: str
    reference: str = ""
    targets: tuple[float | None, float | None] = (None, None)
    picture: bool = False


LOGS = (
    RealLog("intel", "01_carmen_intel/intel.clf.bz2", "01_carmen_intel/intel.relations", (0.025, 0.32), True),
    RealLog("aces", "02_carmen_aces/aces.clf.bz2", "02_carmen_aces/aces.relations", (None, 0.35)),
    RealLog("aces_mcap", "02_carmen_aces/aces.mcap", "02_carmen_aces/aces.relations", (None, 0.35), True),
    RealLog("csail", "03_carmen_csail/mit-csail.clf.bz2", "03_carmen_csail/mit-csail.graph.log", (0.030, 0.5), True),
    RealLog("fr_clinic", "04_carmen_fr_clinic/fr-clinic_robotlaser.clf.bz2", picture=True),
    RealLog("ual", "05_ual_vehicle/ual_2014_05_23.mcap", picture=True),
    RealLog("scans_demo", "07_bags/scans_demo.bag"),
    RealLog("ccny_bag", "07_bags/ccny_demo.bag"),
    RealLog("ccny", "07_bags/ccny_handheld_demo.mcap"),
    RealLog("mines_rover", "15_breezyslam/exp2.dat"),
)

HEADING = """\
# Real logs

Written by `python -m tools.evaluate.real_logs`; not edited by hand. Each log goes through `lhdmap doctor` and `lhdmap build-map`
with default settings. "× real time" and memory are those that `build-map --json` reports (start-up, cloud, report and recording
included; one process, a machine that other work shared).
"""
SCORED = """\

## Against references

Relations at most 60 s apart (Intel, ACES: Freiburg benchmark), steps between corrected key scans (CSAIL); means. The translation
truth of ACES, and of part of Intel, was set by hand starting from the wheels: there the wheels score too well. ACES is
scored twice, from CARMEN and from MCAP.

| log | n | wheels alone | scans alone | **fused (build-map)** | target | ok |
| --- | --- | --- | --- | --- | --- | --- |
"""


def main(words: list[str] | None = None) -> int:
    """Run all logs, write table and pictures; 1 where a target is missed or a log fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared" / "data", help="folder of the recordings")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these logs alone; nothing is written")
    options = parser.parse_args(words)
    rows, scores, good = [], [], True
    with tempfile.TemporaryDirectory() as folder:
        for log in LOGS:
            if options.only and log.name not in options.only:
                continue
            built = _build(options.data / log.path, Path(folder) / log.name)
            rows.append(_row(log, _doctor(options.data / log.path), built))
            good &= built is not None and built["lost_stretches"] == 0
            print(rows[-1], flush=True)
            if built is not None and log.reference:
                scores.append(_score(log, options.data, Path(built["map"])))
                good &= not scores[-1].endswith("**no** |")
                print(scores[-1], flush=True)
            if built is not None and log.picture:
                _picture(Path(built["map"]), PICTURES / f"{log.name}.png")
    if not options.only:
        RESULT.parent.mkdir(exist_ok=True)
        RESULT.write_text(
            "\n".join([HEADING, *_columns(), *rows]) + "\n" + SCORED + "\n".join(scores) + "\n" + _shown()
        )
    return 0 if good else 1


def _columns() -> Iterator[str]:
    yield "| log | doctor | scans | processed | duration s | distance m | weak | lost | × real time | MiB |"
    yield "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"


def _shown() -> str:
    names = [log.name for log in LOGS if log.picture]
    return (
        "\n## Maps from above\n\nRed: the machine's path; green bar: 10 m.\n\n"
        + "\n".join(f"![{name}](img/{name}.png)" for name in names)
        + "\n"
    )


def _lhdmap(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(Path(sys.executable).with_name("lhdmap")), *words], capture_output=True, text=True, check=False
    )


def _doctor(log: Path) -> str:
    done = _lhdmap("doctor", str(log), "--json")
    try:
        return str(_verdict(json.loads(done.stdout)))
    except (json.JSONDecodeError, KeyError, IndexError):
        return f"exit {done.returncode}"


def _verdict(answer: dict[str, Any]) -> str:
    first = answer["logs"][0] if "logs" in answer else answer
    counts = [f["severity"] for f in first.get("findings", [])]
    words = [f"{counts.count(kind)} {kind}(s)" for kind in ("fatal", "problem", "remark") if kind in counts]
    return ", ".join([str(first["verdict"]), *words])


def _build(log: Path, target: Path) -> dict[str, Any] | None:
    done = _lhdmap("build-map", str(log), "-o", str(target), "--json", "--quiet")
    if done.returncode != 0:
        print(done.stderr[-500:], file=sys.stderr)
        return None
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def _row(log: RealLog, verdict: str, built: dict[str, Any] | None) -> str:
    if built is None:
        return f"| {log.name} | {verdict} | **build-map failed** | | | | | | | |"
    return (
        f"| {log.name} | {verdict} | {built['scans']} | {built['scans_processed']} | {built['duration_s']:.0f} | "
        f"{built['distance_m']:.0f} | {100 * built['degenerate_share']:.0f} % | {built['lost_stretches']} | "
        f"{built['realtime_factor']:.0f} | {built['peak_memory_mib']:.0f} |"
    )


def _score(log: RealLog, data: Path, folder: Path) -> str:
    reference = data / log.reference
    score = references.SCORES[reference.suffix]
    fused = score(load_estimate(folder), reference)
    scans = score(references.scans_alone(data / log.path), reference)
    wheels = references.wheels_alone(data / log.path)
    beside = score(wheels, reference) if wheels else None
    wanted = [f"≤ {t:g} {unit}" for t, unit in zip(log.targets, ("m", "°"), strict=True) if t is not None]
    ok = all(t is None or value <= t for t, value in zip(log.targets, fused[:2], strict=True))
    cells = [_cell(beside), _cell(scans), _cell(fused), ", ".join(wanted), "yes" if ok else "**no**"]
    return f"| {log.name} | {fused.n} | " + " | ".join(cells) + " |"


def _cell(score: references.Score | None) -> str:
    return "–" if score is None else f"{score.translation_m:.4f} m, {score.rotation_deg:.3f}°"


def _picture(folder: Path, target: Path) -> None:
    from lhdmap.integration.cloud_io import read_cloud

    cloud = read_cloud(folder / "cloud.ply")
    top_view(cloud.points_m.astype(float), load_estimate(folder).positions_m, target)


if __name__ == "__main__":
    sys.exit(main())
