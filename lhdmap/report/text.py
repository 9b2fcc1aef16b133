"""Words of the report: headline figures with what they mean, and sentences for what is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from lhdmap.evaluation.trajectory import TrajectoryEvaluation
from lhdmap.report.data import ReportData, Summary

_MOSTLY = 0.5
_LEAST_COMPILE_S = 1.0  # less is a kernel or two, and not worth a word
_ALIKE = (0.95, 1.05)  # real-time factors that are that of the drive


class Figure(NamedTuple):
    """One headline figure: `value` with its unit, `name`, and what it means in plain words."""

    value: str
    name: str
    meaning: str


def headline(data: ReportData) -> list[Figure]:
    """Return the headline figures, the most important first; what the run cost comes last, once it is known (`cost_figures`)."""
    s = data.summary
    driven = Figure(f"{s.distance_m:.1f} m", "driven", f"length of the path of base_link in {duration(s.duration_s)}")
    scans = f"{s.scans:,}".replace(",", "\u202f")
    if data.poses:
        return [
            driven,
            Figure(scans, "scans", "of the front scanner, placed along the given poses"),
            Figure("given", "poses", f"path and map are made from {data.poses}; no pose was estimated"),
        ]
    return [
        *_trust(s),
        driven,
        Figure(scans, "scans", _processed(s)),
        *_degeneracy(s, data.witness),
        Figure(str(s.lost_stretches), "lost stretches", _lost(s)),
        Figure(str(s.closures), "loop closures", _closures(s)),
        *_truth(data.evaluation),
    ]


def _trust(s: Summary) -> list[Figure]:
    if s.expected_error is None:
        return []
    error = s.expected_error
    least = "at least " if error["lower_bound"] else ""
    meaning = (
        f"how far the end of the path may be off against its start, in 95 of 100 drives: {error['end_pct']:.2g} % of the way; "
        f"heading {_degrees(error['heading_deg'])}, height {_height(error['height_m'])}{_unseen(error)}"
    )
    return [Figure(f"{least}{length(error['end_m'])}", "expected error", meaning)]


def trust_line(figures: Mapping[str, Any]) -> str | None:
    """Return in one line how far the map may be off; None where nobody knows. `figures` are those of `build-map --json`."""
    error = figures.get("expected_error")
    if error is None:
        return None
    least = "at least " if error["lower_bound"] else ""
    return (
        f"{least}{length(error['end_m'])} at its end ({error['end_pct']:.2g} %), heading {_degrees(error['heading_deg'])}, "
        f"height {_height(error['height_m'])} (95 %){_unseen(error)}"
    )


def _unseen(error: Mapping[str, Any]) -> str:
    if not error["lower_bound"]:
        return ""
    return f"; on up to {error['unseen_m']:.0f} m neither walls nor wheels told the motion in all directions: it may be more"


def _height(height_m: float | None) -> str:
    return "not observed" if height_m is None else length(height_m)


def _degrees(angle_deg: float) -> str:
    return f"{angle_deg:.2g}°" if angle_deg < 10.0 else f"{angle_deg:.0f}°"


def length(metres: float) -> str:
    """Return a length as people read it: `4.2 cm`, `1.35 m`."""
    return f"{100 * metres:.1f} cm" if metres < 1.0 else f"{metres:.2f} m"


def cost_figures(s: Summary) -> list[Figure]:
    """Return what the run cost, as far as it is known."""
    figures = []
    if s.realtime_factor is not None:
        took = "" if s.wall_s is None else f": {duration(s.wall_s)} of computing"
        meaning = f"{_than_the_drive(s.realtime_factor)}{took}{_compiling(s)}"
        figures.append(Figure(times(s.realtime_factor), "real time", meaning))
    if s.peak_memory_mib is not None:
        figures.append(Figure(f"{s.peak_memory_mib:.0f} MiB", "memory", "most that the run needed at once"))
    return figures


def cost_line(figures: Mapping[str, Any]) -> str:
    """Return in one line what the run cost, with the figures of the page; `figures` are those of `build-map --json`."""
    s = summary_of(figures)
    wall = "" if s.wall_s is None else f"{duration(s.wall_s)} = "
    return f"{wall}{times(s.realtime_factor or 0.0)} real time{_compiling(s)}; {s.peak_memory_mib or 0.0:.0f} MiB"


def summary_of(figures: Mapping[str, Any]) -> Summary:
    """Return the headline figures among those of `build-map --json`."""
    return Summary(**{name: figures[name] for name in Summary.__slots__ if name in figures})


def times(factor: float) -> str:
    """Return a factor as people read it: `0.30 ×`, `7.2 ×`, `120 ×`."""
    digits = 2 if factor < 1.0 else 1 if factor < 100.0 else 0
    return f"{factor:.{digits}f} ×"


def duration(seconds: float) -> str:
    """Return a duration in words: `3 min 05 s`, `12.4 s`."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"


def missing_parts(data: ReportData) -> list[str]:
    """Return a sentence for each part that the log or the run did not have; what a warning says already is left out."""
    sentences = [] if data.poses or data.difference is not None else _missing_of_odometry(data)
    if data.cloud is None or not len(data.cloud.points_m):
        sentences.append("No cloud was integrated.")
    if data.poses:
        sentences.append("The map is as accurate as the given poses are.")
    elif data.evaluation is None:
        sentences.append("No ground truth was given: the accuracy of this map was not measured.")
    return sentences


def _missing_of_odometry(data: ReportData) -> list[str]:
    sentences: list[str] = []
    slip = data.tachometer_speed is not None and len(data.tachometer_speed.stamps_ns) > 0
    if data.drives > 1:  # each told of its sensors alone
        return sentences
    if not slip:
        sentences.append("The log has no tachometer: wheel slip is not known.")
    if not data.witness:
        why = "the speed of its tachometer was not used" if slip else "it has no wheel odometry that could be used"
        sentences.append(f"Where the walls do not show the motion in a direction, nothing else does: {why}.")
    if not data.has_inclinometer and not any("no inclinometer" in text for text in data.warnings):
        sentences.append("The log has no inclinometer: the drive was treated as planar, its height profile is flat.")
    if data.diagnostics is None or not len(data.diagnostics.stamp_ns):
        sentences.append("No diagnostics were recorded: whether a direction was unobserved is not known.")
    return sentences


def weak_motion(witness: str) -> str:
    """Return where the motion in a direction comes from that the scans do not show."""
    return (
        f"motion there came from the {witness} or was carried on"
        if witness
        else "motion there was carried on from before"
    )


def _processed(s: Summary) -> str:
    if s.scans_processed == s.scans:
        return "of the front scanner, all of them matched"
    share = f" ({100 * s.scans_processed / s.scans:.0f} %)" if s.scans else ""
    return (
        f"of the front scanner; {s.scans_processed} of them{share} were matched, the adaptive rate passed over the rest"
    )


def _degeneracy(s: Summary, witness: str) -> list[Figure]:
    if s.degenerate_share is None:
        return []
    meaning = f"of the matched scans did not see one direction well; {weak_motion(witness)}"
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


def _than_the_drive(factor: float) -> str:
    if _ALIKE[0] <= factor <= _ALIKE[1]:
        return "as fast as the drive itself"
    return f"{'faster' if factor > 1.0 else 'slower'} than the drive itself"


def _compiling(s: Summary) -> str:
    """Return how much of the time was compilation, and how fast the run is without."""
    if s.compile_s is None or s.wall_s is None or s.compile_s < _LEAST_COMPILE_S:
        return ""
    without = times(s.duration_s / max(s.wall_s - s.compile_s, 1e-6))
    return f", of which {duration(s.compile_s)} compiling, once after installation ({without} without)"
