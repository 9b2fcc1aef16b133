"""Guidance in a narrow bend with a machine other than its model: `python -m tools.evaluate.guidance_tolerance OUT.json`.

A bend of 60 degrees and 8 m radius, c 0.25 m, twice with other walls; and a straight at 4 m/s, how far off its middle.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

from tests.guidance.planar_drive import Errors, drive
from tests.guidance.test_drives import straight
from tests.guidance.tunnels import narrow

CASES = {
    "none": Errors(),
    "dead time 0.2 s longer": Errors(dead_s=0.2),
    "dead time 0.15 s shorter": Errors(dead_s=-0.15),
    "pose 5 cm, 0.5 degrees": Errors(jitter_m=0.05, jitter_rad=math.radians(0.5)),
    "joint +0.5 degrees": Errors(bend_offset_rad=math.radians(0.5)),
    "joint -0.5 degrees": Errors(bend_offset_rad=-math.radians(0.5)),
    "steering gain 0.85": Errors(gain=0.85),
    "steering gain 1.15": Errors(gain=1.15),
}
SEEDS = (4, 5)
STRAIGHT = "straight at 4 m/s, pose 1 cm, 0.1 degrees: off the middle"


def main() -> int:
    """Drive all; write least rooms."""
    noisy = Errors(jitter_m=0.01, jitter_rad=math.radians(0.1))
    out = drive(*straight(60.0, 1.0), limit_mps=4.0, errors=noisy)
    found = {STRAIGHT: [round(max(abs(float(one[1])) for one in out.states), 3)]}
    for name, errors in CASES.items():
        drives = [drive(*narrow(8.0, 60.0, 0.25, seed), errors=errors, begin_m=15.0) for seed in SEEDS]
        found[name] = [round(min(one.rooms_m), 3) if one.arrived else -1.0 for one in drives]
        print(name, found[name], flush=True)
    Path(sys.argv[1]).write_text(json.dumps(found, indent=1))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
