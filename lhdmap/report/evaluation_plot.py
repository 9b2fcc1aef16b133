"""The picture of `lhdmap eval trajectory --plot`: both paths from above and the errors over the distance."""

from __future__ import annotations

from pathlib import Path

from lhdmap.errors import UsageError
from lhdmap.evaluation.trajectory import TrajectoryEvaluation
from lhdmap.report import charts
from lhdmap.report.path_charts import draw_errors, plan_axes

SUFFIXES = (".png", ".svg", ".pdf")


def plot_evaluation(found: TrajectoryEvaluation, path: Path) -> None:
    """Draw the evaluation into a file.

    Raises:
        UsageError: the suffix is not one of .png, .svg, .pdf.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"{path}: a plot ends in {', '.join(SUFFIXES)}")
    with charts.styled():
        plan_in = charts.plan_height_in(found.profile.truth_m)
        figure = charts.new_figure(plan_in + 2.6)
        figure.set_facecolor("white")
        plan, errors = figure.subplots(2, 1, height_ratios=(plan_in, 2.0))
        figure.subplots_adjust(hspace=1.6 / (plan_in + 2.0))
        rows = charts.thinned(found.pairs)
        for label, points, colour in (
            ("truth", found.profile.truth_m, charts.TRUTH),
            (f"estimate (alignment {found.alignment})", found.profile.estimate_m, charts.FINAL),
        ):
            plan.plot(points[rows, 0], points[rows, 1], color=colour, label=label)
        plan_axes(plan)
        charts.legend_above(plan)
        draw_errors(errors, found.profile)
        figure.savefig(path, dpi=130)
