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
)
_DIGITS = 9


def sampled(trajectory: Trajectory, rate_hz: float) -> FloatArray:
    """Return the rows (N, 21) in the order of `COLUMNS`, `rate_hz` of them a second and the end; flows over their limits."""
    path, law = trajectory.path, trajectory.law
    machine, duration_s = path.machine, law.duration_s
    t = np.append(np.arange(0.0, duration_s, 1.0 / rate_hz), duration_s)
    sigma, rate = law(t)
    theta, theta_rate = path.motion(sigma)
    rho, rho_rate = cylinders(machine, theta, theta_rate)
    flows = flows_m3ps(machine, rho_rate) * rate[:, None] / machine.flow_limits_m3ps
    phi_deg = np.degrees(path.turning(sigma)[0]) % 360.0
    return np.column_stack([t, sigma, rate, np.degrees(theta), rho, path.tip(sigma), phi_deg, flows])


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
