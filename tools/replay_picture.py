"""Draw a machine that drives itself, for docs/replay.md: a drive to a draw point, as the viewer shows it.

python -m tools.replay_picture [RUN]       # needs mesa-vulkan-drivers; RUN: a run that is there already
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

TARGET = Path(__file__).resolve().parents[1] / "docs" / "img" / "replay_autonomous.png"
SCENARIO = 'kind = "tram"\nmine = "level"\nseed = 5\ngoal = "DP3"\n'
WIDTH, COLOURS = 1000, 256
_VIEWS, _CURVES = (0.0, 0.03, 0.665, 0.97), (0.667, 0.3, 1.0, 0.97)
"""What is shown: left, top, right, bottom as shares. Notes of the viewer are above the curves."""


def main(words: list[str]) -> int:
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        run = Path(words[0]) if words else _replayed(work)
        _lhdmap("view", str(run), "--screenshot", str(work / "viewer.png"))
        image = Image.open(work / "viewer.png").convert("RGB")
    views, curves = (_cut(image, part) for part in (_VIEWS, _CURVES))
    whole = Image.new("RGB", (views.width + curves.width, views.height), views.getpixel((4, 4)))
    whole.paste(views, (0, 0))
    whole.paste(curves, (views.width, 0))
    small = whole.resize((WIDTH, round(whole.height * WIDTH / whole.width)), Image.Resampling.LANCZOS)
    small.quantize(COLOURS, method=Image.Quantize.FASTOCTREE).save(TARGET, optimize=True)
    return 0


def _cut(image: Image.Image, part: tuple[float, float, float, float]) -> Image.Image:
    left, top, right, bottom = part
    return image.crop((left * image.width, top * image.height, right * image.width, bottom * image.height))


def _replayed(work: Path) -> Path:
    (work / "tram.toml").write_text(SCENARIO, encoding="utf-8")
    _lhdmap("replay", str(work / "tram.toml"), "-o", str(work / "run"), "--quiet")
    return work / "run"


def _lhdmap(*words: str) -> None:
    subprocess.run([sys.executable, "-m", "lhdmap", *words], check=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
