"""`lhdmap eval pile --truth T.csv`: width, inclination and status of piles, in the style of Table 6."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_settings, suggest
from lhdmap.errors import EvaluationShortfall, InputError, UsageError
from lhdmap.interrupts import before_interrupt

if TYPE_CHECKING:
    from lhdmap.evaluation.pile import ErrorSummary, PileEvaluation, PileRow, Runner
    from lhdmap.evaluation.pile_truth import PileTruth

PAPER_LINE = (
    "the paper's Table 6: 0.58 m and 1.7 deg (n = 6; its truth was set by hand on the same registered clouds, so errors of "
    "the registration are not in it)"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the subject `pile`."""
    parser.add_argument(
        "--truth",
        type=Path,
        required=True,
        metavar="T.csv",
        help="attempt,gt_width_m,gt_inclination_deg and log or pred_width_m,pred_inclination_deg, optionally gt_status; the log "
        "(relative to the file) of a line without prediction is run",
    )
    add_settings(parser)
    suggest(
        parser.add_argument("--poses", default="", metavar="ground-truth", help="run the logs with the poses in them"),
        "ground-truth",
    )
    parser.add_argument(
        "--at",
        choices=("end", "decision"),
        default="end",
        help="which estimate counts: the last (default) or that decided on",
    )
    limits = parser.add_argument_group("limits: exit code 1 where the result is worse")
    limits.add_argument("--max-width-mae-m", type=float, metavar="X", help="mean absolute error of the width")
    limits.add_argument("--max-inclination-mae-deg", type=float, metavar="X", help="the same of the inclination")
    limits.add_argument("--min-status-accuracy", type=float, metavar="X", help="share of right statuses, 0 to 1")
    limits.add_argument("--min-identified", type=float, metavar="X", help="share of piles that were measured, 0 to 1")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Evaluate, print, and raise where a log could not be used (exit code 3) or a limit is missed (1)."""
    from lhdmap.evaluation.pile import PileEvaluation
    from lhdmap.evaluation.pile_truth import read_pile_truth

    truth = read_pile_truth(arguments.truth)
    runner = _runner(arguments) if truth.needs_run else None
    if runner is None and (arguments.config or arguments.set or arguments.poses or arguments.at != "end"):
        raise UsageError(
            f"{arguments.truth} holds predictions, so no log is run: leave out --config, --set, --poses and --at, or its "
            "columns pred_…"
        )
    rows: list[PileRow] = []

    def shown() -> PileEvaluation:
        found = PileEvaluation(tuple(rows), was_run=runner is not None)
        console.result(found.to_json(), pile_table(found))
        return found

    def interrupted() -> None:
        if rows:
            shown()

    with before_interrupt(interrupted):
        try:
            _collect(rows, truth, runner, console, at_decision=arguments.at == "decision")
        except KeyboardInterrupt:
            interrupted()
            raise
    found = shown()
    _check(arguments, found)
    return 0


def _runner(arguments: argparse.Namespace) -> Runner:
    """Return what identifies the pile in a log with the settings of the command line."""
    from lhdmap.config import load_settings
    from lhdmap.pipeline.identify import identify

    settings = load_settings(arguments.config, arguments.set)
    return lambda log: identify(log, settings, arguments.poses)


def _collect(
    rows: list[PileRow], truth: PileTruth, runner: Runner | None, console: Console, *, at_decision: bool
) -> None:
    """Fill `rows` one by one, so that what was finished is kept on Ctrl-C."""
    from lhdmap.evaluation.pile import evaluate_pile

    for row in evaluate_pile(truth, runner, at_decision=at_decision):
        rows.append(row)
        if row.problem:
            console.warn(f"attempt {row.attempt.name}: {row.problem}")
        elif row.reason:
            console.warn(f"attempt {row.attempt.name}: {row.attempt.log}: no status: {row.reason}")
        elif runner is not None and truth.is_run(row.attempt):
            console.note(
                f"{len(rows)} of {len(truth.attempts)}: {row.attempt.log}: {row.found.status or 'not identified'}"
            )


def pile_table(found: PileEvaluation) -> str:
    """Return the result as lines for a person."""
    lines = [_header(), *(_line(row) for row in found.rows), ""]
    lines += [f"{found.identified} of {len(found.rows)} piles measured"]
    lines += [_summary_line("width, m", found.width, 2), _summary_line("inclination, deg", found.inclination, 1)]
    status = found.status
    if status.accuracy is not None and status.macro_accuracy is not None:
        lines.append(
            f"status            accuracy {100 * status.accuracy:.1f} % of {status.n}, "
            f"mean over the statuses {100 * status.macro_accuracy:.1f} %"
        )
        if status.called_loadable is not None:
            lines.append(f"                  called loadable and not: {100 * status.called_loadable:.1f} %")
    return "\n".join([*lines, PAPER_LINE] if found.was_run else lines)


def _header() -> str:
    names = ("true, m", "found, m", "error", "true, deg", "found, deg", "error")
    return f"{'attempt':<10}" + "".join(f"{name:>12}" for name in names) + "  status"


def _line(row: PileRow) -> str:
    truth, found = row.attempt.truth, row.found
    width = (
        _cell(truth.width_m, 2),
        _with_std(found.width_m, found.width_std_m, 2),
        _cell(row.width_error_m, 2, sign=True),
    )
    slope = (
        _cell(truth.inclination_deg, 1),
        _with_std(found.inclination_deg, found.inclination_std_deg, 1),
        _cell(row.inclination_error_deg, 1, sign=True),
    )
    return f"{row.attempt.name[:10]:<10}" + "".join(f"{cell:>12}" for cell in (*width, *slope)) + "  " + _status(row)


def _status(row: PileRow) -> str:
    if row.problem or row.reason:
        return "could not be run" if row.problem else "no status"
    true, found = row.attempt.truth.status, row.found.status or ("not identified" if row.judged else "-")
    return found if true is None or true == found else f"{found} (true: {true})"


def _cell(value: float | None, digits: int, *, sign: bool = False) -> str:
    return "-" if value is None else f"{value:{'+' if sign else ''}.{digits}f}"


def _with_std(value: float | None, std: float | None, digits: int) -> str:
    return _cell(value, digits) + ("" if std is None or value is None else f"±{std:.{digits}f}")


def _summary_line(label: str, found: ErrorSummary, digits: int) -> str:
    if found.mae is None or found.median is None or found.p90 is None or found.max is None:
        return f"{label:<17} no error: no attempt has both truth and prediction"
    figures = {"mean": found.mae, "median": found.median, "p90": found.p90, "max": found.max}
    text = ", ".join(f"{name} {value:.{digits}f}" for name, value in figures.items())
    within = "" if found.within_std is None else f"; {100 * found.within_std:.0f} % within 2 standard deviations"
    return f"{label:<17} absolute error: {text} (n = {found.n}){within}"


def _check(arguments: argparse.Namespace, found: PileEvaluation) -> None:
    failed = [row for row in found.rows if row.problem]
    if failed:
        raise InputError(
            f"{arguments.truth}: {len(failed)} of {len(found.rows)} logs could not be used, the first is "
            f"{failed[0].attempt.log}: {failed[0].problem}"
        )
    share = found.identified / len(found.rows)
    missed = [
        *_over("mean absolute error of the width, m", found.width.mae, arguments.max_width_mae_m),
        *_over("mean absolute error of the inclination, deg", found.inclination.mae, arguments.max_inclination_mae_deg),
        *_under("share of right statuses", found.status.accuracy, arguments.min_status_accuracy),
        *_under("share of piles that were measured", share, arguments.min_identified),
    ]
    if missed:
        raise EvaluationShortfall("evaluation fell short: " + "; ".join(missed))


def _over(name: str, value: float | None, limit: float | None) -> list[str]:
    if limit is None or (value is not None and value <= limit):
        return []
    return [f"{name}: {_told(value)}, at most {limit:g} was wanted"]


def _under(name: str, value: float | None, limit: float | None) -> list[str]:
    if limit is None or (value is not None and value >= limit):
        return []
    return [f"{name}: {_told(value)}, at least {limit:g} was wanted"]


def _told(value: float | None) -> str:
    return "not known" if value is None else f"{value:.4g}"
