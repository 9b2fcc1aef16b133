"""How the viewer is laid out: an oblique view that shows the whole map, a plan from above, curves and texts."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lhdmap.messages import Float32Array, FloatArray
from lhdmap.report.recording_end import rerun

FIELD_OF_VIEW_RAD = 0.9  # of the viewer, upright
ASPECT, PLAN_ASPECT = 1.6, 2.5  # of the two views in a window of usual shape
_MARGIN = 1.06
_STRAY = 0.5  # of the map's extent: points that are farther away than this do not count for the view
Curves = tuple[tuple[str, tuple[str, ...]], ...]
RUN_CURVES: Curves = (
    ("Speed, m/s", ("motion/speed/**",)),
    ("Slip of the wheels, %", ("motion/slip",)),
    ("Standard deviation of a scan match", ("scan_match/deviation/**",)),
    ("Residual, direction not observed", ("scan_match/residual", "scan_match/weak")),
)
REPLAY_CURVES: Curves = (
    ("Speed, km/h", ("motion/speed/**",)),
    ("Joint, deg, and steering, deg/s", ("motion/articulation", "motion/steering")),
    ("Clearance, m", ("motion/clearance/**",)),
    ("States", ("state/**",)),
    ("Place by localization less the true one", ("place/**",)),
    ("Boom and bucket, rad", ("loading/angles/**",)),
    ("Pressures, bar", ("loading/pressure/**",)),
    ("Fill", ("loading/fill/**",)),
)
REPLAY_GRAPH = ("map/base_link/**", "map/plan/**", "map/path/**")
"""Of a drive on a map: what is seen beside the map."""
GRAPH = ("+ map/topology/**", "+ map/route/**", "+ map/pile/**")
LOG_CURVES: Curves = (("Speed, m/s", ("motion/speed/**",)), ("Angles, deg", ("angles/**",)))


class ViewerLayout:
    """What the viewer's layout depends on: what was drawn, how far it reaches, and what it means.

    `curves`: views of curves; `has_topology`: the map's graph has a view of its own, where `beside_topology` is seen, too.
    """

    def __init__(self) -> None:
        self.curves, self.has_topology = RUN_CURVES, False
        self.beside_topology: tuple[str, ...] = ()
        self._bounds: FloatArray | None = None
        self._drawn: set[str] = set()
        self._legend: dict[str, None] = {}  # in the order of the first mention

    def draws(self, entity: str) -> None:
        """Note that a curve was recorded."""
        self._drawn.add(entity)

    def explain(self, drawn: str, meaning: str) -> None:
        """Add a line to the legend, once."""
        self._legend.setdefault(f"| {drawn} | {meaning} |")

    def widen(self, points_m: npt.NDArray[np.floating[Any]]) -> None:
        """Widen the bounds so that they hold the points (N, 3) in map."""
        seen = points_m if self._bounds is None else np.vstack([self._bounds, points_m])
        self._bounds = np.array([seen.min(axis=0), seen.max(axis=0)], dtype=float)

    @property
    def legend(self) -> str:
        """The legend as a table in Markdown; empty where nothing was explained."""
        if not self._legend:
            return ""
        return "\n".join(["| drawn | what it is |", "| --- | --- |", *sorted(self._legend)])

    @property
    def used(self) -> Curves:
        """The views that have a curve: of an entity, or of what is below it (`…/**`)."""
        return tuple(view for view in self.curves if any(self._has(entity) for entity in view[1]))

    def _has(self, pattern: str) -> bool:
        return any(entity.startswith(pattern.removesuffix("**")) for entity in self._drawn)

    def blueprint(self, curves: Curves, duration_ns: int) -> Any:
        """Return the layout with some views of curves."""
        words, graph = bool(self._legend), self.has_topology
        return blueprint(self._bounds, duration_ns, curves, legend=words, topology=graph, beside=self.beside_topology)


def blueprint(
    bounds_m: FloatArray | None,
    duration_ns: int,
    curves: Curves,
    *,
    legend: bool = False,
    topology: bool = False,
    beside: Sequence[str] = (),
) -> Any:
    """Return the layout for a map within `bounds_m` (lower and upper corner, (2, 3); None: not known) and its drive.

    It opens at the end of the drive, where the whole cloud is seen; the views of `curves` (name and entities of each)
    show the whole drive. `topology`: it has a view of its own, in front of that from above, and is left out of the others;
    `beside`: entities that this view has, too.
    """
    rrb = rerun().blueprint
    boundary = rrb.TimeRangeBoundary.absolute
    whole = rrb.TimeAxis(view_range=rrb.TimeRange(boundary(nanos=0), boundary(nanos=max(duration_ns, 1))))
    scene = ["+ map/**", *(["- map/topology/**"] if topology else [])]
    above = _view("From above", scene, bounds_m, oblique=False)
    if topology:
        above = rrb.Tabs(
            _view("Topology", (*GRAPH, *(f"+ {one}" for one in beside)), bounds_m, oblique=False), above, active_tab=0
        )
    views = rrb.Vertical(_view("Map", scene, bounds_m, oblique=True), above, row_shares=[1, 1] if topology else [3, 2])
    plots = [rrb.TimeSeriesView(name=name, contents=list(entities), axis_x=whole) for name, entities in curves]
    later = "Place" if any("place/**" in entities for _, entities in curves) else "Pile"
    groups = [rrb.Vertical(*group, name=name) for name, group in (("Drive", plots[:4]), (later, plots[4:])) if group]
    middle = [rrb.Tabs(*groups) if len(groups) > 1 else group for group in groups[:1]]
    words = [rrb.TextDocumentView(name="What is drawn", origin="legend")] if legend else []
    shares = [2.0] * len(words) + [float(min(len(plots), 4))] * len(middle) + [1.0]
    column = rrb.Vertical(*words, *middle, rrb.TextLogView(name="Texts", origin="log"), row_shares=shares)
    return rrb.Blueprint(
        rrb.Horizontal(views, column, column_shares=[2, 1]),
        rrb.TimePanel(state="collapsed", timeline="time", play_state="following"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def _view(name: str, contents: Sequence[str], bounds_m: FloatArray | None, *, oblique: bool) -> Any:
    rrb = rerun().blueprint
    eye = _eye(bounds_m, oblique=oblique)
    return rrb.Spatial3DView(name=name, origin="map", contents=list(contents), eye_controls=eye)


def _eye(bounds_m: FloatArray | None, *, oblique: bool) -> Any:
    """Return an eye that sees the bounds whole, from the south and above or from straight above."""
    rrb = rerun().blueprint
    if bounds_m is None:
        return None
    position, target = eye_of(bounds_m, oblique=oblique)
    return rrb.EyeControls3D(position=position, look_target=target, eye_up=(0, 0, 1) if oblique else (0, 1, 0))


def eye_of(bounds_m: FloatArray, *, oblique: bool) -> tuple[FloatArray, FloatArray]:
    """Return where the eye is (3,) and what it looks at (3,), so near that all corners of the bounds (2, 3) are just seen."""
    target, span = bounds_m.mean(axis=0), np.maximum(bounds_m[1] - bounds_m[0], 5.0)
    back = np.array([-0.35, -0.75, 0.55]) if oblique else np.array([0.0, -1e-3, 1.0])
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0] if oblique else [0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    corners = 0.5 * span * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    upright = math.tan(FIELD_OF_VIEW_RAD / 2)
    across = np.abs(corners @ right) / (upright * (ASPECT if oblique else PLAN_ASPECT))
    high = np.abs(corners @ np.cross(back, right)) / upright
    away = float((np.maximum(across, high) + corners @ back).max())
    return target + _MARGIN * away * back, target


def whole_of(points_m: Float32Array) -> FloatArray:
    """Return lower and upper corner (2, 3) of points (N, 3): of all of them, unless a few stray ones are far from the rest."""
    low, high = points_m.min(axis=0).astype(float), points_m.max(axis=0).astype(float)
    core = np.percentile(points_m[:: max(1, len(points_m) // 20_000)], [0.5, 99.5], axis=0)
    reach = _STRAY * np.maximum(core[1] - core[0], 5.0)
    return np.array([np.maximum(low, core[0] - reach), np.minimum(high, core[1] + reach)])
