"""Draw a machine that drives itself, for docs/replay.md: a drive from one draw point to another, as the viewer shows it.

python -m tools.replay_picture [RUN]       # needs mesa-vulkan-drivers; RUN: a run that is there already
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

TARGET = Path(__file__).resolve().parents[1] / "docs" / "img" / "replay_autonomous.png"
SCENARIO = 'kind = "tram"\nmine = "level"\nseed = 5\nstart = "DP1"\ngoal = "DP3"\n'
WIDTH, COLOURS = 1100, 64
_PART = (0.0, 0.03, 1.0, 0.84)  # left, top, right and bottom of what is shown, as shares


def main(words: list[str]) -> int:
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        run = Path(words[0]) if words else _replayed(work)
        _lhdmap("view", str(run), "--screenshot", str(work / "viewer.png"))
        image = Image.open(work / "viewer.png").convert("RGB")
    left, top, right, bottom = _PART
    cut = image.crop((left * image.width, top * image.height, right * image.width, bottom * image.height))
    small = cut.resize((WIDTH, round(cut.height * WIDTH / cut.width)), Image.Resampling.LANCZOS)
    small.quantize(COLOURS).save(TARGET, optimize=True)
    return 0


def _replayed(work: Path) -> Path:
    (work / "tram.toml").write_text(SCENARIO, encoding="utf-8")
    _lhdmap("replay", str(work / "tram.toml"), "-o", str(work / "run"), "--quiet")
    return work / "run"


def _lhdmap(*words: str) -> None:
    subprocess.run([sys.executable, "-m", "lhdmap", *words], check=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
