"""Rows on a scheduler of dask.distributed, where that is installed: in this process, without a port that others reach."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import pytest
from lhdmap.batch.cluster import run_on_cluster
from lhdmap.batch.work import BatchJob, JobOutcome
from lhdmap.errors import InputError

distributed = pytest.importorskip("distributed")


def _work(words: Sequence[str]) -> JobOutcome:
    if words[0] == "raise":
        raise ValueError("odd")
    return JobOutcome(int(words[0]), {"asked": words[0]})


@pytest.fixture
def address() -> Iterator[str]:
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, host="127.0.0.1", protocol="tcp"
    ) as cluster:
        yield cluster.scheduler_address


def test_each_row_ends_once(address: str) -> None:
    jobs = [BatchJob(name, (word,)) for name, word in (("a", "0"), ("b", "3"), ("c", "raise"), ("d", "0"))]
    runs = {ran.key: ran for ran in run_on_cluster(jobs, _work, address, lambda _: None)}
    assert sorted(runs) == ["a", "b", "c", "d"]
    codes = {key: None if ran.outcome is None else ran.outcome.exit_code for key, ran in runs.items()}
    assert codes == {"a": 0, "b": 3, "c": None, "d": 0}
    assert runs["c"].reason == "ValueError: odd"


def test_without_workers_it_gives_up() -> None:
    told: list[str] = []
    with (
        distributed.LocalCluster(
            n_workers=0, processes=False, dashboard_address=None, host="127.0.0.1", protocol="tcp"
        ) as cluster,
        pytest.raises(InputError, match="no workers"),
    ):
        list(run_on_cluster([BatchJob("a", ("0",))], _work, cluster.scheduler_address, told.append, patience_s=1.0))
