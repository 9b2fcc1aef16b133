"""The work at a grizzly on a page: what was found, in which order it was broken, what each blow did."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lhdmap.report import charts, markup
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.rockbreaker.story import Story

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PLAN = (
    "The grizzly from above: rocks as they were seen at first, the level ways of the tip, and the blows, numbered by "
    "their places in the order of the work."
)
TIME = "Rocks that are too large, as seen at each look, and the height of the tip; crosses are blows."
SIMULATED = "All of this is simulated: how rock breaks is assumed, and the figures are those of a model."
_APART_M = 0.25  # blows nearer to each other have one number
_OUTCOMES = {"broke": charts.TRUTH, "cracked": charts.ODOMETRY, "rolled": charts.WHEELS, "missed": charts.FLAGGED}


def write_grizzly_report(
    path: Path, title: str, verdict: Mapping[str, Any], machine: Rockbreaker, story: Story, made: Mapping[str, str]
) -> None:
    """Write one self-contained HTML page; `made` says how the run was made."""
    parts = [markup.section("What happened", markup.cards(_cards(verdict)) + markup.paragraph(SIMULATED))]
    if story.rows and story.looks:
        with charts.styled():
            parts.append(markup.section("Way", _picture(plan_chart(machine, story), PLAN)))
            parts.append(markup.section("Over time", _picture(time_chart(story), TIME)))
    rows = [
        (number + 1, f"{one.at_s:.1f}", f"{one.rock.top_m[0]:.2f}, {one.rock.top_m[1]:.2f}", f"{one.rock.size_m:.2f}", one.outcome)
        for number, one in enumerate(story.stops)
    ]  # fmt: skip
    head = ("blow", "time, s", "rock at x, y, m", "size as seen, m", "what it did")
    parts.append(markup.section("Blows", markup.table(head, rows, numbers_from=0, numbers_to=4) if rows else ""))
    told = [(key, _figure(value)) for key, value in verdict.items() if key != "contacts"]
    parts.append(markup.section("Verdict", markup.table(("", ""), told)))
    parts.append(markup.section("How it was made", markup.table(("", ""), list(made.items()))))
    path.write_text(markup.document(title, "".join(parts)), encoding="utf-8")


def _cards(verdict: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    yield "verdict", "ok" if verdict["ok"] else "not ok", str(verdict["reason"])
    yield "rocks", str(verdict["rocks"]), f"too large at first; {verdict['rocks_left']} at the end"
    yield "time", f"{verdict['duration_s']:.0f} s", f"of which moving {verdict['moving_s']:.0f} s"
    yield "blows", str(verdict["blows"]), f"and {verdict['looks']} looks"
    yield "plans", str(verdict["plans"]), f"{verdict['plans_invalid']} of them not valid"
    if verdict["over_best"] is not None:
        more = 100.0 * (verdict["over_best"] - 1.0)
        yield "order", f"+{more:.1f} %", "of the time, over the best order of the same blows, known afterwards"
    if verdict["min_clearance_m"] is not None:
        yield (
            "clearance",
            f"{verdict['min_clearance_m']:.2f} m",
            "least distance of the arm from what it must not touch",
        )


def plan_chart(machine: Rockbreaker, story: Story) -> Figure:
    """Draw rocks, ways and blows from above."""
    from matplotlib.patches import Circle, Rectangle

    low, high = np.array(machine.grizzly.min_m), np.array(machine.grizzly.max_m)
    figure = charts.new_figure(5.2)
    axes = figure.add_subplot()
    axes.add_patch(Rectangle((low[0], low[1]), *(high - low), fill=False, edgecolor="#8a949e", linewidth=1.2))
    for rock in story.looks[0].oversize:
        place = (float(rock.top_m[0]), float(rock.top_m[1]))
        axes.add_patch(Circle(place, 0.5 * rock.length_m, facecolor=charts.ODOMETRY, alpha=0.35, linewidth=0))
    for move in story.moves:
        if move.level:
            axes.plot(move.way_m[:, 0], move.way_m[:, 1], color=charts.FINAL, linewidth=1.2)
    _draw_blows(axes, story)
    axes.plot(0.0, 0.0, "^", color=charts.INK, markersize=8, label="swing axis")
    axes.plot(*machine.base.park_m[:2], "D", color=charts.INK, markersize=6, label="tip waits")
    axes.set(
        aspect="equal", xlabel="x, m", ylabel="y, m", xlim=(-0.5, high[0] + 0.8), ylim=(low[1] - 0.6, high[1] + 0.6)
    )
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
    return figure


def _draw_blows(axes: Axes, story: Story) -> None:
    named: set[str] = set()
    numbered: list[tuple[float, float]] = []
    for stop in story.stops:
        x, y = float(stop.rock.top_m[0]), float(stop.rock.top_m[1])
        label = None if stop.outcome in named else stop.outcome
        named.add(stop.outcome)
        axes.plot(x, y, "o", color=_OUTCOMES.get(stop.outcome, charts.INK), markersize=6, label=label)
        if all(np.hypot(x - u, y - v) > _APART_M for u, v in numbered):
            numbered.append((x, y))
            axes.annotate(str(len(numbered)), (x, y), (5.0, 4.0), textcoords="offset points", fontsize=9.0)


def time_chart(story: Story) -> Figure:
    """Draw rocks that are left and the height of the tip over time."""
    figure = charts.new_figure(3.6)
    upper, lower = figure.subplots(2, 1, sharex=True)
    at_s = [look.at_s for look in story.looks]
    upper.step(at_s, [len(look.oversize) for look in story.looks], where="post", color=charts.WHEELS)
    upper.set(ylabel="rocks too large")
    rows = story.table()
    kept = charts.thinned(len(rows))
    lower.plot(story.began_s + rows[kept, 0], rows[kept, 14], color=charts.FINAL, linewidth=1.0)
    lower.plot([one.at_s for one in story.stops], [one.rock.top_m[2] for one in story.stops], "x", color=charts.INK)
    lower.set(xlabel="time, s", ylabel="tip z, m", xlim=(0.0, story.began_s + float(rows[-1, 0])))
    return figure


def _picture(figure: Figure, caption: str) -> str:
    return markup.picture(charts.svg_uri(figure), caption)


def _figure(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
