"""The page of `loading_faults`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

HEAD = """\
# Faults while a machine loads

By `python -m tools.evaluate.loading_faults`: {runs} runs of `{scenario}` with perception in the loop
([replay](../docs/replay.md)), each with one fault of 10 s, which begins by chance within a state of the loading machine; a run
goes on for 12 s after its fault, or to the end. `biased`: 0.05 m, 0.15 m/s, 0.5°, 20 bar; `delayed`: by 0.5 s. Of the {all_pairs}
combinations of sensor, fault and state these are {runs}: each sensor with each fault, each state with each fault, and the link
in each state. **Machine and ground are a model.**

Wanted of each: no contact; a stop within the stopping distance; no motion on a signal that is silent or late (0.38 s, the link
2.1 s, and 1.5 s to stand); after a stop nothing moves before it was armed again; no state longer than its limit.
A sensor that repeats itself with new stamps is not silent: how long it took until that was noticed is in the table (what was
found first: frozen joints let a dig go on, and nothing would have stopped the boom; mended; the 9 runs in which a sensor freezes
that the state lives on are with that, the other 38 from before). A bias is not noticed as
such; wanted is that nothing is touched. What the state does not need may be broken: it goes on.

| | |
| --- | --- |
"""
ALL_PAIRS = 7 * (8 * 4 + 1)


def page(rows: Sequence[dict[str, Any]], scenario: str = "loading_stope") -> str:
    """Return the page of so many runs."""
    missed = [one for one in rows if one["missed"]]
    rushed = [one["worst_stop"] for one in rows if one["worst_stop"] > 0.0]
    facts = {
        "runs": len(rows),
        "in which something was missed": len(missed),
        "contacts": sum("contact" in what for one in rows for what in one["missed"]),
        "motion on old data, or before arming": sum("move" in what for one in rows for what in one["missed"]),
        "stopped by watchdog or task within the fault": sum(_noticed(one) for one in rows),
        "asked for help within the run": sum(one["asked_after_s"] is not None for one in rows),
        "way of a stop over the stopping distance, worst": f"{max(rushed):.2f}" if rushed else "-",
        "least clearance": f"{min((one['clearance_m'] for one in rows), default=0.0):.2f} m",
    }
    head = HEAD.format(runs=len(rows), scenario=scenario, all_pairs=ALL_PAIRS)
    told = "\n".join(f"| {name} | {value} |" for name, value in facts.items())
    return f"{head}{told}\n\n{_by_kind(rows)}\n{_each(rows)}\n"


def _noticed(one: dict[str, Any]) -> bool:
    """Return whether it was stopped while the fault lasted; that an operator hands over is no stop."""
    within = one["stopped_after_s"] is not None and one["stopped_after_s"] < _LASTS_S
    return within and not one["why"].startswith("operator says")


_LASTS_S = 10.5


def _by_kind(rows: Sequence[dict[str, Any]]) -> str:
    lines = ["| fault | runs | stopped | asked for help | went on | missed |", "|" + " --- |" * 6]
    for kind, count in Counter(one["kind"] for one in rows).items():
        of = [one for one in rows if one["kind"] == kind]
        stopped = [one for one in of if _noticed(one)]
        asked = [one for one in of if one not in stopped and one["asked_after_s"] is not None]
        went = count - len(stopped) - len(asked)
        lines.append(
            f"| {kind} | {count} | {len(stopped)} | {len(asked)} | {went} | {sum(bool(one['missed']) for one in of)} |"
        )
    return "\n".join(lines) + "\n"


def _each(rows: Sequence[dict[str, Any]]) -> str:
    lines = [
        "## Each run",
        "",
        "| state | sensor | fault | at, s | stopped after, s: why | help asked after, s | then | missed |",
        "|" + " --- |" * 8,
    ]
    for one in sorted(rows, key=lambda one: (one["at_s"], one["sensor"])):
        stop = "-" if not _noticed(one) else f"{one['stopped_after_s']:.2f}: {one['why']}"
        asked = "-" if one["asked_after_s"] is None else f"{one['asked_after_s']:.1f}: {one['asked']}"
        ways = " → ".join(one["ways"]) or "no change"
        cells = (one["state"], one["sensor"], one["kind"], f"{one['at_s']:.1f}", stop, asked, ways)
        lines.append(f"| {' | '.join(cells)} | {'; '.join(one['missed']) or 'nothing'} |".replace("_", " "))
    return "\n".join(lines)
