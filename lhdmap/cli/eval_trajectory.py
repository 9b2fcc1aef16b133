"""`lhdmap eval trajectory EST --truth TRUTH`: errors of a trajectory, as a table or as JSON."""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_force
from lhdmap.errors import EvaluationShortfall, LhdmapWarning, UsageError
from lhdmap.outputs import OutputFiles, free_files

if TYPE_CHECKING:
    from lhdmap.evaluation.metrics import Segment, Statistics
    from lhdmap.evaluation.relations import RelationEvaluation
    from lhdmap.evaluation.trajectory import TrajectoryEvaluation, TrajectoryEvaluationSettings

CONTRACT_KEYS = (
    "alignment",
    "pairs",
    "ape_m",
    "rpe",
    "segments",
    "reach",
    "end_pct",
    "along_m",
    "across_m",
    "height_m",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the subject `trajectory`."""
    parser.add_argument("estimate", type=Path, metavar="EST", help="TUM file, or a map folder (its trajectory.tum)")
    parser.add_argument(
        "--truth",
        type=Path,
        required=True,
        help="TUM file, log with ground truth, map folder, corrected CARMEN log (ROBOTLASER1), or .relations file",
    )
    parser.add_argument("--odometry", action="store_true", help="of a map folder, take odometry.tum")
    parser.add_argument(
        "--alignment",
        choices=("none", "origin", "se2", "se3"),
        default="origin",
        help="origin: first position and heading (default); se2, se3: least squares, no scale",
    )
    parser.add_argument("--segments", default="5,10,20,50,100", metavar="M,M", help="segment lengths in metres")
    parser.add_argument("--delta", type=float, default=1.0, help="step of the relative error (default 1)")
    parser.add_argument("--delta-unit", choices=("m", "frames"), default="m", help="unit of the step (default m)")
    parser.add_argument("--tolerance", type=float, metavar="S", help="largest stamp difference (0.02, relations 0.001)")
    parser.add_argument("--planar", action="store_true", help="compare x, y and heading only")
    parser.add_argument("--plot", type=Path, metavar="PNG", help="draw paths and errors (.png, .svg, .pdf)")
    add_force(parser)
    limits = parser.add_argument_group("limits: exit code 1 where the estimate is worse")
    limits.add_argument("--max-ape-m", type=float, metavar="X", help="root mean square of the absolute error")
    limits.add_argument("--max-translation-pct", type=float, metavar="X", help="of each segment length")
    limits.add_argument("--max-rotation-deg-per-m", type=float, metavar="X", help="of each segment length")
    limits.add_argument("--max-end-pct", type=float, metavar="X", help="end-point error over distance")
    limits.add_argument("--min-reach", type=float, metavar="X", help="share of the true path that is covered, 0 to 1")
    limits.add_argument("--max-relation-m", type=float, metavar="X", help="mean translation of relations up to 60 s")
    limits.add_argument("--max-relation-deg", type=float, metavar="X", help="mean rotation of relations up to 60 s")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Evaluate, print, and raise `EvaluationShortfall` where a limit is missed."""
    if arguments.truth.name.endswith((".relations", ".relations.txt")):
        return _run_relations(arguments, console)
    from lhdmap.evaluation.sources import load_estimate, load_truth
    from lhdmap.evaluation.trajectory import evaluate_trajectory

    if arguments.max_relation_m is not None or arguments.max_relation_deg is not None:
        raise UsageError("--max-relation-… needs --truth FILE.relations")
    settings = _settings(arguments)
    if arguments.plot:
        free_files([arguments.plot], force=arguments.force, inputs=[arguments.estimate, arguments.truth])
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", LhdmapWarning)
        estimate = load_estimate(arguments.estimate, odometry=arguments.odometry)
        truth = load_truth(arguments.truth)
    read = [str(one.message) for one in told if issubclass(one.category, LhdmapWarning)]
    for text in read:
        console.warn(text)
    found = evaluate_trajectory(estimate, truth, settings)
    for warning in found.warnings:
        console.note(f"note: {warning}")
    values = found.to_json()
    console.result(values | {"warnings": [*read, *values["warnings"]]}, trajectory_table(found))
    if arguments.plot:
        from lhdmap.report.evaluation_plot import plot_evaluation

        with OutputFiles(arguments.plot, force=arguments.force) as files:
            plot_evaluation(found, files.at(arguments.plot))
        console.note(f"plot: {arguments.plot}")
    _check(_trajectory_shortfalls(arguments, found))
    return 0


def _run_relations(arguments: argparse.Namespace, console: Console) -> int:
    from lhdmap.evaluation.relations import STAMP_TOLERANCE_NS, evaluate_relations, read_relations
    from lhdmap.evaluation.sources import load_estimate

    for name in ("plot", "max_ape_m", "max_translation_pct", "max_rotation_deg_per_m", "max_end_pct", "min_reach"):
        if getattr(arguments, name) is not None:
            raise UsageError(f"--{name.replace('_', '-')} needs a trajectory as truth, relations have none")
    tolerance_ns = STAMP_TOLERANCE_NS if arguments.tolerance is None else round(arguments.tolerance * 1e9)
    estimate = load_estimate(arguments.estimate, odometry=arguments.odometry)
    found = evaluate_relations(estimate, read_relations(arguments.truth), tolerance_ns)
    values = dict.fromkeys(CONTRACT_KEYS) | {"alignment": "none", "pairs": found.matched} | found.to_json()
    console.result(values, relations_table(found))
    _check(_relation_shortfalls(arguments, found))
    return 0


def _settings(arguments: argparse.Namespace) -> TrajectoryEvaluationSettings:
    from lhdmap.evaluation.trajectory import TrajectoryEvaluationSettings

    return TrajectoryEvaluationSettings(
        alignment=arguments.alignment,
        tolerance_s=0.02 if arguments.tolerance is None else arguments.tolerance,
        segments_m=_lengths(arguments.segments),
        rpe_delta=arguments.delta,
        rpe_unit=arguments.delta_unit,
        planar=arguments.planar,
    )


def _lengths(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError:
        raise UsageError(f"--segments {text}: lengths in metres, e.g. 5,10,20, were wanted") from None


def trajectory_table(found: TrajectoryEvaluation) -> str:
    """Return the result as lines for a person."""
    from lhdmap.evaluation.metrics import statistics

    parts = found.components
    step = f"per {found.rpe.delta:g} {found.rpe.unit}"
    end = "standing still" if found.end_pct is None else f"{found.end_pct:.3f} % of the distance"
    head = f"alignment {found.alignment}, {found.pairs} pairs over {found.distance_m:.2f} m"
    return "\n".join(
        [
            f"{head}, reach {100 * found.reach:.1f} % of the true path",
            f"end point error  {end}",
            f"heading drift    {_drift(found.heading_drift_deg)}",
            f"mean error       along {parts.along_m:.4f}, across {parts.across_m:.4f}, height {parts.height_m:.4f} m",
            "",
            f"{'':22}{'rmse':>10}{'mean':>10}{'median':>10}{'std':>10}{'min':>10}{'max':>10}",
            _row("absolute error, m", found.ape_m),
            _row(f"{step}, m", statistics(found.rpe.translation_m)),
            _row(f"{step}, deg", statistics(found.rpe.rotation_deg)),
            "",
            *_segment_rows(found.segments),
        ]
    )


def _drift(drift_deg: float | None) -> str:
    return "standing still" if drift_deg is None else f"{drift_deg:.4f} deg over 100 m"


def relations_table(found: RelationEvaluation) -> str:
    """Return the result as lines for a person."""
    names = {"all": "all", "short": "below 5 s", "up_to_60_s": "up to 60 s", "long": "over 60 s"}
    rows = [f"{found.matched} of {found.total} relations have both stamps in the estimate", ""]
    rows.append(
        f"{'time apart':12}{'relations':>11}{'mean, m':>11}{'median, m':>11}{'mean, deg':>11}{'median, deg':>13}"
    )
    for group in found.groups:
        if group.translation_m is None or group.rotation_deg is None:
            rows.append(f"{names[group.name]:12}{0:>11}   none with both stamps")
            continue
        t, r = group.translation_m, group.rotation_deg
        rows.append(
            f"{names[group.name]:12}{group.n:>11}{t.mean:>11.4f}{t.median:>11.4f}{r.mean:>11.3f}{r.median:>13.3f}"
        )
    return "\n".join(rows)


def _row(label: str, values: Statistics | None) -> str:
    if values is None:
        return f"{label:22}   no pair: the path is shorter than the step"
    return f"{label:22}" + "".join(f"{value:>10.4f}" for value in values)


def _segment_rows(segments: tuple[Segment, ...]) -> list[str]:
    rows = [f"{'segment, m':>10}{'how many':>10}{'translation, %':>16}{'rotation, deg/m':>17}"]
    for s in segments:
        if s.translation_pct is None or s.rotation_deg_per_m is None:
            rows.append(f"{s.length_m:>10g}{0:>10}   none: the path is too short")
        else:
            rows.append(f"{s.length_m:>10g}{s.n:>10}{s.translation_pct:>16.4f}{s.rotation_deg_per_m:>17.5f}")
    return rows


def _trajectory_shortfalls(arguments: argparse.Namespace, found: TrajectoryEvaluation) -> list[str]:
    end = float("inf") if found.end_pct is None else found.end_pct
    missed = [
        *_over("absolute error (rmse), m", found.ape_m.rmse, arguments.max_ape_m),
        *_over("end-point error, %", end, arguments.max_end_pct),
    ]
    if arguments.min_reach is not None and not found.reach >= arguments.min_reach:
        missed.append(f"reach is {found.reach:.4g}, at least {arguments.min_reach:g} was wanted")
    used = [segment for segment in found.segments if segment.n]
    if not used and (arguments.max_translation_pct is not None or arguments.max_rotation_deg_per_m is not None):
        missed.append(f"the path of {found.distance_m:.1f} m has no segment to judge by")
    for s in used:
        missed += _over(f"translation over {s.length_m:g} m, %", s.translation_pct, arguments.max_translation_pct)
        missed += _over(
            f"rotation over {s.length_m:g} m, deg/m", s.rotation_deg_per_m, arguments.max_rotation_deg_per_m
        )
    return missed


def _relation_shortfalls(arguments: argparse.Namespace, found: RelationEvaluation) -> list[str]:
    group = next(group for group in found.groups if group.name == "up_to_60_s")
    mean_m = group.translation_m.mean if group.translation_m else None
    mean_deg = group.rotation_deg.mean if group.rotation_deg else None
    return [
        *_over("mean translation of relations up to 60 s, m", mean_m, arguments.max_relation_m),
        *_over("mean rotation of relations up to 60 s, deg", mean_deg, arguments.max_relation_deg),
    ]


def _over(name: str, value: Any, limit: float | None) -> list[str]:
    """Return the shortfall in words where the value is above the limit, or there is none to hold against it."""
    if limit is None or (value is not None and value <= limit):
        return []
    return [f"{name} is {'not known' if value is None else f'{value:.4g}'}, at most {limit:g} was wanted"]


def _check(missed: list[str]) -> None:
    if missed:
        raise EvaluationShortfall("evaluation fell short: " + "; ".join(missed))
