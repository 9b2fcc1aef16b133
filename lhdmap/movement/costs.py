"""What a movement costs: the time that it takes, from lengths, speed limits, stops and changes of gear."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.movement.settings import MovementSettings
from lhdmap.movement.ways import Bools, Ways
from lhdmap.topology.model import TopologicalMap

_TIE = 1e-6
"""Of two ways that cost the same, the one with fewer states is taken, and that in forward gear: s for a link, s/s in reverse."""


@dataclass(frozen=True, slots=True)
class Pace:
    """Speeds and accelerations (m/s, m/s2) of a machine, loaded or empty, and how long it takes to change gear or to turn (s)."""

    forward_mps: float
    reverse_mps: float
    acceleration_mps2: float
    deceleration_mps2: float
    inversion_s: float
    turn_s: float

    def speed_mps(self, limit_mps: FloatArray, gear: npt.NDArray[np.int8] | int) -> FloatArray:
        """Return the speeds (N,) that limits (N,) and gears (N,) (+1 forward, -1 reverse) allow."""
        own = np.where(np.asarray(gear) < 0, self.reverse_mps, self.forward_mps)
        speeds: FloatArray = np.minimum(limit_mps, own)
        return speeds


def pace_of(settings: MovementSettings, *, loaded: bool = False) -> Pace:
    """Return the pace of a loaded or an empty machine."""
    forward = settings.limit_loaded_kmh if loaded else settings.limit_empty_kmh
    return Pace(
        forward / 3.6,
        min(forward, settings.limit_reverse_kmh) / 3.6,
        settings.acceleration_mps2,
        settings.deceleration_mps2,
        settings.inversion_s,
        settings.turn_s,
    )


def edge_costs(
    ways: Ways, pace: Pace, way: npt.NDArray[np.int32], gear: npt.NDArray[np.int8], from_stop: Bools, to_stop: Bools
) -> FloatArray:
    """Return what each edge (E,) of the movement map costs, s: its way, gear, and whether it begins and ends standing.

    Length over speed; what is lost against that while the machine gathers speed v, v / 2a, or loses it, v / 2d; and, at each
    stop on the way, the change of gear (who stops and goes on in the same gear would better not have stopped). A link between
    twins has no length and no speed of its own: from standing to moving it costs as at the highest speed of the ways around, so
    that it is no way round those losses. Where a stop follows a stop within a few metres the losses are somewhat too large
    here; `lhdmap.movement.profile` has the times that are told.
    """
    peak = ways.peak_mps
    around = np.maximum(peak[ways.start], peak[ways.end])
    speed = pace.speed_mps(np.where(ways.within, ways.limit_mps, around)[way], gear)
    driving = np.divide(ways.length_m[way], speed, out=np.zeros(len(way)), where=ways.length_m[way] > 0.0)
    stays = from_stop & to_stop
    gathered = np.where(from_stop & ~stays, speed / (2.0 * pace.acceleration_mps2), 0.0)
    lost = np.where(to_stop & ~stays, speed / (2.0 * pace.deceleration_mps2) + pace.inversion_s, 0.0)
    tie = np.where(ways.within[way], np.where(gear < 0, _TIE * driving, 0.0), _TIE)
    cost: FloatArray = driving + gathered + lost + tie
    return cost


def connection_times(topology: TopologicalMap, settings: MovementSettings) -> dict[tuple[str, str], float]:
    """Return the time (s) to drive through each connection (start, end), forward, empty and without a stop: `cost_s` of the map.

    Where two connections join the same points, the quicker one counts.
    """
    pace = pace_of(settings)
    limits = {one.id: one.speed_limit_kmh for one in topology.tunnels}
    times: dict[tuple[str, str], float] = {}
    for one in topology.connections:
        node = topology.points[one.start].node if one.start in topology.points else ""
        limit_kmh = min(one.speed_limit_kmh, limits.get(node, one.speed_limit_kmh))
        time_s = one.length_m / min(limit_kmh / 3.6, pace.forward_mps) if limit_kmh > 0.0 else np.inf
        times[one.start, one.end] = min(time_s, times.get((one.start, one.end), np.inf))
    return times
