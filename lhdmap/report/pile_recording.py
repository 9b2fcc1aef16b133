"""The ore pile in a Rerun recording: face coloured by how far it stands out, hits by n_y, toe, limits, boulders, the attack point.

Entities: `map/pile/…`, `map/around` (static), `pile/…` (curves of the estimate over time).
"""

from __future__ import annotations

import math
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.pile.result import STATUSES, PileEstimate, PileReport
from lhdmap.report.pile_normals import across_colours, normal_cloud
from lhdmap.report.recording import RecordingWriter
from lhdmap.report.recording_end import rerun

CURVES = (
    ("Width, m", ("pile/width/**",)),
    ("Inclination, deg", ("pile/inclination/**",)),
    ("Probability", ("pile/probability/**",)),
)
_LEGEND = {
    "face": ("points, red to blue", "the pile's face: stands out of the fit, lies behind it"),
    "toe": ("pink line", "toe, the foot of the pile"),
    "limits": ("yellow points E_L, E_R", "left and right limit of the pile"),
    "boulders": ("orange ball", "boulder, with its size"),
    "attack": ("green arrow", "where to drive into the pile"),
}
_PROUD_M = 0.5  # end of the colours
_ARROW_M = 2.5
_DIVERGING = np.array([[67, 147, 195], [240, 240, 240], [214, 96, 77]], dtype=float)
_COLOURS = dict(zip(STATUSES, (0x009E73FF, 0xE69F00FF, 0x2F86C9FF, 0xCC79A7FF, 0x8A949EFF), strict=True))


def write_pile_recording(report: PileReport, path: Path, title: str) -> None:
    """Write a `.rrd` file of what is said of the pile."""
    stamps = [one.stamp_ns for one in report.history]
    with RecordingWriter(path, title, stamps[0] if stamps else 0) as writer:
        writer.layout.curves = ()
        add_pile(writer, report, report.around_m)


def add_pile(
    writer: RecordingWriter, report: PileReport, around_m: FloatArray | None = None, said: Collection[str] = ()
) -> None:
    """Add the last estimate and its course to a recording; nothing is drawn where it is none.

    `around_m` (N, 3): hits around the pile, where the recording has no cloud of its own; `said`: texts that are in it already.
    """
    writer.layout.curves = (*writer.layout.curves, *CURVES)
    _add_course(writer, report)
    for one in report.piles:
        writer.add_text(f"pile decided: {one.decision.estimate.status}", one.decision.stamp_ns, "INFO")
    pile = report.estimate
    if not pile.found:
        return
    writer.widen(np.vstack([pile.toe_m, pile.face_m]))
    for text in pile.warnings:
        if text not in said:
            writer.add_text(text)
    for name, shape in _shapes(pile).items():
        writer.add_shape(f"map/pile/{name}", shape)
        if name in _LEGEND:
            writer.explain(*_LEGEND[name])
    normals = normal_cloud(report, pile)
    if len(normals.across):
        writer.add_shape("map/pile/n_y", _dots(normals.points_m, across_colours(normals.across), 2.0))
        writer.explain("points, dark blue and dark red", "walls that face right (n_y = -1) and left (n_y = +1)")
    if around_m is not None and len(around_m):
        writer.add_shape("map/around", _dots(around_m))
        writer.widen(around_m)


def _dots(points_m: FloatArray, colours: int | npt.NDArray[np.uint32] = 0x8A949EFF, size: float = 1.2) -> Any:
    rr = rerun()
    return rr.Points3D(points_m, colors=colours, radii=rr.Radius.ui_points(size))


def _shapes(pile: PileEstimate) -> dict[str, Any]:
    """Return what is drawn, by name."""
    rr = rerun()
    pixels = rr.Radius.ui_points
    limits = np.vstack([pile.left_limit_m, pile.right_limit_m])
    across = (limits[0] - limits[1]) / max(float(np.linalg.norm(limits[0] - limits[1])), 1e-9)
    reach = 2.0 * float(np.nan_to_num(pile.width_std_m)) / math.sqrt(2.0) * across
    shapes = {
        "face": rr.Points3D(pile.face_m, colors=residual_colours(pile.residuals_m), radii=pixels(2.5)),
        "toe": rr.LineStrips3D([pile.toe_m], colors=0xCC79A7FF, radii=pixels(2.5)),
        "limits": rr.Points3D(limits, colors=0xF0C419FF, radii=pixels(6.0), labels=["E_L", "E_R"]),
        "limits/deviation": rr.LineStrips3D([[at - reach, at + reach] for at in limits], colors=0xF0C419FF),
    }
    if pile.boulders:
        centres, sizes = [one.center_m for one in pile.boulders], [one.size_m for one in pile.boulders]
        half = 0.5 * np.tile(np.array(sizes)[:, None], 3)
        labels = [f"{size:.1f} m" for size in sizes]
        shapes["boulders"] = rr.Ellipsoids3D(centers=centres, half_sizes=half, colors=0xD55E00FF, labels=labels)
    if pile.attack is not None:
        heading = pile.attack.heading_rad
        ahead = _ARROW_M * np.array([math.cos(heading), math.sin(heading), 0.0])
        start = pile.attack.point_m + np.array([0.0, 0.0, 0.1]) - ahead
        shapes["attack"] = rr.Arrows3D(origins=[start], vectors=[ahead], colors=0x009E73FF, radii=0.05)
    return shapes


def _add_course(writer: RecordingWriter, report: PileReport) -> None:
    """Add width and inclination with two deviations to both sides, and the probabilities, over time."""
    seen = [one for one in report.history if one.estimate.found]
    if not seen:
        return
    stamps = np.array([one.stamp_ns for one in seen], dtype=np.int64)
    width = np.array([(one.estimate.width_m, one.estimate.width_std_m) for one in seen])
    slope = np.array([(one.estimate.inclination_deg, one.estimate.inclination_std_deg) for one in seen])
    for name, values in (("width", width), ("inclination", slope)):
        for part, k in (("low", -2.0), ("value", 0.0), ("high", 2.0)):
            colour, label = (0x2F86C9FF, name) if k == 0.0 else (0x8CC4EEFF, f"{k:+.0f} deviations")
            writer.add_curve(f"pile/{name}/{part}", stamps, values[:, 0] + k * values[:, 1], colour, label)
    for name in STATUSES:
        share = np.array([one.estimate.probabilities.get(name, 0.0) for one in seen])
        if share.max() > 0.02:
            writer.add_curve(f"pile/probability/{name}", stamps, share, _COLOURS[name], name.replace("_", " "))


def residual_colours(residuals_m: FloatArray) -> npt.NDArray[np.uint32]:
    """Return 0xRRGGBBAA of residuals (N,): red stands out towards the machine, blue lies behind."""
    share = np.clip(0.5 + 0.5 * residuals_m / _PROUD_M, 0.0, 1.0) * 2.0
    r, g, b = (np.interp(share, range(3), _DIVERGING[:, i]).astype(np.uint32) for i in range(3))
    return r << 24 | g << 16 | b << 8 | np.uint32(255)
