"""evaluation/loading.md out of evaluation/loading.json: what was wanted, what was measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lhdmap.evaluation.loading.paper import printed_3, printed_5
from tests.loading.digging.charges import MIX

from tools.evaluate.loading_bounds import section

Found = Mapping[str, Any]
_HEAD = """\
# Loading: charging, excavation, weighing, another attempt

By `python -m tools.evaluate.loading` ({loads}). **All figures are those of the model of machine and ground in
`simulation/ground`, calibrated to the paper's Tables 3 to 5, never a mine's.** Loads are seeds from 1000 on, which nothing was
tuned on; ± and brackets: 95 % of a mean. The mines beside the default one were not tuned on. How it works:
[loading control](../docs/loading_control.md).
"""
_TUNING = """\
`paper` has the printed Table 1 and the printed detector; it is not tuned. `paper-tuned` and `adaptive` had the same search with
the same budget (120 candidates on 10 loads, 16 on 30, 4 on 80; `tools.evaluate.loading_tune`), both on an earlier calibration of
the default mine, with the fused detector. Same piles for all three; a load ends at 90 % as seen (σ 5 %), after six attempts at
most. A dig lasts from the touch to its stop, as in the paper; `adaptive` ends with the bucket less far back, and the pull back
racks it: "until racked" has that time in it, for all.
"""


def page(found: Found) -> str:
    """Return the page; parts that were not measured are left out."""
    parts: dict[str, Callable[[Any], str]] = {
        "tables": _tables, "methods": _methods, "errata": _errata, "detection": _detection,
        "weighing": _weighing, "attempts": _attempts,
    }  # fmt: skip
    count = found.get("methods", {}).get("default", {}).get("rows", {}).get("paper", {}).get("n", 0)
    texts = [_HEAD.format(loads=f"{count} loads a method on the default mine")]
    texts += [write(found[name]) for name, write in parts.items() if name in found]
    texts += [section(found["bounds"], found["tables"]["default"])] if "bounds" in found and "tables" in found else []
    return "\n".join(texts)


def _tables(found: Found) -> str:
    lines = ["## Tables 3, 4 and 5 by `paper` with its own detector", ""]
    lines += ["The operator is part of the experiment: he stops as published in the mine's file (`[operator]`).", ""]
    lines += [
        (
            "| mine | loads | fill 1st / 2nd / 3rd / 4th % | dig s | reach 2nd / 3rd / 4th % | "
            "attempts | final fill % | 6 to 20 s % | detection right % |"
        )
    ]
    lines += ["| --- | --- | --- | --- | --- | --- | --- | --- | --- |"]
    rows = printed_5()
    total = rows[0].n
    mean = sum(row.number * row.n for row in printed_3()) / total
    fills, seconds = _slashes(100.0 * row.fill for row in rows), _slashes((row.duration_s for row in rows), 1)
    reach = _slashes(100.0 * row.n / total for row in rows[1:])
    lines.append(_cells(["the paper", str(total), fills, seconds, reach, f"{mean:.2f}", "91", "-", "91"]))
    for mine, one in found.items():
        five, four = one["table5"]["rows"], one["table4"]
        cells = [mine, str(one["table3"]["n"]), _slashes(100.0 * row["fill"]["mean"] for row in five)]
        cells += [_slashes((row["duration_s"]["mean"] for row in five), 1)]
        cells += [_slashes(100.0 * row["share"] for row in five[1:]), _stat(four["attempts"])]
        cells += [f"{100.0 * four['fill']['mean']:.0f}", f"{100.0 * one['table5']['within_6_to_20_s']:.1f}"]
        lines.append(_cells([*cells, f"{100.0 * four['detection_right']:.1f}"]))
    wanted = (
        "Wanted (default mine): 62 ± 5, then 77, 82, 90 ± 6 %; attempts 2.47 ± 0.25; 95 % of the digs within 6 to 20 s."
    )
    return "\n".join([*lines, "", wanted, "", _missed(found["default"]), ""])


def _missed(one: Found) -> str:
    """Return what of Tables 3 to 5 the default mine does not reproduce."""
    rows, four = one["table5"]["rows"], one["table4"]
    said = []
    for printed, row, room in zip(printed_5(), rows, (5.0, 6.0, 6.0, 6.0), strict=False):
        fill, (low, high) = 100.0 * row["fill"]["mean"], (100.0 * end for end in row["fill"]["mean_95"])
        if abs(fill - 100.0 * printed.fill) > room:
            said.append(
                f"fill {printed.number}: {fill:.0f} [{low:.0f}, {high:.0f}] of {row['n']} loads for {100.0 * printed.fill:.0f} %"
            )
    if abs(four["attempts"]["mean"] - 74 / 30) > 0.25:
        said.append(f"attempts {four['attempts']['mean']:.2f}")
    first, later = rows[0]["duration_s"]["mean"], rows[1]["duration_s"]["mean"]
    tail = f"The first dig is {first - later:.1f} s longer than the second; in the paper 2.5 s, which the model does not explain."
    return f"Missed: {'; '.join(said) or 'none'}. {tail}"


def _stat(stat: Found) -> str:
    low, high = stat["mean_95"]
    return f"{stat['mean']:.2f} ± {0.5 * (high - low):.2f}"


def _slashes(values: Any, digits: int = 0) -> str:
    return " / ".join(f"{value:.{digits}f}" for value in values)


def _methods(found: Found) -> str:
    lines = ["## `adaptive` beside `paper-tuned`", "", _TUNING]
    heads = [
        "mine",
        "method",
        "loads",
        "first fill",
        "attempts",
        "first dig s",
        "dig s / load",
        "until racked",
        "slip s / load",
        "final",
        "time-outs %",
        "back-offs / dig",
        "lifts / dig",
    ]
    lines += [_cells(heads), _cells(["---"] * len(heads))]
    for mine, one in found.items():
        for method, row in one["rows"].items():
            shown = [_of(row[name]) for name in ("first", "attempts", "first_dig_s", "dig_s", "racked_s", "slip_s")]
            last = [
                f"{row['final'][0]:.2f}",
                f"{100.0 * row['time_outs']:.1f}",
                f"{row['back_offs']:.1f}",
                f"{row['lifts']:.1f}",
            ]
            lines.append(_cells([mine, method, str(row["n"]), *shown, *last]))
    lines += [
        "",
        "Differences on the same piles:",
        "",
        "| mine | method | first fill | attempts | dig s / load | slip s / load |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for mine, one in found.items():
        pairs = {f"{name} - paper": each for name, each in one["paired"].items()} | {
            "adaptive - paper-tuned": one["over tuned"]
        }
        for name, each in pairs.items():
            lines.append(
                _cells([mine, name, *(_of(each[key], sign="+") for key in ("first", "attempts", "dig_s", "slip_s"))])
            )
    lines += ["", _wanted(found["default"]), ""]
    return "\n".join(lines)


def _wanted(one: Found) -> str:
    """Return the targets of the default mine beside what was measured."""
    rows, pair = one["rows"], one["paired"]["adaptive"]
    ours, paper = rows["adaptive"], rows["paper"]
    dig, until, slip = (ours[name][0] / paper[name][0] - 1.0 for name in ("dig_s", "racked_s", "slip_s"))
    first = pair["first"]
    fuller = first[0] >= 0.15 and first[1] > 0.10
    table = [
        ("first fill over `paper`", _of(first, sign="+"), "≥ +0.15, interval above +0.10", fuller),
        ("attempts to 90 %", _of(ours["attempts"]), "≤ 2.2", ours["attempts"][0] <= 2.2),
        ("dig time per load", f"{100.0 * dig:+.0f} %", "-10 %", dig <= -0.10),
        ("the same until the bucket is racked", f"{100.0 * until:+.0f} %", "-10 %", until <= -0.10),
        ("slip time per load", f"{100.0 * slip:+.0f} %", "-15 %", slip <= -0.15),
        ("time-outs", f"{100.0 * ours['time_outs']:.1f} %", "≤ 1 %", ours["time_outs"] <= 0.01),
    ]  # fmt: skip
    lines = ["| `adaptive`, default mine | measured | wanted | |", "| --- | --- | --- | --- |"]
    lines += [f"| {name} | {value} | {wanted} | {'yes' if ok else '**no**'} |" for name, value, wanted, ok in table]
    return "\n".join(lines)


def _of(value: Any, sign: str = "") -> str:
    mean, low, high = value
    digits = 2 if abs(mean) < 10.0 else 1
    return f"{mean:{sign}.{digits}f} [{low:{sign}.{digits}f}, {high:{sign}.{digits}f}]"


def _cells(cells: Any) -> str:
    return "| " + " | ".join(cells) + " |"


def _errata(found: Found) -> str:
    lines = [
        "## Each step as printed, or read otherwise",
        "",
        "Default mine, the paper's operator, one change at a time.",
        "",
    ]
    lines += [
        (
            "| variant | fill 1st / 2nd / 3rd / 4th % | attempts | first dig s | longest 1 % s | "
            "slip s / load | lifts / dig | ends racked / boom / way / time-out % | early % |"
        )
    ]
    lines += ["| --- | --- | --- | --- | --- | --- | --- | --- | --- |"]
    for name, row in found.items():
        fills = " / ".join("-" if fill is None else f"{100.0 * fill:.0f}" for fill in row["fills"])
        ends = _slashes([*(100.0 * share for share in row["ends"].values()), 100.0 * row["time_outs"]])
        cells = [name, fills, f"{row['attempts'][0]:.2f}", f"{row['first_dig_s'][0]:.1f}", f"{row['p99_s']:.1f}"]
        cells += [f"{row['slip_s'][0]:.2f}", f"{row['lifts']:.1f}", ends, f"{100.0 * row['early']:.0f}"]
        lines.append(_cells(cells))
    n = next(iter(found.values()))["n"]
    lines += [
        "",
        f"{n} loads each; early: early triggers for each attempt that followed them (eight in a row at most).",
        "",
    ]
    return "\n".join(lines)


def _detection(found: Found) -> str:
    mix = ", ".join(f"{100.0 * share:.0f} % {kind}" for kind, share in MIX.items())
    n = next(iter(found.values()))["n"]
    lines = [
        "## Has it touched the pile?",
        "",
        (
            f"{n} charges of 5 to 10 m: {mix}. The toe is perceived with a constant error of each "
            f"charge (σ as published in the mine's file)."
        ),
        "",
    ]
    lines += [
        (
            f"| detector | charges | right % | early % | none % | {' / '.join(MIX)}, right % | from the first "
            f"touch, s | from 40 kN, s |"
        )
    ]
    lines += ["| --- | --- | --- | --- | --- | --- | --- | --- |"]
    for name, row in found.items():
        delays = [
            " / ".join(f"{value:.2f}" for value in row[key]) if key in row else "-" for key in ("touch_s", "force_s")
        ]
        shares = [f"{100.0 * row[what]:.1f}" for what in ("right", "early", "none")]
        lines.append(
            _cells([name, str(row["n"]), *shares, _slashes(100.0 * value for value in row["by"].values()), *delays])
        )
    lines += [
        "",
        (
            "Delays: median / 95 %. Wanted of `fused`: right ≥ 98.5 %, early ≤ 1 %, ≤ 0.6 s from the "
            "first touch, ≤ 0.3 s from 40 kN (medians)."
        ),
        "",
    ]
    return "\n".join(lines)


def _weighing(found: Found) -> str:
    lines = [
        "## Weighing",
        "",
        "Fills 0.3 to 1.1: rocking at 1 to 2 Hz and a boom at 3 to 5 Hz, noise of 1.5 bar; zero 0.6 bar, friction 1.2 bar,",
        "load centre 2 %, boom's angle 1 % of a fill (1 σ, all assumed). In the loop: after the first dig of `adaptive` on the",
        "default mine. Eq. (9) is calibrated with a boom that came from below, as it is weighed: friction is in it; a tare",
        "takes the zero out.",
        "",
        "| | buckets | bias % | 1 σ % | rms % | σ as told % | settled s, median / 95 % | not settled % |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, row in found.items():
        shown = [f"{100.0 * row['bias']:+.1f}", *(f"{100.0 * row[key]:.1f}" for key in ("std", "rms", "told"))]
        settled = f"{row['settling_s'][0]:.1f} / {row['settling_s'][1]:.1f}"
        lines.append(_cells([name, str(row["n"]), *shown, settled, f"{100.0 * row['unsettled']:.1f}"]))
    said = "Wanted: 1 σ ≤ 4 %, settled ≤ 4 s (95 %). What does not settle in 4 s is weighed then, and says so."
    return "\n".join([*lines, "", said, ""])


def _attempts(found: Found) -> str:
    lines = [
        "## Another attempt?",
        "",
        (
            "Full buckets per hour; half of the loads to fit the gains, the other half judged; 20 s "
            "of overhead for each attempt (assumed), weighed with 4 %. ± is one σ of that mean."
        ),
        "",
    ]
    lines += [
        (
            "| method | haul s | rule | stops at | attempts | best threshold | its rate | rule / "
            "best | one attempt | until 90 % |"
        )
    ]
    lines += ["| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"]
    for method, hauls in found.items():
        for haul_s, row in hauls.items():
            rates = [f"{row[key][0]:.2f} ± {row[key][1]:.2f}" for key in ("rule", "best", "one", "at 0.90")]
            cells = [method, haul_s, rates[0], f"{row['stops_at']:.2f}", f"{row['mean_attempts']:.2f}"]
            cells += [f"{row['best_threshold']:.2f}", rates[1], f"{row['ratio']:.3f}", *rates[2:]]
            lines.append(_cells(cells))
    lines += [
        "",
        (
            "Wanted: within 1 % of the best fixed threshold (which is chosen with hindsight on the "
            "judged loads themselves)."
        ),
        "",
    ]
    return "\n".join(lines)
