"""The words of the pages, explained; `docs/glossary.md` holds the same texts (a test compares)."""

from __future__ import annotations

import re
from typing import NamedTuple

from lhdmap.report import markup


class Term(NamedTuple):
    """A word, what it means, and the pattern by which a page is known to use it (empty: the word itself)."""

    word: str
    meaning: str
    pattern: str = ""


TERMS = (
    Term(
        "access point",
        "Where a node of the topology ends, facing outward. Two nodes meet where their access points are one place, facing each "
        "other.",
    ),
    Term(
        "adaptive rate",
        "Scans are matched only when the machine has moved far enough for one to tell something new; the others get their pose "
        "from the motion between.",
    ),
    Term(
        "attack point",
        "Where on the toe to drive into the pile, and in which direction: where the face stands out, clear of the walls.",
        r"attack",
    ),
    Term(
        "base_link",
        "The point of the machine that all poses are of: the middle of the front axle, on the floor. x points forward, y to the "
        "left, z up.",
    ),
    Term("boulder", "A rock that stands out of the face by more than 0.28 m and is too large for loose rubble."),
    Term(
        "connection",
        "A way within one node of the topology, between two of its points, with its length, least radius and room. Infeasible: "
        "the machine cannot drive it; closed: an operator has closed it.",
        r"\bconnections?\b",
    ),
    Term(
        "degenerate",
        "Said of a scan that does not show the motion in one direction: between two smooth parallel walls every place along them "
        "looks the same. The column of that name in diagnostics.parquet; the page says weak.",
        r"\bdegenerate\b(?!_)",
    ),
    Term(
        "drift of a path",
        "The error that grows with the distance driven, because each step adds a little. In per cent: error over length, the mean "
        "of many stretches of the same length.",
        r"mean drift|drift is not corrected|drift between",
    ),
    Term(
        "drift, the tunnel", "A horizontal tunnel in a mine.", r"(the|a|smooth) drift\b(?! (of|itself|is not|between))"
    ),
    Term(
        "expected error",
        "How far the end of the path may be off against its start, so that 95 of 100 drives are within: put together from what "
        "each step may be off, closed loops taken into account. 'At least' where nothing told the motion on a stretch.",
    ),
    Term(
        "face",
        "The surface of the pile, or of whatever closes the drift, that the machine looks at.",
        r"\bface\b",
    ),
    Term(
        "inclination",
        "The slope of the pile's face in degrees: 0 is the floor, -45 a pile, -90 an upright wall, beyond that an overhang.",
    ),
    Term(
        "information",
        "What a scan alone says about the motion: one over the variance, in 1/m² and 1/rad². The page shows the standard "
        "deviation, one over its root.",
        r"\binformation\b",
    ),
    Term(
        "intersection",
        "A node of the topology where three or more tunnels meet; its degree says how many.",
    ),
    Term(
        "key scan",
        "A scan that is kept, so that its place can be recognised when the machine comes there again.",
    ),
    Term(
        "level",
        "What of a mine lies at one height, and is drawn on one sheet; a ramp leads from one to another.",
        r"\blevels?\b(?! (2D )?scanner| floor)",
    ),
    Term(
        "limits E_L, E_R",
        "The left and right end of the pile's toe, at the walls; the width is what lies between.",
        r"\bE_L\b",
    ),
    Term(
        "loop closure",
        "A place that was recognised when the machine came there a second time. It shows the drift since the first time, which is "
        "then spread over the path.",
        r"loop closure",
    ),
    Term(
        "lost stretch",
        "Scans in a row that did not fit the map so far. Their poses are carried on from the motion before: the map may be bent "
        "there.",
    ),
    Term(
        "odometry",
        "The path from step to step, by matching each scan with the walls seen before; wheels help where there are any.",
        r"\bodometry\b",
    ),
    Term(
        "partial folder",
        "NAME.partial holds what a run has written so far, and keeps what was finished when it was interrupted. A complete map "
        "has its name without .partial.",
        r"\.partial",
    ),
    Term(
        "pose",
        "Where the machine is and how it is turned: x, y, z, roll, pitch and heading at a time.",
        r"\bposes?\b",
    ),
    Term(
        "real-time factor",
        "Duration of the drive over duration of the computing: 10 × means that an hour of driving takes six minutes.",
        r"real time",
    ),
    Term(
        "slip",
        "How much faster the wheels turn than the machine moves, as a share of the speed. At a stand there is none.",
    ),
    Term(
        "standard deviation",
        "How far a figure may be off: two times out of three the truth is within one of them, 95 times out of 100 within two. "
        "Written behind ±.",
        r"deviation|±",
    ),
    Term(
        "status of a pile",
        "loadable: can be loaded; too shallow: too flat to fill a bucket; hang up: too steep or overhanging, rock may come down; "
        "wall: bare rock closes the drift; none: nothing closes it. Unknown (null): a reason says why.",
        r"Ore pile",
    ),
    Term(
        "support",
        "The share of a scan's hits that agree with the map once the scan is matched; a column of diagnostics.parquet.",
        r"\bsupport\b",
    ),
    Term(
        "topology",
        "The map as a graph of nodes, tunnels and intersections, with access points, waypoints and connections; "
        "topology.geojson. Routes are planned on it.",
    ),
    Term("toe", "The foot of the pile: the line where its face meets the floor.", r"\btoe\b"),
    Term(
        "tunnel",
        "A node of the topology that is a single path between two ends: intersections, a dead end, or unexplored, where the drift "
        "goes on but the machine has not been. Only seen: the machine has looked into it and was not in it.",
        r"\btunnels?\b",
    ),
    Term(
        "waypoint",
        "A pose in a node of the topology where something is done: draw point, dump, park, turning bay, passing bay, a stop, or "
        "a place to pass.",
    ),
    Term(
        "weak scan",
        "A scan that fixes one direction badly (see degenerate). The motion there comes from the wheels, or is carried on from "
        "before; the map is right across the walls, and less sure along them.",
        r"weak scan",
    ),
)


def list_of(body: str) -> str:
    """Return, as markup, the words that a page of this markup uses, with what they mean."""
    text = re.sub(r"<pre>.*?</pre>|<[^>]*>", " ", body, flags=re.DOTALL)
    used = [term for term in TERMS if re.search(term.pattern or re.escape(term.word), text, re.IGNORECASE)]
    return markup.terms((term.word, term.meaning) for term in used)


def as_markdown() -> str:
    """Return the list as it stands in `docs/glossary.md`."""
    return "\n".join(f"**{term.word}**: {term.meaning}\n" for term in TERMS)
