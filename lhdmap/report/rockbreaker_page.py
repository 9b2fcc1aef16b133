"""A rockbreaker plan on a page: figures, reasons, and pictures of the kind of the paper's Figs. 4, 7 and 8."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lhdmap.report import charts, markup, rockbreaker_charts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from lhdmap.messages import FloatArray
    from lhdmap.rockbreaker.machine import Rockbreaker
    from lhdmap.rockbreaker.plan import Trajectory
    from lhdmap.rockbreaker.rocks import Scene

WAY = "Way of the tip from above, start as a dot, end as a square; the rectangle is the grizzly."
TIP = "Tip over time, as Fig. 7 of the paper."
CYLINDERS = "Lengths of the cylinders, as Fig. 8 (a) and (b)."
FLOWS = "Flow through valves and pump over their limits, as Fig. 8 (c) and (d). Where a curve touches 1, that valve sets the pace."
SPEED = (
    "How fast the tip goes along the path, and what the hydraulics allow there. The space between the curves is time that "
    "is not used."
)
PHI = "Orientation of the breaker along the path, and the region that the cylinders allow, as Fig. 4."
SIDE = "The arm from the side, in the plane of its booms, from the start (pale) to the end."


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
    yield "duration", f"{duration_s:.2f} s", "from rest to rest"
    times = f"{duration_s / max(bound_s, 1e-9):.2f} times that"
    yield "any-path bound", f"{bound_s:.2f} s", f"no path and no timing is faster; this plan takes {times}"
    highest = f"highest flow over its limit {values['max_flow_ratio']:.4f}"
    yield "set by", values["limiting"], f"at {values['limit_reached_at_s']:.1f} s; {highest}"
    yield "oil", f"{values['pump_volume_l']:.1f} L", "what the pump delivers"
    if values["clearance_m"] is not None:
        yield "clearance", f"{values['clearance_m']:.2f} m", "least distance of the links to what must not be touched"


def _pictures(trajectories: Sequence[Trajectory], rows: FloatArray, scene: Scene | None) -> Iterator[str]:
    draw, machine, last = rockbreaker_charts, trajectories[0].path.machine, trajectories[-1]
    way = ((draw.plan_chart(trajectories, machine, scene), WAY), (draw.side_chart(trajectories, machine), SIDE))
    times = ((draw.tip_chart(rows), TIP), (draw.cylinder_chart(rows), CYLINDERS), (draw.flow_chart(rows), FLOWS))
    along = ((draw.speed_chart(last), SPEED), (draw.orientation_chart(last), PHI))
    for title, pictures in (("Way", way), ("Over time", times), ("Along the path", along)):
        yield markup.section(title, "".join(_picture(figure, caption) for figure, caption in pictures))


def _picture(figure: Figure, caption: str) -> str:
    return markup.picture(charts.svg_uri(figure), caption)
