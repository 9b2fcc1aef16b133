"""What a run costs: compilation is counted once and apart, and page, map.json and result have the same figures."""

from __future__ import annotations

import json
import time

import numba as nb
import pytest
from lhdmap.pipeline.build import BuildResult
from lhdmap.pipeline.cost import CompileClock, Spent, cost
from lhdmap.report.text import duration, times


def test_compiling_is_counted_once_and_a_compiled_kernel_costs_nothing() -> None:
    @nb.njit
    def inner(x):  # type: ignore[no-untyped-def]
        return x + 1.0

    @nb.njit
    def outer(x):  # type: ignore[no-untyped-def]
        return inner(x) * 2.0

    began = time.monotonic()
    with CompileClock() as clock:
        assert outer(1.0) == 4.0
        took_s, counted_s = time.monotonic() - began, clock.seconds
        assert 0.5 * took_s < counted_s <= took_s, "nearly all of it was compilation, and the inner kernel counts once"
        outer(2.0)
        assert clock.seconds == counted_s
    outer(1)  # of integers: compiled anew, but no longer listened to
    assert clock.seconds == counted_s


def test_the_longer_of_two_processes_that_compile_counts() -> None:
    found = cost(time.monotonic() - 100.0, 50.0, Spent(300.0, 20.0), Spent(200.0, 41.0))
    assert found["compile_s"] == 41.0
    assert found["peak_memory_mib"] == 500.0
    assert found["realtime_factor"] == pytest.approx(0.5, rel=0.01)
    assert cost(time.monotonic() - 1.0, 1.0, Spent(0.0, 99.0), Spent())["compile_s"] == pytest.approx(1.0, abs=0.1)


def test_page_map_and_result_have_the_same_figures(built: BuildResult) -> None:
    counts = json.loads((built.folder / "map.json").read_text(encoding="utf-8"))["counts"]
    page = (built.folder / "report.html").read_text(encoding="utf-8")
    for name in ("wall_s", "realtime_factor", "peak_memory_mib", "compile_s"):
        assert counts[name] == built.summary[name]
    assert f"<b>{times(built.summary['realtime_factor'])}</b>" in page
    assert f"<b>{built.summary['peak_memory_mib']:.0f} MiB</b>" in page
    assert f"{duration(built.summary['wall_s'])} of computing" in page
    assert "<!-- cost -->" not in page
