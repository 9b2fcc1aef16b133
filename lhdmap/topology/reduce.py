"""From the skeleton to the junctions that count.

    skeleton -> spurs off -> near junctions joined -> niches off -> what nobody reached off

An opening is an arm at least as wide as the machine with room on either side that reaches `opening_m` beyond the wall; a junction
has three or more arms, driven or, in mines, seen; a bend has two, whatever its angle (docs/topology.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.topology.arms import reach_m
from lhdmap.topology.driven import DrivenShare, arc_m
from lhdmap.topology.edits import NO_EDITS, TopologyEdits
from lhdmap.topology.graph import Graph, Niche, Scale, end_of, whole_graph
from lhdmap.topology.settings import TopologySettings
from lhdmap.topology.sheet import Sheet
from lhdmap.topology.skeleton import Line, Skeleton, Vertex

_SPUR = 0.5  # of the opening's depth: shorter lines are the grid's
_THROAT_TOLERANCE = 0.85  # rough walls and cells make a throat look narrower
_THROAT_QUANTILE = 0.3
_LOOP_RADII = 3.0  # a loop within one junction is an obstacle
_MERGED_M = 40.0
_WIDTHS = 3.0  # of a tunnel: junctions farther apart are two, however wide the free space is
_REACHED_M = 1.0  # poses mark a metre around them


class DeadEnd(NamedTuple):
    """An arm that ends: its line in the skeleton, how deep it is beyond the corner of the walls, whether it is an opening."""

    line: Line
    depth_m: float
    counts: bool


def graph_of(
    sheet: Sheet,
    driven_m: FloatArray,
    scale: Scale,
    settings: TopologySettings,
    cuts: Sequence[FloatArray] = (),
    edits: TopologyEdits = NO_EDITS,
) -> Graph:
    """Return the junctions of a sheet along a drive at `driven_m` (N, 2).

    `cuts`: poses (4,) where the drive goes on in another sheet; `edits`: where junctions are to be one, or to stay apart.
    """
    graph = whole_graph(sheet, driven_m, scale, cuts)
    _take_small_loops_off(graph.skeleton)
    _take_spurs_off(graph, _SPUR * scale.opening_m)
    _join_near_junctions(graph, settings.merge, edits)
    _take_niches_off(graph, settings)
    _leave_out_what_was_not_reached(graph)
    _take_niches_off(graph, settings)
    return graph


def _take_small_loops_off(skeleton: Skeleton) -> None:
    """Remove lines from a vertex to itself that lie within its own room: pixels of the grid."""
    for line in list(skeleton.lines):
        if line.start == line.end and line.length_m < _LOOP_RADII * skeleton.vertices[line.start].radius_m:
            skeleton.remove(line)
    skeleton.straighten()


def _take_spurs_off(graph: Graph, depth_m: float) -> None:
    """Remove dead ends that reach less than a depth beyond the free radius of their junction, the shortest first."""
    skeleton = graph.skeleton
    while True:
        spurs = [line for line in skeleton.lines if _is_spur(graph, line, depth_m)]
        if not spurs:
            return
        # One at each junction in a round: what is left of a fork may be no spur any more.
        taken: set[int] = set()
        for line in sorted(spurs, key=lambda one: one.length_m):
            if not {line.start, line.end} & taken:
                taken |= {line.start, line.end}
                skeleton.remove(line)
        skeleton.straighten()


def _is_spur(graph: Graph, line: Line, depth_m: float) -> bool:
    skeleton = graph.skeleton
    start, end = skeleton.degree(line.start), skeleton.degree(line.end)
    if min(start, end) != 1 or max(start, end) < 3 or graph.goes_on(line.start if start == 1 else line.end):
        return False
    junction = skeleton.vertices[line.start if start > 1 else line.end]
    return line.length_m + graph.scale.core_m - junction.radius_m < depth_m


def _join_near_junctions(graph: Graph, share: float, edits: TopologyEdits) -> None:
    """Make one of junctions nearer to each other than a share of the sum of their free radii: of a tunnel's, not of a yard's."""
    skeleton, most_m = graph.skeleton, _WIDTHS * graph.scale.tunnel_m
    while True:
        near = [line for line in skeleton.lines if _is_inner(skeleton, line, (share, most_m), edits)]
        if not near:
            break
        line = min(near, key=lambda one: one.length_m)
        kept, gone = line.start, line.end
        a, b = skeleton.vertices[kept], skeleton.vertices.pop(gone)
        skeleton.vertices[kept] = Vertex(0.5 * (a.point_m + b.point_m), max(a.radius_m, b.radius_m))
        skeleton.lines = [one for one in skeleton.lines if one is not line]
        for one in skeleton.lines:
            one.start = kept if one.start == gone else one.start
            one.end = kept if one.end == gone else one.end
        longest = _LOOP_RADII * skeleton.vertices[kept].radius_m
        skeleton.lines = [one for one in skeleton.lines if not one.start == one.end == kept or one.length_m >= longest]
    skeleton.straighten()


def _is_inner(skeleton: Skeleton, line: Line, near: tuple[float, float], edits: TopologyEdits) -> bool:
    if line.start == line.end or skeleton.degree(line.start) < 3 or skeleton.degree(line.end) < 3:
        return False
    a, b = skeleton.vertices[line.start], skeleton.vertices[line.end]
    middle = 0.5 * (a.point_m + b.point_m)
    if _is_near(edits.apart_m, middle, line.length_m):
        return False
    if line.length_m < _MERGED_M and _is_near(edits.together_m, middle, line.length_m):
        return True
    share, most_m = near
    return line.length_m < min(share * (a.radius_m + b.radius_m), most_m)


def _is_near(places_m: FloatArray, point_m: FloatArray, reach_m: float) -> bool:
    return bool(len(places_m)) and float(np.linalg.norm(places_m - point_m, axis=1).min()) < reach_m


def _take_niches_off(graph: Graph, settings: TopologySettings) -> None:
    """Remove dead-end arms that are no openings, the shallowest first."""
    while True:
        shares = graph.shares()
        driven = {id(line): share for line, share in zip(graph.skeleton.lines, shares, strict=True)}
        niches = [
            end for vertex in graph.junctions() for end in _dead_ends(graph, vertex, driven, settings) if not end.counts
        ]
        if not niches:
            return
        taken: set[int] = set()
        for niche in sorted(niches, key=lambda one: one.depth_m):
            line = niche.line
            if {line.start, line.end} & taken:
                continue
            taken |= {line.start, line.end}
            mouth = line.points_m[0 if graph.skeleton.degree(line.start) > 1 else -1]
            graph.niches.append(Niche(mouth, niche.depth_m))
            graph.skeleton.remove(line)
        graph.skeleton.straighten()


def _dead_ends(graph: Graph, vertex: int, driven: dict[int, DrivenShare], settings: TopologySettings) -> list[DeadEnd]:
    """Return the arms of a junction that end."""
    lines, found = graph.lines_at(vertex), []
    degree = graph.skeleton.degree
    if all(degree(line.leaving(vertex).end) > 1 for line in lines):
        return []
    middle, axes = graph.axes(vertex)
    for k, (line, own) in enumerate(zip(lines, axes, strict=True)):
        arm = line.leaving(vertex)
        if degree(arm.end) > 1 or graph.goes_on(arm.end):
            continue
        begins = reach_m(own, axes[:k] + axes[k + 1 :], middle)
        end, direction, length = end_of(arm, graph.scale)
        beyond = float(graph.room.to_wall_m(end[None], direction[None])[0])
        depth = float(np.linalg.norm(arm.points_m[0] - middle)) + length + beyond - begins
        share = driven[id(line)]
        reached = share.from_start_m if line.start == vertex else share.from_end_m
        was_driven = reached - begins > 0.5 * graph.scale.machine_m + _REACHED_M
        seen = graph.scale.seen and _is_wide(graph, arm, begins, settings)
        found.append(DeadEnd(line, depth, depth >= graph.scale.opening_m and (was_driven or seen)))
    return found


def _is_wide(graph: Graph, arm: Line, begins_m: float, settings: TopologySettings) -> bool:
    """Return whether the machine fits into an arm's throat with room on either side."""
    along = arc_m(arm.points_m)
    throat = arm.radii_m[(along >= begins_m) & (along <= begins_m + graph.scale.opening_m)]
    wanted = graph.scale.machine_m + 2.0 * settings.throat_margin_m
    return len(throat) > 0 and 2.0 * float(np.quantile(throat, _THROAT_QUANTILE)) >= _THROAT_TOLERANCE * wanted


def _leave_out_what_was_not_reached(graph: Graph) -> None:
    """Take out lines that were only seen, where these do not count, and junctions that no driven line comes to."""
    skeleton = graph.skeleton
    while True:
        shares = graph.shares()
        driven = [_was_driven(graph, line, share) for line, share in zip(skeleton.lines, shares, strict=True)]
        if not graph.scale.seen:
            dropped = [line for line, is_driven in zip(skeleton.lines, driven, strict=True) if not is_driven]
            for line in dropped:
                skeleton.remove(line)
        else:
            lines = [line for line, is_driven in zip(skeleton.lines, driven, strict=True) if is_driven]
            reached = {end for line in lines for end in (line.start, line.end)}
            dropped = _cut_off(skeleton, {vertex for vertex in graph.junctions() if vertex not in reached})
        skeleton.straighten()
        if not dropped:
            return


def _was_driven(graph: Graph, line: Line, share: DrivenShare) -> bool:
    """Return whether a line counts as driven: most of it, or of a dead end that goes on, more than the junction's own room."""
    if share.share >= graph.driven_share:
        return True
    degree = graph.skeleton.degree
    if min(degree(line.start), degree(line.end)) != 1 or not share.share:
        return False
    from_start = share.from_start_m if degree(line.start) > 1 else 0.0
    from_end = share.from_end_m if degree(line.end) > 1 else 0.0
    return max(from_start, from_end) > graph.scale.tunnel_m + graph.scale.machine_m


def _cut_off(skeleton: Skeleton, strange: set[int]) -> list[Line]:
    """End the lines that lead to junctions which nobody was at, take out those beyond, and return what was changed."""
    changed = [line for line in skeleton.lines if {line.start, line.end} & strange]
    skeleton.lines = [line for line in skeleton.lines if not (line.start in strange and line.end in strange)]
    for line in skeleton.lines:
        if line.start in strange:
            line.start = _copied(skeleton, line.start)
        if line.end in strange:
            line.end = _copied(skeleton, line.end)
    for vertex in strange:
        skeleton.vertices.pop(vertex, None)
    return changed


def _copied(skeleton: Skeleton, vertex: int) -> int:
    """Return a new vertex at the place of another."""
    new = max(skeleton.vertices) + 1
    skeleton.vertices[new] = skeleton.vertices[vertex]
    return new
