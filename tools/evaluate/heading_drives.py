"""Long drives through one tunnel with bends and grades that never comes back, simulated once and kept as logs.

The gyroscope in them is perfect: what is wrong with one is added when a drive is read (`heading`), so that one simulation serves
all of them. Scanners at 12.5 Hz: the odometry looks at a scan each 8 cm of travel only, at twice that rate, too.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
from lhdmap.machine import Machine
from lhdmap.mine.make_network import make_network
from lhdmap.mine.plan import DriftPlan, MinePlan, WallPlan
from lhdmap.simulation.mine_drive import MineDriveSettings, simulate_mine
from lhdmap.simulation.operator import OperatorSettings
from lhdmap.simulation.sensing.sections import ImuSettings, ScannerSettings, SensorSettings

RATE_HZ = 12.5
LENGTH_M = 1520.0
_SPEED_KMH = 12.0
_ROUGHNESS_M = (0.12, 0.15, 0.08, 0.2, 0.12)
_MOST_OFF_RAD = math.radians(55.0)  # of the tunnel's main direction: it never comes back
_GYRO = ImuSettings(gyro=True, gyro_noise_dps=0.0, gyro_bias_dps=0.0, gyro_walk_dps=0.0)


def tunnel(seed: int, length_m: float = LENGTH_M) -> MinePlan:
    """Return a plan of one tunnel: straights of 30 to 110 m, bends between them, grades up to 8 %."""
    rng = np.random.default_rng([seed, 91])
    drift = DriftPlan("T1", _line(rng, length_m), bend_radius_m=float(rng.uniform(14.0, 25.0)))
    walls = WallPlan(roughness_m=_ROUGHNESS_M[seed % len(_ROUGHNESS_M)])
    return MinePlan(name=f"tunnel{seed}", seed=500 + seed, walls=walls, drifts=(drift,))


def _line(rng: np.random.Generator, length_m: float) -> tuple[tuple[float, float, float], ...]:
    points, heading, way_m = [(0.0, 0.0, 0.0)], 0.0, 0.0
    while way_m < length_m:
        step_m = min(float(rng.uniform(30.0, 110.0)), max(length_m - way_m, 30.0))
        x, y, z = points[-1]
        rise_m = step_m * float(rng.uniform(-0.08, 0.08))
        points.append((x + step_m * math.cos(heading), y + step_m * math.sin(heading), z + rise_m))
        heading = float(
            np.clip(heading + rng.choice([-1.0, 1.0]) * rng.uniform(0.15, 0.95), -_MOST_OFF_RAD, _MOST_OFF_RAD)
        )
        way_m += step_m
    return tuple(points)


def drive_of(seed: int, folder: Path, length_m: float = LENGTH_M) -> Path:
    """Return the log of a drive, simulated where the folder does not have it."""
    log = folder / f"tunnel{seed}_{length_m:.0f}m.mcap"
    if not log.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        sensors = SensorSettings(scanner=ScannerSettings(rate_hz=RATE_HZ, max_range_m=60.0), imu=_GYRO)
        operator = OperatorSettings(speed_kmh=_SPEED_KMH, wander_m=0.15)
        settings = MineDriveSettings(seed=seed, sensors=sensors, operator=operator, route="T1")
        simulate_mine(make_network(tunnel(seed, length_m)), Machine(), settings, log)
    return log


def main() -> None:
    """Simulate drives."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--drives", type=int, default=10)
    parser.add_argument("--first", type=int, default=1)
    options = parser.parse_args()
    for seed in range(options.first, options.first + options.drives):
        print(drive_of(seed, options.folder), flush=True)


if __name__ == "__main__":
    main()
