"""How the viewer is laid out: an oblique view that shows the whole map, a plan from above, curves and texts."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lhdmap.messages import FloatArray

FIELD_OF_VIEW_RAD, PLAN_ASPECT = 0.9, 2.5
Curves = tuple[tuple[str, tuple[str, ...]], ...]
RUN_CURVES: Curves = (
    ("Speed, m/s", ("motion/speed/**",)),
    ("Slip of the wheels, %", ("motion/slip",)),
    ("Standard deviation of a scan match", ("scan_match/deviation/**",)),
    ("Residual, direction not observed", ("scan_match/residual", "scan_match/weak")),
)
LOG_CURVES: Curves = (("Speed, m/s", ("motion/speed/**",)), ("Angles, deg", ("angles/**",)))


def blueprint(bounds_m: FloatArray | None, duration_ns: int, curves: Curves) -> Any:
    """Return the layout for a map within `bounds_m` (lower and upper corner, (2, 3); None: not known) and its drive.

    It opens at the end of the drive, where the whole cloud is seen; the views of `curves` (name and entities of each)
    show the whole drive.
    """
    import rerun.blueprint as rrb

    boundary = rrb.TimeRangeBoundary.absolute
    whole = rrb.TimeAxis(view_range=rrb.TimeRange(boundary(nanos=0), boundary(nanos=max(duration_ns, 1))))
    scene = ["+ map/**"]
    views = rrb.Vertical(
        rrb.Spatial3DView(name="Map", origin="map", contents=scene, eye_controls=_eye(bounds_m, oblique=True)),
        rrb.Spatial3DView(name="From above", origin="map", contents=scene, eye_controls=_eye(bounds_m, oblique=False)),
        row_shares=[3, 2],
    )
    plots = [rrb.TimeSeriesView(name=name, contents=list(entities), axis_x=whole) for name, entities in curves]
    column = rrb.Vertical(*plots, rrb.TextLogView(name="Texts", origin="log"))
    return rrb.Blueprint(
        rrb.Horizontal(views, column, column_shares=[2, 1]),
        rrb.TimePanel(state="collapsed", timeline="time", play_state="following"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def _eye(bounds_m: FloatArray | None, *, oblique: bool) -> Any:
    """Return an eye far enough away to see the bounds, from the south and above or from straight above."""
    import rerun.blueprint as rrb

    if bounds_m is None:
        return None
    target, span = bounds_m.mean(axis=0), np.maximum(bounds_m[1] - bounds_m[0], 5.0)
    half_height = 0.48 * float(np.linalg.norm(span)) if oblique else 0.57 * max(span[1], span[0] / PLAN_ASPECT)
    away = half_height / math.tan(FIELD_OF_VIEW_RAD / 2)
    direction = np.array([-0.35, -0.75, 0.55]) if oblique else np.array([0.0, -1e-3, 1.0])
    position = target + away * direction / np.linalg.norm(direction)
    return rrb.EyeControls3D(position=position, look_target=target, eye_up=(0, 0, 1) if oblique else (0, 1, 0))
