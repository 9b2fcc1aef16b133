"""Make the pictures of README.md and docs anew from runs of the program: the sample drive, a cycle, and a plan to a rock.

    python -m tools.pictures            # needs chromium and mesa-vulkan-drivers

The report is photographed by a browser without a window, the recording by the viewer itself.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

TARGET = Path(__file__).resolve().parents[1] / "docs" / "img"
PAGE_WIDTH, PAGE_HEIGHT = 1200, 2600
WIDTH = 1200
BROWSER = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
           "--disable-component-update", "--disable-sync", "--disable-quic", "--hide-scrollbars"]  # fmt: skip


def main() -> int:
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        print("no chromium on this machine: apt-get install chromium mesa-vulkan-drivers", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        _lhdmap("demo", "--quiet", "-o", str(work / "demo"))
        _lhdmap("view", str(work / "demo" / "drive_map"), "--screenshot", str(work / "viewer.png"))
        options = [*BROWSER, f"--user-data-dir={work / 'profile'}", f"--window-size={PAGE_WIDTH},{PAGE_HEIGHT}"]
        page = (work / "demo" / "drive_map" / "report.html").as_uri()
        subprocess.run([browser, *options, f"--screenshot={work / 'page.png'}", page], check=True, capture_output=True)
        _save(work / "viewer.png", (0.0, 0.03, 0.665, 0.97), "recording.png")
        _save(work / "page.png", (0.075, 0.0, 0.93, 0.415), "report.png")
        _save(work / "page.png", (0.075, 0.53, 0.93, 0.835), "cloud.png")
        shutil.copy(work / "demo" / "evaluation.png", TARGET / "comparison.png")
        _save(work / "demo" / "cycle" / "mission.png", (0.0, 0.0, 1.0, 1.0), "cycle.png")
        _rockbreaker(work)
    return 0


def _rockbreaker(work: Path) -> None:
    _lhdmap("simulate", "grizzly", "--seed", "3", "-o", str(work / "grizzly.ply"))
    words = ("--cloud", str(work / "grizzly.ply"), "--timing", "smooth", "-o", str(work / "plan"))
    _lhdmap("rockbreaker", "plan", *words)
    _lhdmap("view", str(work / "plan" / "recording.rrd"), "--screenshot", str(work / "plan.png"))
    _save(work / "plan.png", (0.0, 0.03, 0.665, 0.6), "rockbreaker.png")


def _lhdmap(*words: str) -> None:
    subprocess.run([sys.executable, "-m", "lhdmap", *words], check=True)


def _save(source: Path, part: tuple[float, float, float, float], name: str) -> None:
    """Save a part (left, top, right, bottom as shares) of a picture, at most `WIDTH` pixels wide."""
    image = Image.open(source).convert("RGB")
    scale = (image.width, image.height, image.width, image.height)
    left, top, right, bottom = (round(share * size) for share, size in zip(part, scale, strict=True))
    cut = image.crop((left, top, right, bottom))
    if cut.width > WIDTH:
        cut = cut.resize((WIDTH, round(cut.height * WIDTH / cut.width)), Image.Resampling.LANCZOS)
    cut.save(TARGET / name, optimize=True)


if __name__ == "__main__":
    sys.exit(main())
