"""Who judges several machines together: by the truth, which sections the body of each is in, and whether two share one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from lhdmap.driving.bodies import Bodies
from lhdmap.geometry import se2
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.navigation.presence import Presence
from lhdmap.replay.journal import Scribe
from lhdmap.replay.namespace import topic_of
from lhdmap.replay.parts import State
from lhdmap.replay.process import EVERYWHERE, MILLISECOND_NS, STATE, Outgoing, Process, Received
from lhdmap.simulation.history import SECOND_NS, START_NS
from lhdmap.topology.model import TopologicalMap

SECTION_WATCH = "crew/monitor"


class SectionWatch(Process):
    """Each 0.1 s; `machines`: names with their namespaces, `section_of`: by nodes (ids), `T_mine_map` (4,: x, y, z, yaw)."""

    name, period_ns, priority, site = SECTION_WATCH, 100 * MILLISECOND_NS, 85, EVERYWHERE

    def __init__(
        self,
        machines: Mapping[str, str],
        topology: TopologicalMap,
        section_of: Mapping[str, str],
        T_mine_map: FloatArray,
        bodies: tuple[Bodies, Machine],
        scribe: Scribe,
    ) -> None:
        self._name_of = {topic_of(space, STATE): name for name, space in machines.items()}
        self.reads = tuple(self._name_of)
        self._presence, self._section_of, self._T_mine_map = Presence(topology, *bodies), section_of, T_mine_map
        self._states: dict[str, State] = {}
        self._shared: set[tuple[str, str, str]] = set()
        self._scribe = scribe
        self.shared: list[dict[str, Any]] = []

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterable[Outgoing]:
        """Take where all are; note who shares a section from now on."""
        for received in inbox:
            self._states[self._name_of[received.topic]] = received.message
        held = {name: self.sections_of(state) for name, state in self._states.items()}
        now = {(a, b, one) for a, b in combinations(sorted(held), 2) for one in held[a] & held[b]}
        for a, b, section in sorted(now - self._shared):
            entry = {"t_s": (now_ns - START_NS) / SECOND_NS, "machines": [a, b], "section": section}
            self.shared.append(entry)
            self._scribe.event("section shared", f"{a} and {b} in {section}", **entry)
        self._shared = now
        return ()

    def sections_of(self, state: State) -> set[str]:
        """Return the sections that a machine truly is in with any part of it."""
        x0, y0, z0, yaw = self._T_mine_map.tolist()
        place = np.array([state.x_m, state.y_m, state.yaw_rad])
        T_map_base = se2.compose(se2.inverse(np.array([x0, y0, yaw])), place)
        nodes = self._presence.nodes(T_map_base, state.z_m - z0, state.articulation_rad)
        return {self._section_of.get(node, node) for node in nodes}
