"""Whether what the planar odometry says of its own error is true: steps of 1, 10 and 100 m, and the ends of 100 drives and more.

python -m tools.evaluate.trust [--seeds N ...] [--space N ...]
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from lhdmap.evaluation.planar_segments import planar_segments
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray

from tools.evaluate.trust_drives import COURSES, WALLS, Driven, Sensors, in_space, planar

RESULT = Path(__file__).resolve().parents[2] / "evaluation" / "trust.md"
# Worlds that nothing was chosen on: constants on 201 to 208 and 411 to 415, in space on 301 to 310 and 461 to 466; when the error
# counts as a lower bound on 401 to 404, in space 451 to 456.
SEEDS = (421, 422, 423, 424)
SPACE_SEEDS = (471, 472, 473, 474, 475, 476)
LENGTHS_M = (1.0, 10.0, 100.0)
MACHINES = [
    Sensors(True, True, True),
    Sensors(False, True, True),
    Sensors(False, False, True),
    Sensors(False, False, False),
]
HEADING = """\
# Trust: is the stated error true?

Written by `python -m tools.evaluate.trust`; not edited by hand. Worlds that no constant was chosen on: {seeds} (planar, 12 km/h,
25 Hz) and {space} (in space, 90 m, scanners tilted by 2.5°, inclinometer with 0.1° of noise and a bias of 0.03°, one sigma).

## Steps

Errors of all steps of a length over their stated standard deviation, each half metre: root mean square (1 where true), and in
brackets how many of 100 are within two deviations (95 where true). Steps of 100 m overlap: few of them are independent.

| walls, course | m | along | across | heading |
| --- | --- | --- | --- | --- |
"""
ENDS = """\

## Ends of drives

How many of the drives end within what `expected_error` says (95 of 100 where true).

| walls, machine | drives | end | heading | height | error, median | stated, median | lower bound |
| --- | --- | --- | --- | --- | --- | --- | --- |
"""


class Case(NamedTuple):
    """Drives of one row: planar ones on a course, or in space."""

    walls: str
    course: str
    wheels: bool
    seed: int


class Ended(NamedTuple):
    """How one drive ended: name of its row, error and expected error, each as (m, °, height m or NaN), lower bound."""

    name: str
    error: FloatArray
    expected: FloatArray
    lower_bound: bool


class Measured(NamedTuple):
    """What one case gave: errors over deviations by length, each (M, 3), and the ends."""

    name: str
    ratios: dict[float, FloatArray]
    ends: list[Ended]


def measure(case: Case) -> Measured:
    """Drive a case; in space all machines drive it."""
    if case.course == "space":
        found = in_space(case.walls, case.seed, MACHINES)
        ends = [_ended(f"{case.walls}, in space: {machine}", one) for machine, one in zip(MACHINES, found, strict=True)]
        return Measured("", {}, ends)
    driven = planar(case.walls, case.course, case.seed, wheels=case.wheels)
    walls = f"{case.walls}, tachometer" if case.wheels else case.walls
    return Measured(
        f"{walls}: {case.course}", {m: ratios(driven, m) for m in LENGTHS_M}, [_ended(f"{walls}, planar", driven)]
    )


def ratios(driven: Driven, length_m: float) -> FloatArray:
    """Return the errors (M, 3) of all steps of a length over their stated standard deviations."""
    found = planar_segments(driven.estimate, driven.truth, length_m)
    from_start = _WayErrors(driven)
    stated = [from_start.variances(int(first), int(last)) for first, last in found.spans]
    return np.asarray(found.vectors / np.sqrt(np.array(stated)), dtype=np.float64)


class _WayErrors:
    """Errors of the steps of a drive carried to its start and summed up: that of any stretch is a difference."""

    def __init__(self, driven: Driven) -> None:
        self._errors = [step.error for step in driven.steps]
        self._carry = [se2.adjoint(pose) for pose in driven.estimate]
        carried = zip(self._carry, self._errors, strict=True)
        walks, pulls = zip(*((A @ error.walk @ A.T, A @ error.pull) for A, error in carried), strict=True)
        self._walks, self._pulls = np.cumsum(walks, axis=0), np.cumsum(pulls, axis=0)

    def variances(self, first: int, last: int) -> FloatArray:
        """Return the variances (3,) of the measured way from one scan to another, in the axes of its end."""
        back = np.linalg.inv(self._carry[last])
        pull = back @ (self._pulls[last] - self._pulls[first])
        before = back @ self._carry[first] @ self._errors[first].jitter @ self._carry[first].T @ back.T
        total = back @ (self._walks[last] - self._walks[first]) @ back.T + np.outer(pull, pull) + before
        variances: FloatArray = np.diag(total + self._errors[last].jitter)
        return variances


def _ended(name: str, driven: Driven) -> Ended:
    m, deg, height_m = driven.end
    said = driven.expected
    error = np.array([m, deg, np.nan if height_m is None else abs(height_m)])
    expected = np.array([said.end_m, said.heading_deg, np.nan if said.height_m is None else said.height_m])
    return Ended(name, error, expected, said.lower_bound)


def step_rows(measured: Sequence[Measured]) -> Iterator[str]:
    """Yield the rows of the steps: each class and course, then each class."""
    names = list(dict.fromkeys(one.name for one in measured if one.name))
    groups = [(name, [name]) for name in names]
    classes = dict.fromkeys(name.split(":")[0] for name in names)
    groups += [(f"**{kind}**", [name for name in names if name.split(":")[0] == kind]) for kind in classes]
    for title, members in groups:
        for length_m in LENGTHS_M:
            found = np.concatenate([one.ratios[length_m] for one in measured if one.name in members])
            cells = (
                f"{r:.2f} ({100 * s:.0f})" for r, s in zip(_rms(found), (np.abs(found) < 2.0).mean(axis=0), strict=True)
            )
            yield f"| {title} | {length_m:g} | " + " | ".join(cells) + " |"


def _rms(values: FloatArray) -> FloatArray:
    rms: FloatArray = np.sqrt((values**2).mean(axis=0))
    return rms


def end_rows(ends: Sequence[Ended]) -> Iterator[str]:
    """Yield the rows of the ends: each class, then all."""
    names = list(dict.fromkeys(one.name for one in ends))
    groups = [(name, [one for one in ends if one.name == name]) for name in names]
    groups += [
        ("**all that are no lower bound**", [one for one in ends if not one.lower_bound]),
        ("**lower bounds**", [one for one in ends if one.lower_bound]),
        ("**all**", list(ends)),
    ]
    for title, chosen in groups:
        if not chosen:
            continue
        error, expected = np.array([one.error for one in chosen]), np.array([one.expected for one in chosen])
        inside = [_inside(error[:, axis], expected[:, axis]) for axis in range(3)]
        m = f"{np.median(error[:, 0]):.3f} m", f"{np.median(expected[:, 0]):.3f} m"
        bound = f"{sum(one.lower_bound for one in chosen)} of {len(chosen)}"
        yield f"| {title} | {len(chosen)} | " + " | ".join([*inside, *m, bound]) + " |"


def _inside(error: FloatArray, expected: FloatArray) -> str:
    known = np.isfinite(error)
    count = int(known.sum())
    return f"{int((error[known] <= expected[known]).sum())} of {count}" if count else "not observed"


def main(words: list[str] | None = None) -> int:
    """Drive, print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", nargs="*", type=int, default=list(SEEDS), help="planar worlds")
    parser.add_argument("--space", nargs="*", type=int, default=list(SPACE_SEEDS), help="worlds in space")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    options = parser.parse_args(words)
    kinds = [*((walls, False) for walls in WALLS), ("smooth", True)]
    cases = [
        Case(walls, course, wheels, seed) for (walls, wheels), course, seed in product(kinds, COURSES, options.seeds)
    ]
    cases += [Case(walls, "space", True, seed) for walls, seed in product(WALLS, options.space)]
    with ProcessPoolExecutor(options.jobs) as pool:
        measured = list(pool.map(measure, cases))
    seeds, space = (", ".join(map(str, chosen)) for chosen in (options.seeds, options.space))
    lines = HEADING.format(seeds=seeds, space=space) + "\n".join(step_rows(measured))
    text = lines + "\n" + ENDS + "\n".join(end_rows([end for one in measured for end in one.ends])) + "\n"
    print(text)
    if (tuple(options.seeds), tuple(options.space)) == (SEEDS, SPACE_SEEDS):
        RESULT.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
