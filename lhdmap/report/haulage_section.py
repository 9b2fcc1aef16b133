"""What the page of a replay says of a surface site: both bodies on the way, and how the machine stood at its places."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from lhdmap.report import markup


def cards(verdict: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Yield name, value and meaning of the headline figures; nothing where there is no site."""
    if verdict.get("sum_rms_m") is None:
        return
    most = f"z0 + z1, rms while driven forward; at most {verdict['sum_max_m']:.2f} m"
    yield "both bodies", f"{verdict['sum_rms_m']:.3f} m", most
    used = f"of {verdict['half_lane_m']:.2f} m, on road and junctions"
    yield "half a lane used", f"{verdict['half_lane_used_m']:.2f} m", used


def docks(verdict: Mapping[str, Any]) -> str:
    """Return how the machine truly stood at its places, as a table."""
    rows = [
        (one["place"], f"{one['off_m']:.3f}", f"{one['aside_m']:.3f}", f"{one['off_deg']:.2f}")
        for one in verdict.get("docks", ())
    ]
    head = ("place", "off, m", "of it aside, m", "heading off, deg")
    return markup.table(head, rows, numbers_from=1, numbers_to=4) if rows else ""
