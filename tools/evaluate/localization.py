"""Localization on maps of our own, against the truth: tables of tracking, faults and real logs in `evaluation/localization.md`.

python -m tools.evaluate.localization tracking [--seeds 10] [--folder MAPS]
python -m tools.evaluate.localization faults --logs FOLDER
python -m tools.evaluate.localization real [--data FOLDER]

Each prints its section; `--write` puts it into the page, in the place of the section of that name.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from tools.evaluate.localization_drives import CLASSES, LENGTH_M, WAYS, localized, second, taught
from tools.evaluate.localization_page import RESULT, replaced

METHODS = ("surface", "paper")
_PAPER_WORLDS = 4
_COLUMNS = (
    "walls", "method", "runs", "along RMSE ± sd (worst), max", "across RMSE, max", "heading RMSE, max",
    "NEES along / across / heading", "along within 2 σ, mean (worst run)", "ms a scan, median, 99 %",
)  # fmt: skip
_TRACKING = """\
Planar tunnels of {length:g} m, {seeds} worlds a class (the paper's method: the first {paper}), each taught at 2 m/s and driven
through at 3.6 m/s in the same direction, in the other one, and in reverse gear, 0.1 to 0.5 m beside the middle, weaving 0.15 m.
Articulated machine, two level scanners (190°, 0.5°, 12 mm, 10 Hz); tachometer 1 % too fast, 0.03 m/s of noise, on second drives
slip by 30 to 100 % for 0.5 to 2 s each 8 to 25 s. The map is that of `build-map` from the teaching drive's log. Errors
against the map; start known to 0.1 m, the first 5 m are left out. Rough and moderate: every second world has bends and niches.
Times on a machine that other work shared.
"""


def tracking(seeds: range, folder: Path, methods: tuple[str, ...], classes: tuple[str, ...]) -> Iterator[str]:
    """Yield the lines of the section of planar tunnels."""
    yield _TRACKING.format(length=LENGTH_M, seeds=len(seeds), paper=min(_PAPER_WORLDS, len(seeds)))
    yield f"| {' | '.join(_COLUMNS)} |"
    yield "|" + " --- |" * len(_COLUMNS)
    for name in classes:
        found: dict[str, list[dict[str, Any]]] = {method: [] for method in methods}
        for seed in seeds:
            place = taught(name, seed, folder)
            for way in WAYS:
                done = second(place, seed, way)
                for method in methods:
                    if method == "paper" and seed >= seeds[0] + _PAPER_WORLDS:
                        continue
                    found[method].append(localized(place, done, method).figures)
                    print(name, seed, way, method, _short(found[method][-1]), file=sys.stderr, flush=True)
        for method in methods:
            yield _row(name, method, found[method])


def _short(figures: dict[str, Any]) -> str:
    along = figures["along_m"]
    return f"{1e3 * along['rmse']:.1f} {1e3 * along['max']:.1f} mm, {figures['within_2_sigma']['along']:.2f}"


def _row(name: str, method: str, runs: list[dict[str, Any]]) -> str:
    along = np.array([run["along_m"]["rmse"] for run in runs])
    most = {key: max(run[key]["max"] for run in runs) for key in ("along_m", "across_m", "heading_deg")}
    rmse = {key: np.mean([run[key]["rmse"] for run in runs]) for key in ("across_m", "heading_deg")}
    nees = [np.mean([run["nees"][key] for run in runs]) for key in ("along", "across", "heading")]
    inside = np.array([run["within_2_sigma"]["along"] for run in runs])
    ms = [np.mean([run["latency_ms"][key] for run in runs]) for key in ("median", "p99")]
    cells = (
        name,
        method,
        str(len(runs)),
        f"{_mm(along.mean())} ± {_mm(along.std())} ({_mm(along.max())}), {_mm(most['along_m'])}",
        f"{_mm(rmse['across_m'])}, {_mm(most['across_m'])}",
        f"{rmse['heading_deg']:.3f}, {most['heading_deg']:.2f}°",
        " / ".join(f"{value:.2f}" if value < 100.0 else "> 100" for value in nees),
        f"{100 * inside.mean():.0f} % ({100 * inside.min():.0f} %)",
        f"{ms[0]:.1f}, {ms[1]:.1f}",
    )
    return f"| {' | '.join(cells)} |"


def _mm(value: float) -> str:
    return f"{1e3 * value:.1f} mm" if value < 1.0 else f"{value:.1f} m"


def main(words: list[str] | None = None) -> int:
    """Measure what is asked for; print it, and write it where that is wanted."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("tracking", "faults", "real"))
    parser.add_argument("--seeds", type=int, nargs="+", default=[10], help="how many worlds, or from which to which")
    parser.add_argument("--methods", nargs="+", default=METHODS, choices=METHODS)
    parser.add_argument("--walls", nargs="+", default=tuple(CLASSES), choices=tuple(CLASSES))
    parser.add_argument("--folder", type=Path, help="where the maps of planar tunnels are kept, or the logs of mines")
    parser.add_argument("--data", type=Path, default=RESULT.parents[2] / "shared" / "data", help="the real logs")
    parser.add_argument("--write", action="store_true", help=f"into {RESULT.name}")
    options = parser.parse_args(words)
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        title, lines = _section(options, folder)
        printed = []
        for line in lines:
            print(line, flush=True)
            printed.append(line)
    if options.write:
        replaced(title, printed)
    return 0


def _section(options: argparse.Namespace, folder: Path) -> tuple[str, Iterator[str]]:
    if options.what == "tracking":
        first, last = (1, options.seeds[0]) if len(options.seeds) == 1 else options.seeds[:2]
        return "Tracking", tracking(range(first, last + 1), folder, tuple(options.methods), tuple(options.walls))
    if options.what == "faults":
        from tools.evaluate.localization_faults import faults

        return "Faults", faults(folder)
    from tools.evaluate.localization_real import real

    return "Real logs", real(options.data, folder)


if __name__ == "__main__":
    sys.exit(main())
