"""Words of the report: headline figures with what they mean, and sentences for what is missing."""

from __future__ import annotations

from typing import NamedTuple

from lhdmap.evaluation.trajectory import TrajectoryEvaluation
from lhdmap.report.data import ReportData, Summary

_MOSTLY = 0.5


class Figure(NamedTuple):
    """One headline figure: `value` with its unit, `name`, and what it means in plain words."""

    value: str
    name: str
    meaning: str


def headline(data: ReportData) -> list[Figure]:
    """Return the headline figures, the most important first."""
    s = data.summary
    return [
        Figure(f"{s.distance_m:.1f} m", "driven", f"length of the path of base_link in {duration(s.duration_s)}"),
        Figure(f"{s.scans:,}".replace(",", "\u202f"), "scans", _processed(s)),
        *_degeneracy(s),
        Figure(str(s.lost_stretches), "lost stretches", _lost(s)),
        Figure(str(s.closures), "loop closures", _closures(s)),
        *_truth(data.evaluation),
        *_cost(s),
    ]


def duration(seconds: float) -> str:
    """Return a duration in words: `3 min 05 s`, `12.4 s`."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"


def missing_parts(data: ReportData) -> list[str]:
    """Return a sentence for each part that the log or the run did not have."""
    sentences = []
    if data.tachometer_speed is None or not len(data.tachometer_speed.stamps_ns):
        sentences.append(
            "The log has no tachometer: wheel slip is not known, and a weak direction has no second witness."
        )
    if not data.has_inclinometer:
        sentences.append("The log has no inclinometer: the drive was treated as planar, its height profile is flat.")
    if data.cloud is None or not len(data.cloud.points_m):
        sentences.append("No cloud was integrated.")
    if data.diagnostics is None or not len(data.diagnostics.stamp_ns):
        sentences.append("No diagnostics were recorded: whether a direction was unobserved is not known.")
    if data.evaluation is None:
        sentences.append("No ground truth was given: the accuracy of this map was not measured.")
    return sentences


def _processed(s: Summary) -> str:
    share = f" ({100 * s.scans_processed / s.scans:.0f} %)" if s.scans else ""
    return (
        f"of the front scanner; {s.scans_processed} of them{share} were matched, the adaptive rate passed over the rest"
    )


def _degeneracy(s: Summary) -> list[Figure]:
    if s.degenerate_share is None:
        return []
    meaning = "of the matched scans did not see one direction well; motion there came from wheels or the last motion"
    return [Figure(f"{100 * s.degenerate_share:.1f} %", "weak scans", meaning)]


def _lost(s: Summary) -> str:
    if s.lost_stretches:
        return "the map may be bent there: see the warnings"
    if (s.degenerate_share or 0.0) > _MOSTLY:
        return "every scan fitted the map, but most say little of one direction: the path along it is not proven"
    return "the scans were followed all the way"


def _closures(s: Summary) -> str:
    if s.closures == 0:
        return "no place was recognised a second time: drift is not corrected"
    return "places were recognised again and the drift between them was spread over the path"


def _truth(evaluation: TrajectoryEvaluation | None) -> list[Figure]:
    if evaluation is None:
        return []
    used = [segment for segment in evaluation.segments if segment.translation_pct is not None]
    figures = []
    if used:
        segment = min(used, key=lambda one: abs(one.length_m - 10.0))
        meaning = f"mean drift over {segment.length_m:g} m of driving, against the truth ({segment.n} segments)"
        figures.append(Figure(f"{segment.translation_pct:.3f} %", "drift", meaning))
    ape = evaluation.ape_m.rmse
    value = f"{100 * ape:.1f} cm" if ape < 1 else f"{ape:.2f} m"
    meaning = f"distance to the true position (root mean square, alignment {evaluation.alignment})"
    return [*figures, Figure(value, "position error", meaning)]


def _cost(s: Summary) -> list[Figure]:
    figures = []
    if s.realtime_factor is not None:
        took = "" if s.wall_s is None else f": {duration(s.wall_s)} of computing"
        figures.append(Figure(f"{s.realtime_factor:.0f} ×", "real time", f"faster than the drive itself{took}"))
    if s.peak_memory_mib is not None:
        figures.append(Figure(f"{s.peak_memory_mib:.0f} MiB", "memory", "most that the run needed at once"))
    return figures
