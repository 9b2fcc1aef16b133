"""Draw the plans that ship as their worlds are: walls at 1.4 m over the floor, centre lines, names, the teaching drive.

And a route on the map of a teaching drive, by the commands that the README shows.

python -m tools.mine_pictures
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.mine.make_network import make_network
from lhdmap.mine.network import Network
from lhdmap.mine.plan import find_plan, load_plan
from lhdmap.mine.route import start_of
from lhdmap.mine.routes import RouteFinder
from lhdmap.mine.ways import legs_of
from lhdmap.simulation.mine_world.world import MineWorld

TARGET = Path(__file__).resolve().parents[1] / "docs" / "img" / "mines.png"
PLANS = ("ring", "level", "decline", "narrow")
_EVERY_M, _RAYS, _EYE_M, _REACH_M = 0.7, 720, 1.4, 12.0


def main() -> int:
    figure, axes = plt.subplots(2, 2, figsize=(14, 10), layout="constrained")
    for axis, name in zip(axes.ravel(), PLANS, strict=True):
        draw(axis, make_network(load_plan(find_plan(name))), Machine())
        axis.set_title(name)
    figure.savefig(TARGET, dpi=85)
    route_picture(TARGET.with_name("route.png"))
    return 0


def route_picture(target: Path) -> None:
    """Simulate the teaching drive of the level, build its map and draw a route on it."""
    with tempfile.TemporaryDirectory() as folder:
        log, built = f"{folder}/level.mcap", f"{folder}/level_map"
        for words in (
            ["simulate", "mine", "level", "--names", "-o", log],
            ["build-map", log, "-o", built],
            [
                "route",
                built,
                "DP1",
                "OP2",
                "--heading",
                "along",
                "--goal-heading",
                "along",
                "--picture",
                str(target),
                "--force",
            ],
        ):
            subprocess.run([sys.executable, "-m", "lhdmap", *words, "--quiet"], check=True)


def draw(axis: Any, network: Network, machine: Machine) -> None:
    """Draw one mine."""
    walls = _walls(MineWorld(network, machine))
    axis.scatter(*walls.T, s=0.15, c="0.25", linewidths=0, rasterized=True)
    start = start_of(network, machine, None)
    runs = RouteFinder(network, machine).teaching(start)
    pose = network.tubes[start.tube].pose(start.at_m, start.facing)
    for leg in legs_of(network, runs, machine, start=pose):
        axis.plot(leg.x_m, leg.y_m, color="tab:blue" if leg.gear > 0 else "tab:red", linewidth=0.8)
    for tube in network.tubes:
        if tube.kind != "turn":
            x, y = tube.pose(0.62 * tube.length_m)[:2]
            axis.annotate(tube.name, (x, y), fontsize=7, ha="center", color="tab:green")
    for node in network.nodes:
        if node.degree > 2:
            axis.annotate(node.name, node.position_m[:2], fontsize=7, ha="center", weight="bold")
    axis.set_aspect("equal")
    axis.set_xlabel("east, m")
    axis.set_ylabel("north, m")


def _walls(world: MineWorld) -> FloatArray:
    """Return where level rays from the centre lines meet something near, shape (N, 2)."""
    angles, found = np.linspace(0.0, 2 * np.pi, _RAYS, endpoint=False), []
    for tube in world.network.tubes:
        for s in np.arange(0.4, tube.length_m, _EVERY_M):
            eye = tube.pose(s)[:3]
            eye[2] = world.floor_height(eye[None])[0] + _EYE_M
            scene = world.near(eye)
            rays = np.zeros((_RAYS, 6), dtype=np.float32)
            rays[:, :3], rays[:, 3], rays[:, 4] = eye - scene.origin_m, np.cos(angles), np.sin(angles)
            ranges = scene.cast(rays).astype(float)
            near = ranges < _REACH_M
            found.append(eye[:2] + ranges[near, None] * np.stack([np.cos(angles[near]), np.sin(angles[near])], axis=1))
    return np.concatenate(found)


if __name__ == "__main__":
    raise SystemExit(main())
