"""A rockbreaker plan on a page: figures, reasons, and pictures of the kind of the paper's Figs. 4, 7 and 8."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lhdmap.report import charts, markup, rockbreaker_charts
from lhdmap.rockbreaker.table import UNITS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from lhdmap.messages import FloatArray
    from lhdmap.rockbreaker.machine import Rockbreaker
    from lhdmap.rockbreaker.plan import Trajectory
    from lhdmap.rockbreaker.rocks import Scene

WAY = (
    "Way of the tip from above, start as a dot, end as a square; the rectangle is the grizzly. Grey rocks fall through its "
    "openings, orange ones do not; the outlined one is the target."
)
TIP = "Tip over time, as Fig. 7 of the paper."
CYLINDERS = "Lengths of the cylinders, as Fig. 8 (a) and (b)."
FLOWS = "Flow through valves and pump over their limits, as Fig. 8 (c) and (d). Where a curve touches 1, that valve sets the pace."
SPEED = (
    "How fast the tip goes along the path, and what the hydraulics allow there. The space between the curves is time that "
    "is not used."
)
PHI = "Orientation of the breaker along the path, and the region that the cylinders allow, as Fig. 4."
SIDE = (
    "The arm from the side, in the plane of its booms, each step from its start (pale) to its end. Bars and rocks are drawn at "
    "their distance from the swing axis; the bars along the middle of the grizzly."
)


def write_plan_report(
    path: Path,
    values: Mapping[str, Any],
    trajectories: Sequence[Trajectory],
    rows: FloatArray | None,
    scene: Scene | None,
) -> None:
    """Write one self-contained HTML page; `values` are those of `plan --json`, `rows` the sampled trajectory or None."""
    parts = [
        markup.section("What was planned", markup.cards(_figures(values)) + markup.listed(_notes(values), "warning"))
    ]
    if rows is not None:
        with charts.styled():
            parts += list(_pictures(trajectories, rows, scene))
        parts.append(markup.section("Columns of trajectory.csv", _columns()))
    path.write_text(markup.document("Rockbreaker plan", "".join(parts)), encoding="utf-8")


def write_workspace_report(
    path: Path, machine: Rockbreaker, values: Mapping[str, Any], at_m: FloatArray | None
) -> None:
    """Write the page of `lhdmap rockbreaker workspace`."""
    caption = "Where the tip can be at θ1 = 0, as Fig. 3 of the paper; swept over the swing's range it is the whole workspace."
    limits = values["theta_limits_deg"]
    rows = [(f"θ{k + 1}", f"{low:.3f}°", f"{high:.3f}°") for k, (low, high) in enumerate(limits)]
    with charts.styled():
        body = _picture(rockbreaker_charts.workspace_chart(machine, at_m), caption)
    body += markup.table(("joint", "lowest", "highest"), rows)
    path.write_text(
        markup.document("Workspace of the rockbreaker", markup.section("Workspace", body)), encoding="utf-8"
    )


def _notes(values: Mapping[str, Any]) -> list[str]:
    return [] if values["reason"] is None else [f"not feasible: {values['reason']['text']}"]


def _figures(values: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Yield name, value and meaning of the headline figures."""
    yield (
        "plan",
        "feasible" if values["feasible"] else "not feasible",
        f"{values['path'].upper()}, timing {values['timing']}",
    )
    if values.get("rock"):
        yield "rock", f"{values['rock']['size_m']:.2f} m", values["rock"]["why"]
    if not values["feasible"]:
        return
    duration_s, bound_s = values["duration_s"], values["bound_s"]
    parts = [f"{step['duration_s']:.2f} s" for step in values.get("steps") or ()]
    steps = f": step 1 {parts[0]}, step 2 {parts[1]}" if len(parts) > 1 else ""
    yield "duration", f"{duration_s:.2f} s", f"from rest to rest{steps}"
    times = f"{duration_s / max(bound_s, 1e-9):.2f} times that"
    yield "any-path bound", f"{bound_s:.2f} s", f"no path and no timing is faster; this plan takes {times}"
    highest = f"highest flow over its limit {values['max_flow_ratio']:.4f}"
    yield "set by", values["limiting"], f"at {values['limit_reached_at_s']:.1f} s; {highest}"
    yield "oil", f"{values['pump_volume_l']:.1f} L", "what the pump delivers"
    if values["clearance_m"] is not None:
        yield "clearance", f"{values['clearance_m']:.2f} m", "least distance of the links to what must not be touched"


def _pictures(trajectories: Sequence[Trajectory], rows: FloatArray, scene: Scene | None) -> Iterator[str]:
    draw, machine = rockbreaker_charts, trajectories[0].path.machine
    way = ((draw.plan_chart(trajectories, machine, scene), WAY), (draw.side_chart(trajectories, machine, scene), SIDE))
    charts_over_time = ((draw.tip_chart, TIP), (draw.cylinder_chart, CYLINDERS), (draw.flow_chart, FLOWS))
    times = tuple((chart(rows, trajectories), caption) for chart, caption in charts_over_time)
    yield _section("Way", way)
    yield _section("Over time", times)
    for number, one in enumerate(trajectories):
        step = f", {draw.step_name(number)}" if len(trajectories) > 1 else ""
        yield _section(f"Along the path{step}", ((draw.speed_chart(one), SPEED), (draw.orientation_chart(one), PHI)))


def _section(title: str, pictures: Sequence[tuple[Figure, str]]) -> str:
    return markup.section(title, "".join(_picture(figure, caption) for figure, caption in pictures))


def _columns() -> str:
    """Return what the columns of the table are."""
    return markup.table(("column", "unit and meaning"), list(UNITS.items()))


def _picture(figure: Figure, caption: str) -> str:
    return markup.picture(charts.svg_uri(figure), caption)
