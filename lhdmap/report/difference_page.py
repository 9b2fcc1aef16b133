"""What a new version of a map has that the one before had not, on its page: pictures, and a table of tunnels, nodes and walls."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from lhdmap.report import markup
from lhdmap.report.data import ReportData

_MOST_ROWS = 200


def section(data: ReportData) -> str:
    """Return the section of the difference; nothing where the map is a first version."""
    if data.difference is None:
        return ""
    table = data.difference.table
    words = f"Version {table['to_version']} against version {table['from_version']}"
    rows = list(difference_rows(table))
    if not rows:
        body = markup.paragraph(f"{words}: nothing is different.")
    else:
        body = markup.paragraph(f"{words}.") + markup.table(("", "what", "before and now"), rows[:_MOST_ROWS])
        if len(rows) > _MOST_ROWS:
            body += markup.paragraph(f"{len(rows) - _MOST_ROWS} more stand in difference.json.")
    return markup.section(
        "What is different", body + "".join(markup.picture(one.uri, one.caption) for one in data.difference.pictures)
    )


def difference_rows(table: Mapping[str, Any]) -> Iterator[Sequence[str]]:
    """Yield the rows of the difference: what happened, to what, by how much."""
    yield from (("new tunnel", name, "") for name in table["tunnels_new"])
    yield from (("tunnel is gone", name, "") for name in table["tunnels_gone"])
    for one in table["tunnels_changed"]:
        (long, longer), (wide, wider) = one["length_m"], one["width_min_m"]
        yield ("tunnel changed", one["name"], f"length {long} → {longer} m, least width {wide} → {wider} m")
    yield from (("new intersection", name, "") for name in table["nodes_new"])
    for one in table["nodes_moved"]:
        before, now = one["degree"]
        arms = f", {before} → {now} arms" if before != now else ""
        yield ("intersection moved", one["name"], f"by {one['by_m']:.2f} m{arms}")
    yield from (("new waypoint", name, "") for name in table["waypoints_new"])
    for one in table["walls"]:
        for key, what in (("came", "wall came"), ("went", "wall went")):
            if one[f"{key}_m2"]:
                x, y = one[f"{key}_at_m"]
                yield (what, f"around x {x:.1f}, y {y:.1f} m", f"{one[f'{key}_m2']:.1f} m²")
