"""Rows that take too long or too much memory, and the warm-up of a machine."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from lhdmap.batch.limits import Limits
from lhdmap.batch.pool import run_here
from lhdmap.batch.work import BatchJob, Warm
from lhdmap.cli.main import main
from lhdmap.errors import UsageError

from tests.batch.works import warm, warm_dies, work


def _jobs(folder: Path, *names: str, command: str = "pile") -> list[BatchJob]:
    return [BatchJob(name, (command, str(folder / name))) for name in names]


def test_a_row_over_its_time_is_ended_once(tmp_path: Path) -> None:
    runs = {ran.key: ran for ran in run_here(_jobs(tmp_path, "long", "good"), work, 1, limits=Limits(row_time_s=3.0))}
    assert runs["long"].outcome is None
    assert runs["long"].reason == "ended: it took more than 3 s (--row-time-s)"
    assert 3.0 < runs["long"].wall_s < 20.0  # of the minute that it wanted
    assert (tmp_path / "long.tries").stat().st_size == 1
    assert runs["good"].outcome is not None


def test_a_row_over_its_memory_is_ended_once(tmp_path: Path) -> None:
    runs = {ran.key: ran for ran in run_here(_jobs(tmp_path, "fat", "good"), work, 1, limits=Limits(memory_gib=0.3))}
    assert runs["fat"].outcome is None
    assert runs["fat"].reason.endswith("GiB of memory, more than 0.3 (--memory-limit-gib)")
    assert (tmp_path / "fat.tries").stat().st_size == 1
    assert runs["good"].outcome is not None


@pytest.mark.parametrize("limits", [{"row_time_s": 0.0}, {"memory_gib": -1.0}, {"row_time_s": float("nan")}])
def test_limits_are_positive(limits: dict[str, float]) -> None:
    with pytest.raises(UsageError, match="more than 0"):
        Limits(**limits)


def test_limits_are_of_this_machine(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "m.csv").write_text("log\na.mcap\n", encoding="utf-8")
    words = ["batch", str(tmp_path / "m.csv"), "--cluster", "tcp://127.0.0.1:1", "--row-time-s", "9"]
    pytest.importorskip("distributed")
    assert main(words) == 2
    assert "--memory-limit" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("call", "command", "told"),
    [(warm, "build-map", "kernels ready in"), (warm_dies, "build-map", "left to the rows"), (warm, "pile", "")],
)
def test_kernels_are_made_ready_once(call: Callable[[], None], command: str, told: str, tmp_path: Path) -> None:
    lines: list[str] = []
    jobs = _jobs(tmp_path, "good", "good_2", "good_3", command=command)
    runs = list(run_here(jobs, work, 2, warm=Warm(call, lines.append)))
    assert all(ran.outcome is not None for ran in runs)
    assert len(lines) == (2 if told else 0)
    assert told in "".join(lines)
