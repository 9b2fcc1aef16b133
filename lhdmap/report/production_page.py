"""Production on a page: buckets and tonnes, where the time went, fill, stops by cause and place, distances."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from lhdmap.production.figures import Production
from lhdmap.production.usage import Usage
from lhdmap.report import charts, markup, production_charts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CYCLES = (
    "Each bucket from the end of the dump before to the end of its own, by phase; the last one may not be finished."
)
FILL = "How full the buckets were that were dumped; 1 is the payload that is wanted."
USAGE = (
    "Time usage after the GMG guideline: each level is the one above without what the narrow bar beside it lost. Every second "
    "is in exactly one class; what nobody recorded is standby."
)
TIMELINE = "Phases over time; the colours are those of the cycles above."
_MOST_ROWS = 100
_UNKNOWN = "not known"


def write_production_page(path: Path, production: Production, title: str = "Production") -> None:
    """Write one self-contained HTML page."""
    path.write_text(render(production, title), encoding="utf-8")


def render(production: Production, title: str = "Production") -> str:
    """Return the page as text; all pictures are in it."""
    with charts.styled():
        pictures = list(_pictures(production))
    parts = [
        markup.section("What was produced", markup.cards(_cards(production))),
        *pictures,
        markup.section("By machine", _machines(production)),
        markup.section("Phases", _phases(production)),
        markup.section("Stops by cause and place", _stops(production)),
        markup.section("Buckets", _buckets(production)),
    ]
    return markup.document(title, "".join(parts))


def _machines(production: Production) -> str:
    """Return a table of the machines, where there are several."""
    rows = [
        (
            one["machine"],
            str(one["cycles"]),
            f"{one['tonnes']:.1f}",
            _figure(one["cycle_mean_s"], "", 0),
            f"{one['waits_s']:.1f}",
            _UNKNOWN if one["distance_m"] is None else f"{one['distance_m']:.0f}",
        )
        for one in production.by_machine()
    ]
    head = ("machine", "buckets", "mass, t", "cycle, s", "waited for others, s", "driven, m")
    return markup.table(head, rows, numbers_from=1) if len(rows) > 1 else ""


def _cards(production: Production) -> Iterator[tuple[str, str, str]]:
    values = production.values()
    yield "buckets", str(values["cycles"]), "dumped"
    yield "mass", f"{production.tonnes:.1f} t", "of the buckets that were weighed"
    yield "rate", _figure(production.tonnes_per_hour, "t/h", 1), "by the hours that were scheduled"
    spread = "" if values["cycle_std_s"] is None else f"; standard deviation {values['cycle_std_s']:.0f} s"
    yield "cycle", _figure(values["cycle_mean_s"], "s", 0), f"mean, dump to dump{spread}"
    yield "fill", _figure(values["fill_mean"], "", 2), "mean share of the payload that is wanted"
    yield "attempts", _figure(values["attempts_mean"], "", 2), "of loading a bucket, mean"
    yield "assistance", _figure(values["assist_s_per_bucket"], "s", 1), "per bucket"
    yield "slip", _figure(values["slip_mean"], "", 2), "of the wheels while loading, mean share"
    yield "driven", _km(values["distance_m"]), f"{_km(values['distance_loaded_m'])} of it loaded"
    yield "availability", _percent(production.stack.availability), "available time by scheduled time"
    yield "utilization", _percent(production.stack.utilization), "operating time by available time"
    yield "effectiveness", _percent(production.stack.effectiveness), "productive time by operating time"


def _pictures(production: Production) -> Iterator[str]:
    if not production.cycles:
        return
    yield markup.section("Cycles", _picture(production_charts.cycle_chart(production), CYCLES))
    yield markup.section("Time usage", _picture(production_charts.usage_chart(production), USAGE))
    if production.fills:
        yield markup.section("Fill", _picture(production_charts.fill_chart(production), FILL))
    yield markup.section("Over time", _picture(production_charts.timeline_chart(production.cycles), TIMELINE))


def _picture(figure: Figure, caption: str) -> str:
    return markup.picture(charts.svg_uri(figure), caption)


def _phases(production: Production) -> str:
    total = sum(production.time_by_phase_s.values())
    rows = [
        (phase, f"{seconds:.1f}", f"{100.0 * seconds / total:.1f}")
        for phase, seconds in sorted(production.time_by_phase_s.items(), key=lambda item: -item[1])
    ]
    usage = [(str(one), f"{production.stack.class_s(one):.1f}") for one in Usage]
    first = markup.table(("phase", "time, s", "share, %"), rows, numbers_from=1)
    return first + markup.table(("class of time usage", "time, s"), usage, numbers_from=1)


def _stops(production: Production) -> str:
    rows = [
        (str(one.phase), one.place or _UNKNOWN, one.cause or _UNKNOWN, one.times, f"{one.seconds:.1f}")
        for one in production.stops[:_MOST_ROWS]
    ]
    head = ("what", "where", "why", "how often", "time, s")
    return markup.table(head, rows, numbers_from=3) if rows else markup.paragraph("None.")


def _buckets(production: Production) -> str:
    rows = [
        (
            one.machine,
            one.number,
            one.load,
            one.dump,
            f"{one.seconds():.1f}",
            _figure(one.mass_t, "", 2),
            _figure(one.fill, "", 2),
            one.attempts,
            _figure(one.distance_m, "", 0),
        )
        for one in production.finished[: 2 * _MOST_ROWS]
    ]
    head = ("machine", "bucket", "from", "to", "time, s", "mass, t", "fill", "attempts", "driven, m")
    return markup.table(head, rows, numbers_from=4) if rows else markup.paragraph("None was dumped.")


def _figure(value: float | None, unit: str, digits: int) -> str:
    if value is None or not math.isfinite(value):
        return _UNKNOWN
    return f"{value:.{digits}f} {unit}".rstrip()


def _km(metres: float | None) -> str:
    return _UNKNOWN if metres is None else f"{metres / 1000.0:.2f} km"


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %" if math.isfinite(share) else _UNKNOWN
