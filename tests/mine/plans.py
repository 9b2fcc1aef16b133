"""Small mines for tests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lhdmap.mine.make_network import make_network
from lhdmap.mine.network import Network
from lhdmap.mine.plan import MinePlan
from lhdmap.settings_tree import tree_from

TEE = {
    "name": "tee",
    "drift": [
        {"name": "A", "line_m": [[0, 0, 0], [80, 0, 0]]},
        {"name": "B", "line_m": [[40, 0, 0], [40, 50, 0]]},
    ],
}


def plan_of(table: dict[str, Any], **more: Any) -> MinePlan:
    """Return the plan of a table as in a TOML file."""
    return tree_from(MinePlan, {**table, **more})


def network_of(table: dict[str, Any], **more: Any) -> Network:
    """Return the network of such a table."""
    return make_network(plan_of(table, **more))


def lines(*drifts: tuple[str, Sequence[Sequence[float]]]) -> dict[str, Any]:
    """Return a plan of drifts with these centre lines alone."""
    return {"drift": [{"name": name, "line_m": line} for name, line in drifts]}
