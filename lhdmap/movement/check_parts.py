"""Checks of each part of a topological map by itself: what joins what, limits, room, what is open or closed."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from lhdmap.machine import Machine
from lhdmap.movement.findings import Finding
from lhdmap.movement.settings import MovementSettings
from lhdmap.settings import figure
from lhdmap.topology.model import DEAD_END, UNEXPLORED, AccessPoint, Intersection, TopologicalMap, Tunnel


def twin_findings(topology: TopologicalMap, settings: MovementSettings) -> Iterator[Finding]:
    """Yield access points that do not match the twin that they join: place, heading, whether it joins them, too."""
    points = {one.id: one for one in topology.access_points}
    for one in topology.access_points:
        if one.node not in topology.nodes:
            yield Finding("error", "twin", one.id, f"belongs to '{one.node}', which is no node of the map")
        if one.joins is None:
            if isinstance(topology.nodes.get(one.node), Intersection):
                yield Finding("warning", "twin", one.id, "an access point of an intersection that joins nothing")
            continue
        twin = points.get(one.joins)
        if twin is None:
            yield Finding("error", "twin", one.id, f"joins '{one.joins}', which is no access point of the map")
        elif twin.joins != one.id:
            yield Finding("error", "twin", one.id, f"joins {twin.id}, which joins {twin.joins or 'nothing'}")
        elif one.id < twin.id:
            yield from _mismatch(one, twin, settings)


def _mismatch(one: AccessPoint, twin: AccessPoint, settings: MovementSettings) -> Iterator[Finding]:
    where = f"{one.id}:{twin.id}"
    if one.node == twin.node:
        yield Finding("error", "twin", where, f"both belong to {one.node}")
    apart_m = float(np.linalg.norm(one.pose[:3] - twin.pose[:3]))
    if not apart_m <= settings.twin_m:
        yield Finding(
            "error", "twin", where, f"lie {apart_m:.2f} m apart; up to {figure(settings.twin_m)} m was wanted"
        )
    off_deg = abs(math.degrees(math.remainder(one.pose[3] - twin.pose[3] - math.pi, 2.0 * math.pi)))
    if not off_deg <= settings.twin_deg:
        text = f"do not face each other: {off_deg:.1f}° off; up to {figure(settings.twin_deg)}° was wanted"
        yield Finding("error", "twin", where, text)


def limit_findings(topology: TopologicalMap, machine: Machine) -> Iterator[Finding]:
    """Yield speed limits that contradict each other or the machine, and those that let nothing move."""
    top = machine.dimensions.max_speed_kmh
    tunnels = {one.id: one for one in topology.tunnels}
    limits = [
        *((one.name, one.id, one.speed_limit_kmh) for one in topology.tunnels),
        *((one.name, one.node, one.speed_limit_kmh) for one in topology.waypoints),
        *((f"{one.start}:{one.end}", _node(topology, one.start), one.speed_limit_kmh) for one in topology.connections),
    ]
    for where, node, limit in limits:
        tunnel = tunnels.get(node)
        if not limit > 0.0:
            yield Finding("error", "limit", where, f"a speed limit of {limit:g} km/h lets nothing pass")
        elif tunnel is not None and limit > tunnel.speed_limit_kmh:
            text = (
                f"its limit of {figure(limit)} km/h is above the {figure(tunnel.speed_limit_kmh)} km/h of {tunnel.name}"
            )
            yield Finding("warning", "limit", where, text)
        elif limit > top:
            yield Finding(
                "warning", "limit", where, f"its limit of {figure(limit)} km/h is above the machine's {figure(top)}"
            )


def room_findings(topology: TopologicalMap, settings: MovementSettings, machine: Machine) -> Iterator[Finding]:
    """Yield tunnels and connections that are narrow for the machine."""
    width = machine.dimensions.width_m
    wanted = width + 2.0 * settings.room_m
    for one in topology.tunnels:
        least = float(one.widths_m.min()) if len(one.half_widths_m) else math.nan
        if math.isnan(least):
            yield Finding("warning", "narrow", one.name, "its width is not known")
        elif least < wanted:
            at_m = _along(one, int(np.argmin(one.widths_m)))
            text = f"{least:.2f} m wide {at_m:.0f} m from its start; {wanted:.2f} m was wanted ({width:g} m + room)"
            yield Finding("error" if least < width else "warning", "narrow", one.name, text)
    for way in topology.connections:
        if way.feasible and way.clearance_m < settings.room_m:
            room = f"{way.clearance_m:.2f} m of room beside the machine"
            room = (
                room
                if way.clearance_m >= 0.0
                else f"the bodies reach {-way.clearance_m:.2f} m into the walls as mapped"
            )
            text = f"{room}; {settings.room_m:g} m was wanted"
            yield Finding("warning", "narrow", f"{way.start}:{way.end}", text)


def tunnel_findings(topology: TopologicalMap) -> Iterator[Finding]:
    """Yield tunnels that are not explored, closed, look the same over a stretch, or end nowhere."""
    for one in topology.tunnels:
        if UNEXPLORED in one.ends or not one.driven:
            yield Finding("note", "unexplored", one.name, "an opening that was seen and not driven")
        if one.closed:
            yield Finding("note", "closed", one.name, "the tunnel is closed")
        if one.not_distinctive_m:
            total = sum(end - begin for begin, end in one.not_distinctive_m)
            parts = ", ".join(f"{begin:.0f} to {end:.0f} m" for begin, end in one.not_distinctive_m)
            text = f"{total:.0f} m of {one.length_m:.0f} m do not tell where along it one is ({parts})"
            yield Finding("warning", "distinctive", one.name, text)
        for end in one.ends:
            if end not in (DEAD_END, UNEXPLORED) and not isinstance(topology.nodes.get(end), Intersection):
                yield Finding("error", "ends", one.name, f"ends at '{end}', which is no intersection of the map")


def connection_findings(topology: TopologicalMap) -> Iterator[Finding]:
    """Yield connections that are damaged, closed, or infeasible within a tunnel."""
    for way in topology.connections:
        where = f"{way.start}:{way.end}"
        missing = [end for end in (way.start, way.end) if end not in topology.points]
        if missing:
            yield Finding("error", "connection", where, f"the map has no point '{missing[0]}'")
        elif topology.points[way.start].node != topology.points[way.end].node:
            yield Finding("error", "connection", where, "joins points of two nodes: only access points do")
        elif not (math.isfinite(way.length_m) and way.length_m >= 0.0):
            yield Finding("error", "connection", where, f"its length is {way.length_m} m")
        elif not way.feasible and isinstance(topology.nodes.get(_node(topology, way.start)), Tunnel):
            yield Finding("warning", "infeasible", where, way.reason or "the machine cannot drive it")
        elif way.closed:
            yield Finding("note", "closed", where, "the connection is closed")


def _node(topology: TopologicalMap, point: str) -> str:
    return topology.points[point].node if point in topology.points else ""


def _along(tunnel: Tunnel, k: int) -> float:
    return float(np.linalg.norm(np.diff(tunnel.line_m[: k + 1], axis=0), axis=1).sum())
