"""The ore pile on a page: figures with their deviations and five pictures; a page of its own, or a section of build-map's."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.pile.result import STATUSES, PileEstimate, PileReport
from lhdmap.report import charts, markup, pile_charts, pile_normals

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ABOVE = (
    "The end of the drift from above, hits coloured by what they are taken for. The toe is where the face meets the floor; "
    "the diamonds are the limits E_L and E_R with twice their deviation, the arrow is where to drive into the pile."
)
CUT = (
    "Cut along the drift. Each point of the face is drawn at its distance from the toe on its own side, so that a face "
    "that stands askew is not blurred; the line is the fit, the band twice the deviation of its inclination."
)
RELIEF = (
    "The face as the machine sees it: red stands out of the fitted face towards the machine, blue lies behind it. "
    "Dashed: the limits."
)
NORMALS = (
    "The cloud from behind and above the machine. The normal of a surface is the direction that it faces; n_y is the part of it "
    "along the axis y, which points to the left (small axes: x into the pile, y to the left, z up). The left wall faces right "
    "(n_y = -1, blue), the right wall faces left (n_y = +1, red), pile and floor face the machine or the roof (n_y near 0, pale). "
    "A red and a blue patch side by side on the face are the flanks of something that stands out. As Fig. 10 of the paper on "
    "autonomous loading."
)
CONVERGENCE = "How the estimate came about on the way to the pile, bands of two standard deviations; dashed: where it was decided."
_MEANING = {
    "loadable": "a pile that can be loaded",
    "too_shallow": "the face is too flat to fill a bucket",
    "wall": "bare rock closes the drift",
    "hang_up": "too steep or overhanging: rock may come down",
    "none": "nothing closes the drift",
}


def write_pile_report(report: PileReport, path: Path, title: str) -> None:
    """Write one self-contained HTML page of what is said of the pile."""
    path.write_text(markup.document(title, pile_sections(report, drawn=True)), encoding="utf-8")


def unsought_section(reason: str, warnings: Collection[str] = ()) -> str:
    """Return the section where nothing can be said of a pile, because `reason`."""
    words = markup.paragraph(reason[:1].upper() + reason[1:] + ".")
    return markup.section("Ore pile", words + markup.listed(warnings, "warning"))


def pile_sections(report: PileReport, *, drawn: bool = False, said: Collection[str] = ()) -> str:
    """Return the sections as markup: for a page of their own, and within another.

    `drawn`: with pictures also where the last estimate is none, to see why; `said`: warnings that the page has already.
    """
    pile = report.last.estimate if report.last is not None else report.estimate
    warned = [text for text in dict.fromkeys((*report.warnings, *pile.warnings)) if text not in said]
    if pile.status is None:
        return unsought_section(pile.reason, warned)
    parts = [markup.section("Ore pile", markup.cards(_figures(report)) + markup.listed(warned, "warning"))]
    if not pile.found or (pile.status == "none" and not drawn):
        return "".join(
            [*parts, markup.paragraph("No face was found that closes the drift, so there is nothing to draw.")]
        )
    if pile.status == "none":
        words = "What stands ahead is drawn all the same, so that one sees why it is none; face and toe are what a fit made of it."
        parts.append(markup.paragraph(words))
    with charts.styled():
        if len(pile.face_m) and np.isfinite([pile.left_limit_m, pile.right_limit_m]).all():
            parts.append(markup.section("From above", _picture(pile_charts.above_chart(report, pile), ABOVE)))
            parts.append(markup.section("The face from the side", _picture(pile_charts.cut_chart(report, pile), CUT)))
            parts.append(
                markup.section("The face from the machine", _picture(pile_charts.relief_chart(report, pile), RELIEF))
            )
            parts.append(markup.section("Normals across", _picture(pile_normals.normals_chart(report, pile), NORMALS)))
        if any(one.estimate.found and math.isfinite(one.distance_m) for one in report.history):
            picture = _picture(pile_charts.convergence_chart(report), CONVERGENCE)
            parts.append(markup.section("How the estimate converged", picture))
    parts.append(markup.section("Probabilities and places", _tables(pile)))
    if len(report.piles) > 1:
        parts.append(markup.section("All that was decided on this drive", _piles(report)))
    return "".join(parts)


def _picture(figure: Figure, caption: str) -> str:
    return markup.picture(charts.svg_uri(figure), caption)


def _over(heights_m: tuple[float, float]) -> str:
    """Return the heights that an inclination is of, in words."""
    low, high = heights_m
    return f", seen from {max(low, 0.0):.1f} to {high:.1f} m over the floor" if math.isfinite(high) else ""


def _figures(report: PileReport) -> Iterator[tuple[str, str, str]]:
    """Yield name, value and meaning of the headline figures; ± is one standard deviation; of none there are no measures."""
    pile = report.estimate
    yield "status", _words(pile), _status_meaning(pile)
    if pile.found:
        width = f"{_deviation(pile.width_std_m, 2, ' m')}, one standard deviation; wall to wall before the face"
        yield "width", f"{pile.width_m:.2f} m", width
        slope = f"{_deviation(pile.inclination_std_deg, 1, '°')}{_over(pile.heights_m)}; 0 is the floor, -90 an upright wall"
        yield "inclination", f"{pile.inclination_deg:.1f}°", slope
    if math.isfinite(pile.volume_m3):
        volume = f"{_deviation(pile.volume_std_m3, 1, ' m³')}; above the floor, as far up as the face was seen"
        yield "volume", f"{pile.volume_m3:.1f} m³", volume
    if report.decision is not None:
        distance, status = f"{report.decision.distance_m:.1f} m", _words(report.decision.estimate)
        meaning = (
            f"decided {distance} before the toe, the foot of the pile: so far away the machine was when it was sure enough that "
            f"this is {status}; what it saw later went into the figures"
        )
        yield "before the pile", distance, meaning
    elif pile.status != "none":
        yield "decided", "no", f"it was never sure enough that it is {_words(pile)}"
    if pile.found:
        sizes = ", ".join(f"{rock.size_m:.1f} m" for rock in pile.boulders)
        yield "boulders", str(len(pile.boulders)), sizes or "nothing oversized stands out of the face"


def _words(pile: PileEstimate) -> str:
    return "unknown" if pile.status is None else pile.status.replace("_", " ")


def _status_meaning(pile: PileEstimate) -> str:
    """Return what the status means, with its probability where that is what the status follows from."""
    shares, status = pile.probabilities, pile.status or "none"
    if status == "none" and shares.get(status, 0.0) < max(shares.values(), default=0.0):
        return "what lies ahead is not known well enough to be called anything"
    return f"{_MEANING[status]}; probability {100.0 * shares.get(status, 0.0):.0f} %"


def _tables(pile: PileEstimate) -> str:
    shares = [
        (name.replace("_", " "), f"{100 * pile.probabilities.get(name, 0.0):.1f}", _MEANING[name]) for name in STATUSES
    ]
    places = [
        ("left limit E_L", *_xyz(pile.left_limit_m)),
        ("right limit E_R", *_xyz(pile.right_limit_m)),
        ("middle of the face", *_xyz(pile.center_m)),
        *((f"boulder, {rock.size_m:.1f} m", *_xyz(rock.center_m)) for rock in pile.boulders),
    ]
    if pile.attack is not None:
        heading = f"attack, heading {math.degrees(pile.attack.heading_rad):.1f}°"
        places.append((heading, *_xyz(pile.attack.point_m)))
    first = markup.table(("status", "probability, %", "meaning"), shares, numbers_from=1, numbers_to=2)
    return first + markup.table(("in map", "x, m", "y, m", "z, m"), places, numbers_from=1)


def _piles(report: PileReport) -> str:
    """Return a row for each pile or wall that was decided, in the order of time."""
    rows = [
        (
            _words(one.last.estimate) + (" (the one above)" if one.last is report.last else ""),
            f"{one.last.estimate.width_m:.2f} {_deviation(one.last.estimate.width_std_m, 2, '')}",
            f"{one.last.estimate.inclination_deg:.1f} {_deviation(one.last.estimate.inclination_std_deg, 1, '')}",
            f"{one.decision.distance_m:.1f}",
            *_xyz(one.last.estimate.center_m),
        )
        for one in report.piles
    ]
    names = ("status", "width, m", "inclination, °", "decided at, m", "x, m", "y, m", "z, m")
    return markup.table(names, rows, numbers_from=1)


def _deviation(value: float, digits: int, unit: str) -> str:
    return f"± {value:.{digits}f}{unit}" if math.isfinite(value) else "± unknown"


def _xyz(point_m: FloatArray) -> tuple[str, str, str]:
    x, y, z = (f"{round(float(value), 2) + 0.0:.2f}" for value in point_m)
    return x, y, z
