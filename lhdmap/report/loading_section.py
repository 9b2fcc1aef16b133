"""A loading on the page of its replay: what the task did and why, its signals, the moments of touch."""

from __future__ import annotations

from collections.abc import Iterator

from lhdmap.report import charts, loading_charts, markup
from lhdmap.report.loading_charts import Span
from lhdmap.report.loading_data import LoadData
from lhdmap.report.replay_data import ReplayData

SIGNALS = (
    "Commands, angles, pressures, speeds and fill while the task goes through its states (shaded). The true fill is the "
    "simulator's; nobody in the loop sees it."
)
CHARGES = "The seconds around each touch: when the detector said so (0), what it heard, and how deep the lip truly was in rock."
PRESS = "Pressure of the tilt cylinder while the bucket is lowered: it is pressed to the floor before the charge."
MODEL = "Machine and ground are models: these figures are the model's, never a mine's."
_MOST = 100


def sections(data: ReplayData, load: LoadData) -> Iterator[str]:
    """Yield the sections of a loading."""
    spans = loading_charts.spans_of(data.changes.get("loading", ()), data.start_ns, data.verdict["duration_s"])
    yield markup.section("Loading", _told(data, spans) + markup.paragraph(MODEL))
    if len(load.rows):
        yield markup.section(
            "Signals", markup.picture(charts.svg_uri(loading_charts.signals_chart(load, spans)), SIGNALS)
        )
    for figure, words in (
        (loading_charts.charge_chart(load, spans), CHARGES),
        (loading_charts.press_chart(load, spans), PRESS),
    ):
        if figure is not None and len(load.rows):
            yield markup.picture(charts.svg_uri(figure), words)


def _told(data: ReplayData, spans: list[Span]) -> str:
    changes = data.changes.get("loading", ())
    rows = [
        (f"{span.from_s:.2f}", f"{span.to_s - span.from_s:.2f}", span.state.replace("_", " "), change.cause)
        for span, change in zip(spans, changes, strict=True)
    ][:_MOST]
    return (
        markup.table(("from, s", "for, s", "state", "why it began"), rows, numbers_from=0, numbers_to=2) if rows else ""
    )
