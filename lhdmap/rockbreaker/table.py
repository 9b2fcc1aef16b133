"""The sampled trajectory as a table: one row a time, from start to end, for one step after another."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.flow import flows_m3ps
from lhdmap.rockbreaker.paths import cylinders
from lhdmap.rockbreaker.plan import Trajectory

COLUMNS = (
    *("t_s", "sigma", "sigma_dot", "theta1_deg", "theta2_deg", "theta3_deg", "theta4_deg"),
    *("rho0_m", "rho1_m", "rho2_m", "rho3_m", "rho4_m", "x_m", "y_m", "z_m", "phi_deg", "q1", "q2", "q3", "q4", "qp"),
    *("q1_l_per_min", "q2_l_per_min", "q3_l_per_min", "q4_l_per_min", "qp_l_per_min"),
)
UNITS = {
    "t_s": "s, since the start of the first step",
    "sigma": "1, share of the path of this step",
    "sigma_dot": "1/s, its rate",
    **{f"theta{j}_deg": f"deg, joint {j}" for j in range(1, 5)},
    **{f"rho{j}_m": f"m, length of cylinder {j}" for j in range(5)},
    **{f"{axis}_m": f"m, {axis} of the tip, frame base" for axis in "xyz"},
    "phi_deg": "deg, orientation of the breaker, 270 is upright",
    **{f"q{j}": f"1, flow through valve {j} over its limit" for j in range(1, 5)},
    "qp": "1, flow of the pump over its limit",
    **{f"q{j}_l_per_min": f"L/min, flow through valve {j}" for j in range(1, 5)},
    "qp_l_per_min": "L/min, flow of the pump",
}
"""Unit and meaning of each column."""
_DIGITS = 9
_L_PER_MIN = 60_000.0  # 1 m³/s


def sampled(trajectory: Trajectory, rate_hz: float) -> FloatArray:
    """Return the rows (N, 26) in the order of `COLUMNS`, `rate_hz` of them a second and the end."""
    path, law = trajectory.path, trajectory.law
    machine, duration_s = path.machine, law.duration_s
    t = np.append(np.arange(0.0, duration_s, 1.0 / rate_hz), duration_s)
    sigma, rate = law(t)
    theta, theta_rate = path.motion(sigma)
    rho, rho_rate = cylinders(machine, theta, theta_rate)
    flows = flows_m3ps(machine, rho_rate) * rate[:, None]
    shares, litres = flows / machine.flow_limits_m3ps, _L_PER_MIN * flows
    phi_deg = np.degrees(path.turning(sigma)[0]) % 360.0
    return np.column_stack([t, sigma, rate, np.degrees(theta), rho, path.tip(sigma), phi_deg, shares, litres])


def joined(tables: Sequence[FloatArray]) -> FloatArray:
    """Return the rows of one step after another, time going on."""
    rows, begun_s = [], 0.0
    for table in tables:
        rows.append(table + np.where(np.arange(table.shape[1]) == 0, begun_s, 0.0))
        begun_s = float(rows[-1][-1, 0])
    return np.concatenate(rows)


def write_table(path: Path, rows: FloatArray) -> None:
    """Write rows as CSV with a header."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows(np.round(rows, _DIGITS).tolist())
