"""Rows on a scheduler of dask.distributed, where that is installed: in this process, without a port that others reach."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import lhdmap
import pytest
from lhdmap.batch.cluster import _timed, run_on_cluster
from lhdmap.batch.nodes import OWN_VERSION, check_versions
from lhdmap.batch.work import BatchJob, JobOutcome, Warm
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


def _fails() -> None:
    raise ValueError("no compiler")


def _nothing() -> None:
    pass


def test_kernels_are_made_ready_once_a_node(address: str) -> None:
    jobs = [BatchJob("a", ("build-map",))]
    for call, ending in ((_nothing, "s"), (_fails, "kernels are left to the rows: ValueError: no compiler")):
        told: list[str] = []
        (ran,) = run_on_cluster(jobs, _first, address, told.append, warm=Warm(call, told.append))
        assert ran.outcome is not None
        assert told[0] == "kernels are made ready, once on each of 1 node"
        assert len(told) == 2
        assert told[1].startswith("node 127.0.0.1: ")
        assert told[1].endswith(ending)


def _first(words: Sequence[str]) -> JobOutcome:
    return JobOutcome(0, {"asked": words[0]})


class _Nodes:
    """A client of a cluster whose workers are told of: what one process cannot be, several versions."""

    def __init__(self, **workers: dict[str, str]) -> None:
        self._own = {"python": "3.11.7.final.0", "lhdmap": lhdmap.__version__, "numpy": "2.1", "dask": "2026.8"}
        self._workers = {name: self._own | different for name, different in workers.items()}

    def get_versions(self, packages: Sequence[str]) -> dict[str, Any]:
        assert "numba" in packages
        workers = {f"tcp://{name}:1": {"packages": versions} for name, versions in self._workers.items()}
        scheduler = {"python": "3.11.2.final.0", "dask": "2026.8"}  # it needs no lhdmap
        return {"client": {"packages": self._own}, "scheduler": {"packages": scheduler}, "workers": workers}

    def run(self, call: Callable[[str], str], words: str, on_error: str) -> dict[str, object]:
        assert (call(words), on_error) == (lhdmap.__version__, "return")
        told = {name: versions["lhdmap"] or ImportError("lhdmap") for name, versions in self._workers.items()}
        return {f"tcp://{name}:1": version for name, version in told.items()}

    def scheduler_info(self, n_workers: int) -> dict[str, Any]:
        return {"workers": {f"tcp://{name}:1": {"name": name} for name in self._workers}}


def test_nodes_of_other_versions_are_named() -> None:
    check_versions(_Nodes(one={}, two={"python": "3.11.9.final.0"}))
    with pytest.raises(InputError) as caught:
        check_versions(_Nodes(one={}, two={"lhdmap": "0.0.9"}, three={"lhdmap": ""}, four={"python": "3.12.1.final.0"}))
    told = str(caught.value)
    assert f"worker two at tcp://two:1 has lhdmap 0.0.9, here {lhdmap.__version__}" in told
    assert f"worker three at tcp://three:1 has no lhdmap, here {lhdmap.__version__}" in told
    assert "worker four at tcp://four:1 has python 3.12, here 3.11" in told
    assert "worker one" not in told


def test_a_worker_that_comes_later_is_looked_at_too() -> None:
    with pytest.raises(InputError, match=r"9\.9 was wanted"):
        _timed(_first, ("a",), "9.9")


def test_versions_of_a_real_cluster_agree(address: str) -> None:
    with distributed.Client(address) as client:
        check_versions(client)
        assert list(client.run(eval, OWN_VERSION).values()) == [lhdmap.__version__]
