"""The optimiser: gradient against finite differences, bounds, and the same answer as another optimiser's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.driving.lead import lead_of
from lhdmap.guidance.cost import Expansion, Vehicle
from lhdmap.guidance.directive import path_of
from lhdmap.guidance.field import Field, field_around
from lhdmap.guidance.outline import outline_of
from lhdmap.guidance.planner import weights_of
from lhdmap.guidance.settings import GuidanceSettings
from lhdmap.guidance.solver import Problem, expanded, rolled, solve
from lhdmap.messages import FloatArray
from scipy.optimize import minimize

from tests.guidance.tunnels import BODIES, MODEL, narrow

SETTINGS = GuidanceSettings()
COUNT, STEP = SETTINGS.stages, SETTINGS.stage_s
LEAD = lead_of(1, MODEL, BODIES)
OUTLINE = outline_of(LEAD)
WEIGHTS = weights_of(SETTINGS, len(OUTLINE.leading) + len(OUTLINE.trailing))
VEHICLE = Vehicle(LEAD.lead_m, LEAD.trail_m, MODEL.steering_lag_s, MODEL.max_articulation_rad)


def problem_of(seed: int, c_m: float = 0.4) -> tuple[Problem, Field]:
    """The machine before a bend, a little off the line."""
    rng = np.random.default_rng(seed)
    line, walls = narrow(8.0, 60.0, c_m, seed)
    path = path_of(line, 2.5)
    start = np.array(
        [line[200, 0], line[200, 1] + rng.normal(0.0, 0.1), rng.normal(0.0, 0.03), rng.normal(0, 0.05), 0.0]
    )
    at = int(np.hypot(path[:, 0] - start[0], path[:, 1] - start[1]).argmin())
    problem = Problem(start, np.full(COUNT, 1.8), 0.0, math.radians(12.0), STEP, path, at)
    way = line[200:290:3]
    return problem, field_around(walls, np.vstack([way[:1] - [4.0, 0.0], way]))


def cost_of(rates: FloatArray, problem: Problem, field: Field) -> Expansion:
    states = rolled(problem.start, rates, problem.speed, problem.step_s, VEHICLE)
    return expanded(problem, rates, states, VEHICLE, WEIGHTS, OUTLINE, field)


@pytest.mark.parametrize("seed", range(3))
def test_the_gradient_is_that_of_finite_differences(seed: int) -> None:
    problem, field = problem_of(seed)
    begun = solve(problem, np.zeros(COUNT), VEHICLE, WEIGHTS, OUTLINE, field, 20).rates
    rates = begun + np.random.default_rng(seed + 50).normal(0.0, 0.01, COUNT)  # a drive that crosses no wall
    told = 2.0 * cost_of(rates, problem, field).g
    measured = np.empty(COUNT)
    for k in range(COUNT):
        step = 1e-5 * np.eye(COUNT)[k]
        measured[k] = (cost_of(rates + step, problem, field).cost - cost_of(rates - step, problem, field).cost) / 2e-5
    assert np.linalg.norm(told - measured) < 1e-5 * np.linalg.norm(measured)


@pytest.mark.parametrize("seed", range(3))
def test_the_hessian_is_symmetric_and_positive(seed: int) -> None:
    problem, field = problem_of(seed)
    H = cost_of(np.zeros(COUNT), problem, field).H
    assert np.allclose(H, H.T)
    assert np.linalg.eigvalsh(H).min() > 0.0


@pytest.mark.parametrize("seed", range(6))
def test_rates_stay_within_bounds_and_the_cost_does_not_grow(seed: int) -> None:
    problem, field = problem_of(seed, 0.1)
    tight = problem._replace(limit=math.radians(4.0))
    guess = np.random.default_rng(seed).normal(0.0, 0.2, COUNT)
    found = solve(tight, guess, VEHICLE, WEIGHTS, OUTLINE, field, 6)
    assert np.abs(found.rates).max() <= tight.limit + 1e-12
    assert found.cost <= cost_of(np.clip(guess, -tight.limit, tight.limit), tight, field).cost


@pytest.mark.parametrize("seed", range(4))
def test_another_optimiser_gives_the_same_first_command(seed: int) -> None:
    problem, field = problem_of(seed)

    def objective(rates: FloatArray) -> tuple[float, FloatArray]:
        found = cost_of(rates, problem, field)
        return found.cost, 2.0 * found.g

    bounds = [(-problem.limit, problem.limit)] * COUNT
    begun = solve(problem, np.zeros(COUNT), VEHICLE, WEIGHTS, OUTLINE, field, 30)
    other = minimize(objective, np.zeros(COUNT), jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 500})
    assert begun.cost <= other.fun * 1.01
    assert math.degrees(abs(begun.rates[0] - other.x[0])) < 0.5
